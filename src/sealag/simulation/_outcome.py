"""How a run ends: a named result, never an exception of linear algebra."""

from enum import StrEnum


class Outcome(StrEnum):
    """How a simulated run ended."""

    COMPLETED = "completed"
    """The whole duration was simulated."""
    FELL = "fell"
    """The base tilted or sank beyond the posture limits."""
    DIVERGED = "diverged"
    """A velocity or spring deflection left any physical range, or a number was not finite or could
    not be computed."""
    CONTACT_UNSOLVABLE = "contact_unsolvable"
    """No set of contact forces satisfies the contact conditions in this state."""
    CHATTERED = "chattered"
    """Contacts opened and closed too often within one step."""
    CONTROLLER_FAILED = "controller_failed"
    """The controller raised one of sealag's errors, its arithmetic broke down, or it commanded a
    number that is not finite."""
    INTERRUPTED = "interrupted"
    """The user stopped the run; what was simulated until then is complete."""


class EventKind(StrEnum):
    """What happened at a contact point, located inside a step."""

    TOUCHDOWN = "touchdown"
    LIFT_OFF = "lift_off"


class PlantStop(Exception):
    """Ends a step that cannot be completed; carries the outcome and a sentence."""

    def __init__(self, outcome: Outcome, message: str) -> None:
        super().__init__(message)
        self.outcome = outcome
        self.message = message
