"""Exact delay margin of a frozen closed loop with one constant delay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.margin._crossings import Crossing, crossings_in
from sealag.margin._loop import Loop, has_zero_root, prepare, roots_without_delay, transfer_of
from sealag.margin._roots import loop_roots
from sealag.margin._sweep import candidate_bands
from sealag.typing import Array, ArrayLike

_RESIDUAL = 1e-9
_METHOD = "frequency sweep with excluded intervals, Newton"


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
        frequency: of that root, rad/s; NaN without a crossing.
        mode: (states,) complex eigenvector at the first crossing, largest entry 1; empty without.
        unstable_roots: roots not in the open left half-plane at zero delay, symmetries left out.
        neutral: structural zero roots taken out: the symmetries and their momentum chains.
        crossings: every crossing with its shortest delay and direction, by delay.
        intervals: ranges of delay with their unstable roots, when asked for; else empty.
        guaranteed: whether every frequency outside the crossings was excluded (up to rounding);
            False where a root lies at zero whatever the delay: it hides the slowest crossings, so
            that `first_crossing` may be too late there, while `delay` is 0.
        residual: relative residual of the characteristic equation at the first crossing.
        method: how it was found.
    """

    delay: float
    first_crossing: float
    frequency: float
    mode: Array
    unstable_roots: int
    neutral: int
    crossings: tuple[Crossing, ...]
    intervals: tuple[Interval, ...]
    guaranteed: bool
    residual: float
    method: str


def delay_margin(
    A_0: ArrayLike,
    A_1: ArrayLike,
    *,
    symmetries: ArrayLike | None = None,
    intervals: bool = False,
    horizon: float | None = None,
    confirm: bool = False,
) -> DelayMargin:
    """Exact margin of ẋ = A_0 x + A_1 x(t − d) for constant d (THEORY section 7).

    A root jω with z = e^{-jωd} solves det(jω − A_0 − z A_1) = 0. All frequencies but narrow bands
    are excluded by eigenvalue enclosures, the bands are refined by Newton's method, and a band
    that nothing explains raises. Necessary and sufficient for the frozen loop. A root
    that touches the axis only at zero frequency does so after an infinite delay: never.

    One delay is enough for a law that feeds back a stiffness: its signal passes the ways up and
    down once each, so that only their sum d_1 moves roots; the feedforward's d_2, the way down,
    moves none. It is not enough where signals of different age meet in the loop (embedded torque
    feedback that waits for its own way up, a predictor), nor for delays that vary.

    Args:
        A_0: (n, n) undelayed part, 1/s.
        A_1: (n, n) delayed part, 1/s.
        symmetries: (n, s) columns v with A_0 v = 0 and A_1 v = 0; they and the chains
            A_0 y = v, A_1 y = 0 that belong to them are divided out before anything is computed.
        intervals: whether to list the ranges of delay with their numbers of unstable roots.
        horizon: longest delay listed in intervals, s, which asks for them too; None for twenty
            periods of the slowest crossing.
        confirm: whether to count the roots at zero delay and on both sides of the margin by an
            independent method (Chebyshev collocation) too.

    Returns:
        The margin.

    Raises:
        InputError: matrices do not fit or are not finite.
        SolverError: a symmetry is none, a band of frequencies could be neither excluded nor
            explained, or a check contradicts the answer.
    """
    if horizon is not None and not (math.isfinite(horizon) and horizon > 0.0):
        raise InputError(f"horizon is {horizon:g} s; a positive time is needed.")
    loop = prepare(A_0, A_1, symmetries=symmetries)
    if not len(loop.A_0):
        return _answer(loop, (), unstable=0, known=True)
    unstable, on_axis = roots_without_delay(loop)
    if not loop.B.size:
        return _answer(loop, (), unstable=unstable, known=True)
    try:
        transfer = transfer_of(loop)
    except SolverError:
        if not on_axis:
            raise
        return _answer(loop, (), unstable=unstable, known=False)
    zero_root = on_axis and has_zero_root(loop)
    found, explained = crossings_in(transfer, candidate_bands(transfer, zero_root=zero_root))
    if not (explained or zero_root):
        raise SolverError(
            "A band of frequencies could be neither excluded nor refined to a crossing; the "
            "margin is not known."
        )
    ranges = _intervals(found, unstable=unstable, horizon=horizon) if intervals or horizon else ()
    answer = _answer(
        loop, tuple(found), unstable=unstable, known=True, intervals=ranges, zero_root=zero_root
    )
    if answer.residual > _RESIDUAL:
        raise SolverError(
            f"The characteristic equation has a relative residual of {answer.residual:.1e} at "
            "the crossing; the margin is not known."
        )
    if confirm:
        _check(loop, answer)
    return answer


def delay_margins(
    A_0: ArrayLike,
    A_1: ArrayLike,
    *,
    symmetries: Sequence[ArrayLike] | ArrayLike | None = None,
) -> tuple[DelayMargin, ...]:
    """Compute the margins of many loops, one after the other.

    Args:
        A_0: (N, n, n) undelayed parts.
        A_1: (N, n, n) delayed parts.
        symmetries: None, or one (n, s) basis for each loop.

    Returns:
        N margins.

    Raises:
        InputError: the lengths differ, or a loop cannot be used.
        SolverError: a margin could not be found.
    """
    first, second = np.asarray(A_0, dtype=float), np.asarray(A_1, dtype=float)
    if first.ndim != 3 or first.shape != second.shape:
        raise InputError(f"A_0 is {first.shape} and A_1 {second.shape}; (N, n, n) twice is needed.")
    bases = [None] * len(first) if symmetries is None else list(np.asarray(symmetries, dtype=float))
    if len(bases) != len(first):
        raise InputError(f"There are {len(bases)} symmetries for {len(first)} loops.")
    return tuple(
        delay_margin(one, other, symmetries=basis)
        for one, other, basis in zip(first, second, bases, strict=True)
    )


def _answer(
    loop: Loop,
    crossings: tuple[Crossing, ...],
    *,
    unstable: int,
    known: bool,
    intervals: tuple[Interval, ...] = (),
    zero_root: bool = False,
) -> DelayMargin:
    worse = [(delay, item) for item in crossings if (delay := _next(item)) is not None]
    first, crossing = min(worse, key=lambda pair: pair[0], default=(math.inf, None))
    return DelayMargin(
        delay=0.0 if unstable else first,
        first_crossing=first if known else math.nan,
        frequency=crossing.frequency if crossing else math.nan,
        mode=crossing.mode if crossing else np.zeros(0, dtype=complex),
        unstable_roots=unstable,
        neutral=loop.neutral,
        crossings=crossings,
        intervals=intervals,
        guaranteed=known and not zero_root,
        residual=crossing.residual if crossing else 0.0,
        method=_METHOD if known else "undamped motion that the delay does not reach",
    )


def _next(crossing: Crossing) -> float | None:
    """First positive delay at which this root comes from the left."""
    if crossing.direction < 0:
        return None
    at_zero = crossing.delay * crossing.frequency < 1e-9
    return crossing.delay + crossing.period if at_zero else crossing.delay


def _intervals(
    crossings: list[Crossing], *, unstable: int, horizon: float | None
) -> tuple[Interval, ...]:
    moving = [crossing for crossing in crossings if crossing.direction]
    if not moving:
        return (Interval(lower=0.0, upper=math.inf, unstable_roots=unstable),)
    end = horizon if horizon is not None else 20.0 * max(item.period for item in moving)
    events = sorted(
        (delay, item.direction)
        for item in moving
        for delay in np.arange(item.delay, end, item.period).tolist()
        if delay * item.frequency >= 1e-9
    )
    ranges, lower = [], 0.0
    for delay, direction in events:
        if delay - lower > 1e-9 * delay:
            ranges.append(Interval(lower=lower, upper=delay, unstable_roots=unstable))
        lower, unstable = delay, unstable + 2 * direction
    return (*ranges, Interval(lower=lower, upper=end, unstable_roots=unstable))


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
