"""Closed sets of words in a certificate."""

from enum import StrEnum

_THIS_ROBOT = "this robot, linearised, every delay that varies as it likes below it"
_ANY_ROBOT = "any passive robot and environment, every delay that varies as it likes below it"


class Status(StrEnum):
    """What may be done with the design at its own delay.

    certified: passive by the criterion, and stable without delay and up to its delay, at every
    instant. passive_only: passive by the criterion, but no equilibrium is stable, or whether one is
    stays open: it falls or drifts unless it is stabilised by other means. not_certified: neither is
    shown, or its stability is lost before its delay.
    """

    CERTIFIED = "certified"
    PASSIVE_ONLY = "passive_only"
    NOT_CERTIFIED = "not_certified"


class Criterion(StrEnum):
    """Which criterion was used.

    published: (29), (31) as printed. certified: docs/theory section 6, for the law that is run.
    """

    PUBLISHED = "published"
    CERTIFIED = "certified"

    def holds_for(self) -> dict[str, str]:
        """Return against what each of a certificate's three numbers is robust, by their keys."""
        certified = self is Criterion.CERTIFIED
        return {
            "max_delay_s": _ANY_ROBOT if certified else "what (29) or (31) say as printed",
            "jitter_margin_s": _THIS_ROBOT,
            "local_margin_s": "this robot, linearised, a constant delay",
        }


class Basis(StrEnum):
    """What an instant's local margin rests on.

    exact: the margin itself. bound: the passive bound of that instant, which does not exceed its
    margin because the loop without delay is stable. searched: stable without delay, and no root
    crosses up to this delay. open: not decided.
    """

    EXACT = "exact"
    BOUND = "bound"
    SEARCHED = "searched"
    OPEN = "open"


class Place(StrEnum):
    """Where a loop is frozen.

    posture: in the instant's configuration, tasks without error. rest: where it comes to rest with
    the references as they are, with an error where springs sag.
    """

    POSTURE = "posture"
    REST = "rest"
