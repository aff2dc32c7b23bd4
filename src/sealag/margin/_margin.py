"""Exact delay margin of a frozen closed loop with one constant delay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.margin._crossings import Crossing, Found, crossings_of
from sealag.margin._loop import (
    Loop,
    has_zero_root,
    roots_at_once,
    time_of,
    undamped_whatever_the_delay,
)
from sealag.margin._pictures import Picture, Turn, frequency_of
from sealag.margin._roots import loop_roots
from sealag.margin._search import search
from sealag.typing import Array
from sealag.units import in_ms

_RESIDUAL = 1e-9
_AT = 1e-9
_MOST_IF_UNSTABLE = 3_000
"""Samples spent on the first crossing of an unstable loop. Robots need tens to hundreds; ten times
more take half a minute for zero roots that hide the crossings."""
_MOST_LISTED = 10_000
"""Crossings listed up to a horizon. Ten times more are 10 MB of JSON that nobody reads; ten times
fewer refuse a stiff loop over a few of its slowest periods."""
_METHOD = "excluded intervals, Newton"
_UNDAMPED = "undamped motion that the delay does not reach"


class Interval(NamedTuple):
    """A range of constant delays with one number of unstable roots.

    Attributes:
        lower: shortest delay, s.
        upper: longest delay, s; inf for the last range of a loop without crossings.
        unstable_roots: roots in the right half-plane in between; 0 is a stable range.
    """

    lower: float
    upper: float
    unstable_roots: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayMargin:
    """How much constant delay a loop tolerates; necessary and sufficient for the frozen loop.

    Attributes:
        delay: s; 0 when a root is not in the open left half-plane without delay, inf when no
            delay destabilises, else the first delay with a root on the imaginary axis.
        first_crossing: first positive delay at which a root reaches the axis from the left, also
            when the loop is unstable without delay; inf if none does, NaN if it cannot be told
            because an undamped motion stays on the axis whatever the delay.
        searched_to: delays up to it were searched, s; inf unless `at_most` was given. A `delay` or
            `first_crossing` of inf then says: longer than this.
        frequency: of that root, rad/s; NaN without a crossing.
        mode: (states,) complex eigenvector at the first crossing, largest entry 1; empty without.
        unstable_roots: roots not in the open left half-plane at zero delay, symmetries left out.
        neutral: structural zero roots taken out: the symmetries and their momentum chains.
        crossings: every crossing with its shortest delay and direction, by delay.
        intervals: ranges of delay with their unstable roots, when asked for; else empty.
        guaranteed: whether everything outside the crossings was excluded (up to rounding). False
            where a root lies at zero whatever the delay: it hides the slowest crossings, so that
            `first_crossing` may be too late there, while `delay` is 0. False too where rounding
            does not separate a touch at zero frequency, which needs an infinite delay, from a
            crossing at a very low one, which needs a very long delay.
        residual: relative residual of the characteristic equation at the first crossing.
        method: how it was found.
    """

    delay: float
    first_crossing: float
    searched_to: float
    frequency: float
    mode: Array
    unstable_roots: int
    neutral: int
    crossings: tuple[Crossing, ...]
    intervals: tuple[Interval, ...]
    guaranteed: bool
    residual: float
    method: str


def exact_margin(
    loop: Loop,
    *,
    at_most: float | None,
    intervals: bool,
    horizon: float | None,
    confirm: bool,
) -> DelayMargin:
    """Decide `DelayedLoop.margin`.

    Args:
        loop: the prepared loop.
        at_most: longest delay of interest, s.
        intervals: whether to list ranges of delay.
        horizon: longest delay listed, s.
        confirm: whether to count roots by collocation too.
    """
    if horizon is not None and time_of("horizon", horizon) == 0.0:
        raise InputError("horizon is 0 s; a positive time is needed.")
    if at_most is not None and (intervals or horizon is not None):
        raise InputError("at_most leaves crossings out that intervals need; give one of the two.")
    longest = math.inf if at_most is None else time_of("at_most", at_most)
    answer = _margin(loop, longest=longest)
    if intervals or horizon is not None:
        answer = replace(answer, intervals=_intervals(answer, horizon=horizon))
    if confirm:
        _check(loop, answer)
    return answer


def _margin(loop: Loop, *, longest: float) -> DelayMargin:
    """Count the roots without delay d, search for crossings up to the longest delay, and answer."""
    if not len(loop.A_0):
        return _answer(loop, (), unstable=0, longest=longest)
    unstable, on_axis = _roots_without_delay(loop, sign=1.0)
    if not loop.B.size:
        return _answer(loop, (), unstable=unstable, longest=longest)
    picture = _picture(loop, longest=longest, on_axis=on_axis)
    if picture is None:
        return replace(
            _answer(loop, (), unstable=unstable, longest=longest),
            first_crossing=math.nan, guaranteed=False, method=_UNDAMPED,
        )  # fmt: skip
    zero_root = on_axis and has_zero_root(loop)
    found = _found(picture, unstable=unstable)
    if found is None or (unstable and not (found.explained or zero_root)):
        return replace(
            _answer(loop, (), unstable=unstable, longest=longest),
            first_crossing=math.nan, guaranteed=False,
        )  # fmt: skip
    if not (found.explained or zero_root):
        raise SolverError(
            "A band of frequencies could be neither excluded nor refined to a crossing; the "
            "margin is not known."
        )
    crossings = tuple(one for one in found.crossings if one.delay <= longest)
    answer = _answer(loop, crossings, unstable=unstable, longest=longest, on_axis=on_axis)
    if answer.residual > _RESIDUAL:
        raise SolverError(
            f"The characteristic equation has a relative residual of {answer.residual:.1e} at "
            "the crossing; the margin is not known."
        )
    return replace(answer, guaranteed=found.decided and found.explained and not zero_root)


def _found(picture: Picture, *, unstable: int) -> Found | None:
    """The crossings; None if the loop is unstable and the search does not close: the margin is 0
    all the same, so that no long search is worth its time."""
    if not unstable:
        return crossings_of(picture, *search(picture))
    try:
        return crossings_of(picture, *search(picture, most=_MOST_IF_UNSTABLE))
    except SolverError:
        return None


def _picture(loop: Loop, *, longest: float, on_axis: bool) -> Picture | None:
    """The parameter to search over; None if an undamped motion stays whatever the delay.

    Raises:
        SolverError: roots on the axis hide the crossings from both references.
    """
    if not loop.embedded:
        if on_axis and undamped_whatever_the_delay(loop):
            return None
        return Turn(loop=loop, at_most=longest)
    if not on_axis:
        return frequency_of(loop, at_most=longest, reference=1.0)
    if not _roots_without_delay(loop, sign=-1.0)[1]:
        return frequency_of(loop, at_most=longest, reference=-1.0)
    return None


def _roots_without_delay(loop: Loop, *, sign: float) -> tuple[int, bool]:
    """Count the roots of A_0 ± A_1 and A_e e^{-λe} that are not surely in the left half-plane.

    With an embedded delay it is the count without it and every crossing on the way to e.

    Returns:
        The count, and whether one lies on the imaginary axis to rounding.
    """
    present = loop.A_0 + sign * loop.A_1
    count, on_axis = roots_at_once(present + loop.A_e)
    if not loop.embedded:
        return count, on_axis
    e = loop.embedded_delay
    inner = replace(
        loop, A_0=present, A_1=loop.A_e, A_e=np.zeros_like(present), embedded_delay=0.0, exact=False
    )
    if on_axis and undamped_whatever_the_delay(inner):
        return count, True
    picture = Turn(loop=inner, at_most=(1.0 + _AT) * e)
    found = crossings_of(picture, *search(picture))
    resting = on_axis and has_zero_root(inner)
    if not (found.explained or resting):
        raise SolverError(
            "A crossing on the way to the embedded delay could not be refined; the roots without "
            "delay are not known."
        )
    late = resting
    for one in found.crossings:
        passes = max(0, math.ceil(((1.0 + _AT) * e - one.delay) / one.period))
        late |= passes > 0 and one.delay + (passes - 1) * one.period >= (1.0 - _AT) * e
        already = passes > 0 and on_axis and _at_zero(one.delay, one) and one.direction > 0
        count += 2 * one.direction * (passes - already)
    return count, late


def _answer(
    loop: Loop,
    crossings: tuple[Crossing, ...],
    *,
    unstable: int,
    longest: float,
    on_axis: bool = False,
) -> DelayMargin:
    worse = [
        (delay, item)
        for item in crossings
        if (delay := _next(item, on_axis=on_axis)) is not None and delay <= longest
    ]
    first, crossing = min(worse, key=lambda pair: pair[0], default=(math.inf, None))
    return DelayMargin(
        delay=0.0 if unstable else first,
        first_crossing=first,
        searched_to=longest,
        frequency=crossing.frequency if crossing else math.nan,
        mode=crossing.mode if crossing else np.zeros(0, dtype=complex),
        unstable_roots=unstable,
        neutral=loop.neutral,
        crossings=crossings,
        intervals=(),
        guaranteed=True,
        residual=crossing.residual if crossing else 0.0,
        method=_METHOD,
    )


def _next(crossing: Crossing, *, on_axis: bool) -> float | None:
    """First positive delay at which this root comes from the left."""
    if crossing.direction < 0:
        return None
    if on_axis and _at_zero(crossing.delay, crossing):
        return crossing.delay + crossing.period
    return crossing.delay


def _at_zero(delay: float, crossing: Crossing) -> bool:
    """Whether a root of a loop that has one on the axis without delay is that one."""
    return delay * crossing.frequency < 1e-9


def _intervals(answer: DelayMargin, *, horizon: float | None) -> tuple[Interval, ...]:
    moving = [crossing for crossing in answer.crossings if crossing.direction]
    unstable = answer.unstable_roots
    if not moving:
        return (Interval(lower=0.0, upper=math.inf, unstable_roots=unstable),)
    end = horizon if horizon is not None else 20.0 * max(item.period for item in moving)
    _check_count(moving, end)
    events = sorted(
        (delay, item.direction)
        for item in moving
        for delay in np.arange(item.delay, end, item.period).tolist()
        if not _at_zero(delay, item)
    )
    ranges, lower = [], 0.0
    for delay, direction in events:
        if delay - lower > 1e-9 * delay:
            ranges.append(Interval(lower=lower, upper=delay, unstable_roots=unstable))
        lower, unstable = delay, unstable + 2 * direction
    return (*ranges, Interval(lower=lower, upper=end, unstable_roots=unstable))


def _check_count(moving: Sequence[Crossing], end: float) -> None:
    """Refuse a horizon before which roots cross more often than can be listed."""
    rate = sum(1.0 / item.period for item in moving)
    if rate * end <= _MOST_LISTED:
        return
    short = (_MOST_LISTED - len(moving)) / rate
    step = 10.0 ** math.floor(math.log10(short))
    short = math.floor(short / step) * step
    raise InputError(
        f"horizon is {in_ms(end)} ({end:g} s), before which roots cross the axis "
        f"{rate * end:.1g} times; at most {_MOST_LISTED:,} are listed: ask for {short:g} s "
        f"(--horizon-ms {short * 1e3:g})."
    )


def _check(loop: Loop, answer: DelayMargin) -> None:
    if answer.unstable_roots or not math.isfinite(answer.first_crossing):
        return
    below = loop_roots(loop, 0.999 * answer.delay, count=1)[0]
    above = loop_roots(loop, answer.delay, count=1)[0]
    if below.real >= 0.0 or abs(above.real) > 1e-6 * loop.size:
        raise SolverError(
            f"The rightmost root is {below:.3g} just below the margin and {above:.3g} at it; "
            "the margin is not known."
        )
