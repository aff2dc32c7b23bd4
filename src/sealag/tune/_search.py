"""The first crossing of a margin that has no closed form, from small gains up."""

from collections.abc import Callable

_GROWTH = 1.25
"""Factor between two gains that are tried. Ten times closer costs minutes; a range of gains that
fails between two that hold, and is narrower than this, is not seen."""
_WIDTH = 1e-5
"""Relative distance of the largest gain that holds from the next one that does not."""


def first_crossing(holds: Callable[[float], bool], *, low: float, high: float) -> float | None:
    """Return a gain that holds, where gains just above it do not: the first one from below.

    A margin need not fall with the gain: soft gains may not hold a robot up, and stiffer ones may
    hold again beyond a range that does not. Gains are tried upwards; the first that holds is
    followed until one does not, and the crossing between both is bisected.

    Args:
        holds: whether a gain meets the requirement.
        low: first gain that is tried.
        high: last one.

    Returns:
        The gain; None if none holds, `high` if all that follow do.
    """
    x, good = low, None
    while x <= high:
        if holds(x):
            good = x
        elif good is not None:
            return _bisected(holds, good, x)
        x *= _GROWTH
    return None if good is None else high if holds(high) else _bisected(holds, good, high)


def _bisected(holds: Callable[[float], bool], good: float, bad: float) -> float:
    while bad > good * (1.0 + _WIDTH):
        middle = (good * bad) ** 0.5
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good
