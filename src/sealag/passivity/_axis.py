"""Roots of ẋ = A_0 x + A_1 x(t − d) + A_e x(t − e) on and right of the axis, in doubles.

A root jω at the delay d is an eigenvalue of A_0 + e^{-jψ} A_1 with ψ = ωd: for all delays, one
circle of ψ has to be searched.
"""

import math
from dataclasses import dataclass

import numpy as np

from sealag.passivity._definite import EPS
from sealag.typing import Array

EARLIER = 1e-6
"""Relative distance below which two crossings are not distinguished. Ten times less cuts the circle
into pieces that rounding keeps open; ten times more passes a crossing 1e-5 too late."""

_TURN = 0.5
_MOST_FREQUENCIES = 60_000
_MOST_ENTRIES = 12_000_000
"""Of all matrices over pieces of the circle: 4,000 pieces for 56 states, 80,000 for 12. A lightly
damped pair of roots takes 10,000; ten times more entries take minutes."""

_NARROW = 1e-3 * EARLIER
_SLOW = 1e-4
"""Narrowest piece of the circle, relative to its phase, which counts as at least the second:
rounding keeps narrower pieces from being excluded, and each cut would double their number."""

_CHUNK = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedLoop:
    """A frozen loop without its symmetries.

    Attributes:
        A_0: (n, n) what acts without delay.
        A_1: (n, n) what is delayed by d.
        A_e: (n, n) what is delayed by the embedded delay; None if nothing is.
        embedded: that delay, s.
    """

    A_0: Array
    A_1: Array
    A_e: Array | None
    embedded: float

    def at(self, omega: Array, delay: float) -> Array:
        """Return A_0 + A_1 e^{-jωd} + A_e e^{-jωe}, (N, n, n), at (N,) frequencies `omega`."""
        w = omega[:, None, None]
        whole = self.A_0 + np.exp(-1j * w * delay) * self.A_1
        return whole if self.A_e is None else whole + np.exp(-1j * w * self.embedded) * self.A_e

    @property
    def sum(self) -> Array:
        """The loop without delays, (n, n)."""
        whole = self.A_0 + self.A_1
        return whole if self.A_e is None else whole + self.A_e


def roots_with_error(A: Array) -> tuple[Array, Array]:
    """Return eigenvalues of A and first-order bounds of their rounding errors.

    Args:
        A: (n, n) real or complex.
    """
    A = balanced(A)[0]
    values, X = np.linalg.eig(A)
    norm = float(np.linalg.norm(A, 2))
    backward = 8.0 * len(A) * EPS * norm
    condition = np.linalg.norm(X, axis=0) * np.linalg.norm(np.linalg.inv(X), axis=1)
    return values, np.minimum(backward * condition, np.cbrt(backward * norm**2))


def balanced(*parts: Array) -> tuple[Array, ...]:
    """Scale states by powers of two so that rows and columns of the parts' sum are alike.

    Args:
        parts: (n, n) each, of one loop.
    """
    size = np.sum([np.abs(part) for part in parts], axis=0)
    np.fill_diagonal(size, 0.0)
    scale = np.ones(len(size))
    for _ in range(20):
        rows, columns = size.sum(axis=1), size.sum(axis=0)
        good = (rows > 0.0) & (columns > 0.0)
        step = np.ones(len(size))
        step[good] = 2.0 ** np.round(np.log2(rows[good] / columns[good]) / 4.0)
        if (step == 1.0).all():
            break
        size, scale = size * step / step[:, None], scale * step
    return tuple(part * scale / scale[:, None] for part in parts)


def earliest_crossing(A_0: Array, A_1: Array, *, limit: float) -> float:
    """Return a delay below which no root lies on the axis, up to a limit.

    The circle ψ ∈ [0, π] is cut until no eigenvalue of A_0 + e^{-jψ} A_1 in a piece can be jω with
    a delay ψ/|ω|, or (2π − ψ)/|ω| for the conjugate, below the limit. In the eigenvectors X of the
    middle, the matrix is Λ + E with |E| ≤ |δ| |X⁻¹ A_1 X|, δ the distance from the middle, and its
    eigenvalues lie in Gershgorin's discs.

    Args:
        A_0: (n, n), without roots on the axis at zero delay.
        A_1: (n, n).
        limit: s, inf for none.

    Returns:
        The limit if no root is on the axis before; else the shortest delay that is not excluded.
    """
    A_0, A_1 = balanced(A_0, A_1)
    low, high = np.linspace(0.0, math.pi, 17)[:-1], np.linspace(0.0, math.pi, 17)[1:]
    doubt, count = limit, 0
    while len(low):
        count += len(low)
        delays = np.concatenate(
            [_shortest(A_0, A_1, low[k : k + _CHUNK], high[k : k + _CHUNK])
             for k in range(0, len(low), _CHUNK)]
        )  # fmt: skip
        open_ = delays < limit
        if count * A_0.size > _MOST_ENTRIES:
            return float(min(doubt, delays.min()))
        low, high = low[open_], high[open_]
        if (high - low <= _NARROW * np.maximum(high, _SLOW)).any():
            return float(delays[open_].min())
        middle = (low + high) / 2.0
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return doubt


def _shortest(A_0: Array, A_1: Array, low: Array, high: Array) -> Array:
    """Shortest delay that each piece of the circle cannot exclude, (N,); inf if it excludes all."""
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    A = A_0 + np.exp(-1j * middle)[:, None, None] * A_1
    values, X = np.linalg.eig(A)
    C = np.abs(np.linalg.solve(X, A_1 @ X))
    rest = np.linalg.solve(X, A @ X)
    rest[:, range(len(A_0)), range(len(A_0))] -= values
    E = half[:, None, None] * C + 2.0 * np.abs(rest) + EPS * np.abs(values)[:, :, None] / len(A_0)
    for _ in range(4):
        scale = np.sqrt((E.sum(axis=2) + 1e-300) / (E.sum(axis=1) + 1e-300))
        E = E * scale[:, None, :] / scale[:, :, None]
    radius = E.sum(axis=2)
    reach = np.abs(values.real) <= radius
    with np.errstate(divide="ignore", invalid="ignore"):
        up = np.where(reach & (values.imag + radius > 0.0), low[:, None], np.inf)
        up = up / np.abs(values.imag + radius)
        down = np.where(reach & (radius - values.imag > 0.0), 2.0 * math.pi - high[:, None], np.inf)
        down = down / np.abs(radius - values.imag)
    return np.minimum(up, down).min(axis=1, initial=np.inf)


def unstable_roots(loop: DelayedLoop, delay: float, *, omega: float | None) -> int | None:
    """Count roots in the right half plane by the turns of the characteristic function.

    det(jω − A(jω)) / det(jω − A_0 − A_1 − A_e) → 1, and it turns by −π over [0, ∞) for each root
    that the delays add there.

    Args:
        loop: the loop.
        delay: d, s.
        omega: a frequency around which the grid is finer, rad/s.

    Returns:
        The count; None if it could not be resolved.
    """
    roots = np.linalg.eigvals(balanced(loop.sum)[0])
    grid = _grid(roots, omega)
    far = np.abs(_ratio(loop, grid, delay) - 1.0)
    turn, moved = _steps(loop, grid[:-1], grid[1:], delay)
    slowest = max(delay, loop.embedded if loop.A_e is not None else 0.0)
    while len(grid) < _MOST_FREQUENCIES:
        gaps = np.diff(grid)
        late = (gaps * slowest > _TURN) & (np.maximum(far[1:], far[:-1]) > 0.1)
        split = np.flatnonzero(~(moved <= _TURN) | late)
        split = split[gaps[split] > 1e-13 * grid[split]]
        if not len(split):
            without = np.angle((1j * grid[-1] - roots) / (1j * grid[0] - roots)).sum()
            turns = float(without - turn.sum()) / math.pi
            settled = far[-1] < 0.1 and abs(turns - round(turns)) < 0.1
            return int((roots.real > 0.0).sum()) + round(turns) if settled else None
        fresh = (grid[split] + grid[split + 1]) / 2.0
        turn[split], moved[split], later = *_steps(loop, grid[split], fresh, delay), split + 1
        after = _steps(loop, fresh, grid[later], delay)
        turn, moved = (np.insert(old, later, new) for old, new in zip((turn, moved), after))
        far = np.insert(far, later, np.abs(_ratio(loop, fresh, delay) - 1.0))
        grid = np.insert(grid, later, fresh)
    return None


def _steps(loop: DelayedLoop, low: Array, high: Array, delay: float) -> tuple[Array, Array]:
    """How far det P, P = jω − A(jω), turns from one frequency to another, and how far P moves.

    P₂ = P₁ (I + E). The determinant turns by the sum of the angles of the eigenvalues of I + E. It
    tells that sum but for turns by 2π, which k equal joints make where each turns by 2π/k; the
    traces of E, E², E³ and E⁴ tell which, if no eigenvalue of E is larger than ½: ‖E¹⁶‖ bounds
    them.

    Returns:
        (N,) rad, and (N,) a bound of the eigenvalues of E; NaN where P₁ is singular.
    """
    turn, moved = np.full((2, len(low)), np.nan)
    identity = np.eye(len(loop.A_0))
    for first in range(0, len(low), _CHUNK):
        rows = slice(first, first + _CHUNK)
        start, end = (
            1j * w[:, None, None] * identity - loop.at(w, delay) for w in (low[rows], high[rows])
        )
        with np.errstate(all="ignore"):
            E = _solved(start, end - start)
            powers = [E, E @ E]
            powers += [powers[1] @ E, powers[1] @ powers[1]]
            shifted = np.einsum("kii->k", powers[0]) - np.einsum("kii->k", powers[1]) / 2.0
            shifted += np.einsum("kii->k", powers[2]) / 3.0
            shifted -= np.einsum("kii->k", powers[3]) / 4.0
            angle = np.angle(np.linalg.slogdet(identity + E)[0])
            turn[rows] = angle + 2.0 * math.pi * np.round((shifted.imag - angle) / 2.0 / math.pi)
            last = powers[3] @ powers[3]
            moved[rows] = np.linalg.norm(last @ last, axis=(1, 2)) ** (1.0 / 16.0)
    return turn, moved


def _solved(P: Array, Q: Array) -> Array:
    """P⁻¹ Q of (N, n, n) each; NaN where P is singular."""
    try:
        return np.linalg.solve(P, Q)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(P)[0] == 0.0
        P = np.where(singular[:, None, None], np.eye(P.shape[-1]), P)
        return np.where(singular[:, None, None], np.nan, np.linalg.solve(P, Q))


def _grid(roots: Array, omega: float | None) -> Array:
    """Frequencies to begin with: all decades, and close to roots and the crossing."""
    sizes = np.abs(roots)
    low = 1e-4 * min(float(sizes.min()), omega or math.inf)
    high = 30.0 * float(sizes.max())
    spread = np.concatenate([-np.geomspace(1e-3, 3.0, 6)[::-1], [0.0], np.geomspace(1e-3, 3.0, 6)])
    near = np.abs(roots.imag)[:, None] + spread * np.abs(roots.real)[:, None]
    close = omega * (1.0 + 1e-2 * spread) if omega else np.zeros(0)
    grid = np.concatenate([np.geomspace(low, high, 300), near.ravel(), close])
    return np.unique(grid[(grid >= low) & (grid <= high)])


def _ratio(loop: DelayedLoop, omega: Array, delay: float) -> Array:
    """The characteristic function over that without delays, (N,)."""
    out = np.empty(len(omega), dtype=complex)
    for first in range(0, len(omega), _CHUNK):
        w = omega[first : first + _CHUNK]
        whole = 1j * w[:, None, None] * np.eye(len(loop.A_0))
        sign, size = np.linalg.slogdet(whole - loop.at(w, delay))
        sign_0, size_0 = np.linalg.slogdet(whole - loop.sum)
        out[first : first + _CHUNK] = sign / sign_0 * np.exp(size - size_0)
    return out
