"""The delay that counts of a design: passive, jitter or constant."""

from sealag.design import System
from sealag.errors import ContractionError, SolverError
from sealag.tune._question import Number, Question
from sealag.typing import Array

_SURELY = 1e-3
"""1/s: growth that no rounding of a loop's zero roots makes. Slower growth is left to the margin's
own decision, which takes longer."""


def passive_bound(question: Question, system: System) -> float:
    """Return the smallest passive bound of a design along the question's motion, s.

    Args:
        question: along which motion.
        system: the design.
    """
    return float(_bounds(question, system).min())


def _bounds(question: Question, system: System) -> Array:
    """The passive bound of each instant (N,), s."""
    return system.certified_bounds(system.spaces(question.motion), None, question.motion).delay


def number_of(question: Question, system: System) -> tuple[float | None, str]:
    """Return the delay that counts of a design, s, and what stands in its way.

    Args:
        question: which number, along which motion.
        system: the design.

    Returns:
        The delay, None if not known; and "delay", "spring" or "stability".
    """
    if question.number is Number.PASSIVE:
        return passive_bound(question, system), "delay"
    try:
        if _unstable(question, system):  # its crossings, which nobody asks for, can take minutes
            return 0.0, "stability"
        if question.number is Number.CONSTANT:
            local = system.local(_bounds(question, system), question.motion)
            return local.margin_s, "stability" if local.unstable_modes else "delay"
        margins = system.local_margins(question.motion)
    except ContractionError:
        return 0.0, "spring"
    except SolverError:
        return None, "delay"
    return margins.jitter_s, "stability" if margins.unstable_modes else "delay"


def _unstable(question: Question, system: System) -> bool:
    """Whether the first instant is surely unstable without delay where it is held."""
    motion = question.motion
    loop = system.frozen(motion, 0, rest=system.in_posture(motion, 0))
    rightmost = loop.roots(0.0, count=1)
    return bool(len(rightmost)) and float(rightmost.real.max()) > _SURELY
