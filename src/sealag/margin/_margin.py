"""Exact delay margin of ẋ = A_0 x + A_1 x(t − d): every crossing of the imaginary axis.

With A_1 = B C of rank r, jω is a root for the delay d if and only if e^{jωd} is an eigenvalue of
the r × r loop L(jω) = C (jωI − A_0)⁻¹ B. The sorted moduli of those eigenvalues are continuous in
ω, so that crossings are the zeros of continuous functions log|μ_k(ω)|.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.margin._roots import rightmost_roots
from sealag.typing import Array, ArrayLike

_GRID = 400
_TOUCH = 1e-8
_NEUTRAL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A pair of roots ±jω on the imaginary axis.

    Attributes:
        delay: the smallest delay at which it happens, s; again each 2π/ω later.
        frequency: ω, rad/s.
        direction: +1 where a pair becomes unstable, −1 where one becomes stable, 0 where it
            only touches the axis.
        mode: (N,) eigenvector over the states, of unit norm.
        residual: relative residual of the characteristic equation.
    """

    delay: float
    frequency: float
    direction: int
    mode: Array
    residual: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayMargin:
    """How much constant delay a linear loop takes (necessary and sufficient, local).

    Attributes:
        delay: s; 0 if the loop is not asymptotically stable without delay, inf if it is stable
            for every delay.
        first_crossing: smallest positive delay at which one more pair of roots reaches the axis,
            s; inf if there is none.
        frequency: ω of that pair, rad/s; NaN if there is none.
        mode: (N,) its eigenvector; empty if there is none.
        unstable_roots: number of roots with positive real part without delay.
        neutral: number of structural zero roots that were taken out.
        crossings: all pairs, by their smallest delay.
        intervals: (start, end, unstable roots) for delays up to `horizon`, if asked for.
        confirmed: whether roots by Chebyshev discretisation agreed just below the first crossing;
            None if that was not asked for.
    """

    delay: float
    first_crossing: float
    frequency: float
    mode: Array
    unstable_roots: int
    neutral: int
    crossings: tuple[Crossing, ...]
    intervals: tuple[tuple[float, float, int], ...]
    confirmed: bool | None


def delay_margin(
    A_0: ArrayLike,
    A_1: ArrayLike,
    *,
    symmetries: ArrayLike | None = None,
    horizon: float | None = None,
    confirm: bool = False,
) -> DelayMargin:
    """Compute the exact delay margin of ẋ = A_0 x + A_1 x(t − d) for constant d.

    Args:
        A_0: (N, N) what acts without delay.
        A_1: (N, N) what acts with delay.
        symmetries: (N, s) states that neither matrix moves; they and the momenta conserved with
            them are taken out as structural zero roots.
        horizon: if given, list the stability intervals for delays up to it, s.
        confirm: whether to count the unstable roots just below the first crossing by Chebyshev
            discretisation, an independent check.

    Returns:
        The margin with all crossings.

    Raises:
        InputError: a shape does not fit or an entry is not finite.
        SolverError: the symmetries are none, or the independent check disagrees.
    """
    first, second = _checked(A_0, A_1)
    small_0, small_1, lift, neutral = _without_symmetries(first, second, symmetries)
    roots = np.linalg.eigvals(small_0 + small_1)
    tolerance = _NEUTRAL * max(float(np.abs(roots).max(initial=0.0)), 1e-300)
    unstable = int((roots.real > tolerance).sum())
    marginal = int((np.abs(roots.real) <= tolerance).sum())
    crossings = tuple(
        sorted(_crossings(small_0, small_1, lift), key=lambda crossing: crossing.delay)
    )
    ahead = crossings[0] if crossings else None
    confirmed = None
    if confirm and ahead is not None:
        confirmed = _confirm(small_0, small_1, ahead.delay, unstable=unstable)
    stable = unstable == 0 and marginal == 0
    end = ahead.delay if ahead else math.inf
    return DelayMargin(
        delay=end if stable else 0.0,
        first_crossing=end,
        frequency=ahead.frequency if ahead else math.nan,
        mode=ahead.mode if ahead else np.zeros(0),
        unstable_roots=unstable,
        neutral=neutral,
        crossings=crossings,
        intervals=_intervals(crossings, unstable, horizon) if horizon is not None else (),
        confirmed=confirmed,
    )


def _checked(A_0: ArrayLike, A_1: ArrayLike) -> tuple[Array, Array]:
    first = np.atleast_2d(np.asarray(A_0, dtype=float))
    second = np.atleast_2d(np.asarray(A_1, dtype=float))
    if first.shape != second.shape or first.ndim != 2 or first.shape[0] != first.shape[1]:
        raise InputError(
            f"A_0 has shape {first.shape} and A_1 {second.shape}; both must be square and equal."
        )
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        raise InputError("A_0 or A_1 has entries that are not finite.")
    return first, second


def _without_symmetries(
    A_0: Array, A_1: Array, symmetries: ArrayLike | None
) -> tuple[Array, Array, Array, int]:
    """Quotient by the symmetric states, then restrict to zero conserved momentum."""
    size = len(A_0)
    V = np.zeros((size, 0)) if symmetries is None else np.asarray(symmetries, dtype=float)
    if V.ndim != 2 or len(V) != size or not np.isfinite(V).all():
        raise InputError(f"symmetries have shape {V.shape}; ({size}, s) is needed.")
    count = V.shape[1]
    if count == 0:
        return A_0, A_1, np.eye(size), 0
    basis, values, _ = np.linalg.svd(V, full_matrices=True)
    if values[-1] <= 1e-9 * values[0]:
        raise InputError("The symmetries are not linearly independent.")
    scale = np.linalg.norm(A_0) + np.linalg.norm(A_1)
    both = np.hstack([A_0, A_1])
    moved = np.linalg.norm(A_0 @ basis[:, :count]) + np.linalg.norm(A_1 @ basis[:, :count])
    if moved > 1e-8 * scale:
        raise SolverError("The symmetries given are moved by the dynamics, so they are none.")
    Q = basis[:, count:]
    left, gains, _ = np.linalg.svd(Q.T @ both, full_matrices=True)
    if gains[-count:].max() > 1e-8 * scale:
        return Q.T @ A_0 @ Q, Q.T @ A_1 @ Q, Q, count
    P = left[:, : len(Q.T) - count]
    reduce = Q @ P
    return reduce.T @ A_0 @ reduce, reduce.T @ A_1 @ reduce, reduce, 2 * count


def _factor(A_1: Array) -> tuple[Array, Array]:
    """A_1 = B C with as few columns as its rank."""
    left, values, right = np.linalg.svd(A_1)
    rank = int((values > 1e-13 * max(values[0], 1e-300)).sum()) if len(values) else 0
    root = np.sqrt(values[:rank])
    return left[:, :rank] * root, root[:, None] * right[:rank]


def _balance(A_0: Array, A_1: Array) -> tuple[Array, Array, Array]:
    """Scale the states by powers of two so that both matrices have small norms."""
    from scipy.linalg import matrix_balance

    _, (scaling, _) = matrix_balance(np.abs(A_0) + np.abs(A_1), permute=False, separate=True)
    return A_0 * scaling / scaling[:, None], A_1 * scaling / scaling[:, None], scaling


def _crossings(A_0: Array, A_1: Array, lift: Array) -> list[Crossing]:
    A_0, A_1, scaling = _balance(A_0, A_1)
    B, C = _factor(A_1)
    if B.shape[1] == 0:
        return []
    eye = np.eye(len(A_0))

    def loop(frequency: ArrayLike) -> Array:
        s = 1j * np.asarray(frequency, dtype=float)[..., None, None]
        return C @ np.linalg.solve(s * eye - A_0, B + 0j)

    def moduli(frequency: ArrayLike) -> Array:
        values = np.abs(np.linalg.eigvals(loop(frequency)))
        return np.log(np.maximum(np.sort(values, axis=-1), 1e-300))

    grid = _frequencies(A_0, A_1)
    curves = moduli(grid)
    found = []
    for k in range(curves.shape[1]):
        for omega, direction in _zeros(lambda w, k=k: float(moduli(w)[k]), grid, curves[:, k]):
            mus = np.linalg.eigvals(loop(omega))
            mu = mus[np.argsort(np.abs(mus))[k]]
            angle = float(np.angle(mu)) % (2.0 * math.pi)
            if angle <= 1e-9:
                angle += 2.0 * math.pi
            crossing = _describe(A_0, A_1, omega, delay=angle / omega, direction=direction)
            mode = lift @ (scaling * crossing.mode)
            found.append(
                Crossing(
                    delay=crossing.delay,
                    frequency=crossing.frequency,
                    direction=crossing.direction,
                    mode=mode / np.linalg.norm(mode),
                    residual=crossing.residual,
                )
            )
    return found


def _frequencies(A_0: Array, A_1: Array) -> Array:
    """A grid that is dense where the loop can change fast: around lightly damped roots."""
    top = 1.01 * (np.linalg.norm(A_0, 2) + np.linalg.norm(A_1, 2))
    roots = np.concatenate([np.linalg.eigvals(A_0 + z * A_1) for z in (0.0, 1.0, -1.0, 1j)])
    sizes = np.abs(roots)
    bottom = 1e-3 * max(float(sizes[sizes > 1e-6 * top].min(initial=top)), 1e-9 * top)
    around = np.array([0.0, 0.02, 0.1, 0.3, 0.6, 1.0, 1.6, 2.5, 4.0, 7.0])
    width = np.maximum(np.abs(roots.real), 1e-6 * sizes)[:, None] * around
    near = np.concatenate(
        [
            (np.abs(roots.imag)[:, None] + width).ravel(),
            (np.abs(roots.imag)[:, None] - width).ravel(),
        ]
    )
    near = near[(near > bottom) & (near < top)]
    return np.unique(np.concatenate([np.geomspace(bottom, top, _GRID), near]))


def _zeros(curve: Callable[[float], float], grid: Array, values: Array) -> list[tuple[float, int]]:
    """Zeros of a continuous function sampled on a grid: sign changes, and extrema that reach 0."""
    from scipy.optimize import brentq, minimize_scalar

    values = np.where(values == 0.0, 1e-300, values)
    zeros = []
    for i in np.flatnonzero(values[:-1] * values[1:] < 0.0):
        omega = brentq(curve, grid[i], grid[i + 1], xtol=1e-14 * grid[i + 1], rtol=1e-14)
        zeros.append((float(omega), 1 if values[i] > 0.0 else -1))
    size = np.abs(values)
    lowest = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    same = (np.sign(values[:-2]) == np.sign(values[1:-1])) & (
        np.sign(values[2:]) == np.sign(values[1:-1])
    )
    bend = np.abs(values[:-2] - 2.0 * values[1:-1] + values[2:])
    for i in np.flatnonzero(lowest & same & (size[1:-1] <= 4.0 * bend + 1e-3)) + 1:
        sign = math.copysign(1.0, values[i])
        low = minimize_scalar(
            lambda w, sign=sign: sign * curve(w),
            bounds=(grid[i - 1], grid[i + 1]),
            method="bounded",
            options={"xatol": 1e-12 * grid[i]},
        )
        if low.fun < -_TOUCH:
            for a, b, way in ((grid[i - 1], low.x, sign), (low.x, grid[i + 1], -sign)):
                zeros.append((float(brentq(curve, a, b, xtol=1e-14 * b, rtol=1e-14)), int(way)))
        elif low.fun <= _TOUCH:
            zeros.append((float(low.x), 0))
    return zeros


def _describe(A_0: Array, A_1: Array, omega: float, *, delay: float, direction: int) -> Crossing:
    """Eigenvector and residual of the characteristic matrix at a crossing."""
    scale = omega + np.linalg.norm(A_0) + np.linalg.norm(A_1)
    matrix = 1j * omega * np.eye(len(A_0)) - A_0 - np.exp(-1j * omega * delay) * A_1
    _, values, right = np.linalg.svd(matrix)
    return Crossing(
        delay=delay,
        frequency=omega,
        direction=direction,
        mode=right[-1].conj(),
        residual=float(values[-1] / scale),
    )


def _intervals(
    crossings: tuple[Crossing, ...], unstable: int, horizon: float
) -> tuple[tuple[float, float, int], ...]:
    """Unstable roots between crossings up to a delay."""
    events: list[tuple[float, int]] = []
    for crossing in crossings:
        period = 2.0 * math.pi / crossing.frequency
        repeats = max(0, math.floor((horizon - crossing.delay) / period) + 1)
        events += [(crossing.delay + k * period, crossing.direction) for k in range(repeats)]
    spans, start, count = [], 0.0, unstable
    for delay, direction in sorted(events):
        if delay > start:
            spans.append((start, delay, count))
        start, count = delay, count + 2 * direction
    if horizon > start:
        spans.append((start, horizon, count))
    return tuple(spans)


def _confirm(A_0: Array, A_1: Array, crossing: float, *, unstable: int) -> bool:
    """Count unstable roots just below the first crossing by an independent method."""
    roots = rightmost_roots(A_0, A_1, 0.99 * crossing)
    found = int((roots.real > _NEUTRAL * np.abs(roots).max(initial=0.0)).sum())
    if found != unstable:
        raise SolverError(
            f"The delay margin is not trusted: {unstable} unstable roots without delay, but "
            f"{found} just below the first crossing at {crossing:.6g} s."
        )
    return True
