"""Roots of ẋ = A_0 x + A_1 x(t − d) + A_e x(t − e) on and right of the axis, in doubles."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from sealag.passivity._definite import EPS
from sealag.typing import Array

_TURN = 0.5
_FAR = 0.1
_MOST_FREQUENCIES = 60_000
_CHUNK = 512
_ROWS = 16  # substituted together, so that most products are of matrices


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


def unstable_roots(loop: DelayedLoop, delays: Sequence[float]) -> list[int | None]:
    """Count roots in the right half plane at some delays by the turns of the return difference.

    With A = A_0 + A_1 + A_e, A_1 = L_1 R_1 and A_e = L_e R_e, the characteristic function is

        det(jω − A(jω)) = det(jω − A) det T(jω) ,   T = I + D(jω) R (jω − A)⁻¹ L ,

    D = diag(1 − e^{-jωd}, 1 − e^{-jωe}). T is I at 0 and far above all roots, and its determinant
    turns by −π over [0, ∞) for each root that the delays add to those of A.

    Args:
        loop: the loop.
        delays: d each, s.

    Returns:
        The counts; None where one could not be resolved.
    """
    opened = _Opened.of(loop)
    return [opened.unstable_roots(delay) for delay in delays]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Opened:
    """A loop opened where it is late, in Schur's basis of A = A_0 + A_1 + A_e.

    Attributes:
        triangle: (n, n) Schur form of A.
        left: (n, r) L.
        right: (r, n) R.
        late: how many of the r signals are late by d; the others are late by e.
        embedded: e, s.
    """

    triangle: Array
    left: Array
    right: Array
    late: int
    embedded: float

    @classmethod
    def of(cls, loop: DelayedLoop) -> Self:
        from scipy.linalg import schur

        none = np.zeros_like(loop.A_0)
        A_0, A_1, A_e = balanced(loop.A_0, loop.A_1, none if loop.A_e is None else loop.A_e)
        (L, R), (L_e, R_e) = _halves(A_1), _halves(A_e)
        triangle, Q = schur(A_0 + A_1 + A_e, output="complex")  # pyright: ignore
        return cls(
            triangle=triangle,
            left=Q.conj().T @ np.hstack([L, L_e]),
            right=np.vstack([R, R_e]) @ Q,
            late=L.shape[1],
            embedded=loop.embedded if L_e.size else 0.0,
        )

    @property
    def poles(self) -> Array:
        """Roots of the loop without delays, (n,)."""
        return np.diagonal(self.triangle)

    def unstable_roots(self, delay: float) -> int | None:
        """Roots right of the axis at a delay; None if they cannot be told."""
        grid = self._grid()
        low, high = grid[:-1], grid[1:]
        slowest, turn, count = max(delay, self.embedded), 0.0, 0
        while len(low):
            count += len(low)
            if count > _MOST_FREQUENCIES:
                return None
            steps = self._steps(low, high, delay)
            late = ((high - low) * slowest > _TURN) & (steps.far > _FAR)
            open_ = (~(steps.moved <= _TURN) | late) & (high - low > self._finest(high))
            turn += float(steps.turn[~open_].sum())
            low, high = low[open_], high[open_]
            middle = (low + high) / 2.0
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        turns = turn / math.pi
        with np.errstate(all="ignore"):
            last = abs(np.linalg.det(self._difference(grid[-1:], delay)[0]) - 1.0)
        if not (last < _FAR and abs(math.remainder(turns, 1.0)) < 0.1):
            return None
        return int((self.poles.real > 0.0).sum()) - round(turns)

    def _finest(self, omega: Array) -> Array:
        """Widths (N,) below which an interval up to a frequency (N,) is not split."""
        sizes = np.abs(self.poles)
        return 1e-13 * np.maximum(omega, sizes[sizes > 0.0].min())

    def _grid(self) -> Array:
        """Frequencies to begin with: from 0 to far above all poles, and between two of them no
        pole's part of T changes by more than half."""
        sizes = np.abs(self.poles)
        spread = np.geomspace(1e-4 * sizes[sizes > 0.0].min(), 30.0 * sizes.max(), 60)
        grid = np.concatenate([[0.0], spread])
        while True:
            middle, gap = (grid[1:] + grid[:-1]) / 2.0, np.diff(grid)
            near = np.abs(1j * middle[:, None] - self.poles).min(axis=1)
            split = (gap > 0.5 * near) & (gap > self._finest(grid[1:]))
            if not split.any():
                return grid
            grid = np.sort(np.concatenate([grid, middle[split]]))

    def _difference(self, omega: Array, delay: float) -> Array:
        """Return differences T, (N, r, r), at (N,) frequencies, by back substitution."""
        (n, r), count = self.left.shape, len(omega)
        flat = np.empty((n, count * r), dtype=complex)
        rows = flat.reshape(n, count, r)
        for end in range(n, 0, -_ROWS):
            first = max(end - _ROWS, 0)
            known = self.triangle[first:end, end:] @ flat[end:]
            rows[first:end] = self.left[first:end, None] + known.reshape(-1, count, r)
            for i in range(end - 1, first - 1, -1):
                near = self.triangle[i, i + 1 : end] @ flat[i + 1 : end]
                rows[i] += near.reshape(count, r)
                rows[i] /= (1j * omega - self.triangle[i, i])[:, None]
        response = (self.right @ flat).reshape(r, count, r).swapaxes(0, 1)
        own = np.arange(r) < self.late
        turned = -np.expm1(-1j * omega[:, None] * np.where(own, delay, self.embedded))
        return np.eye(r) + turned[:, :, None] * response

    def _steps(self, low: Array, high: Array, delay: float) -> "_Steps":
        """How far det T turns from one frequency to another, and how far T moves.

        T₂ = T₁ (I + E). The determinant turns by the sum of the angles of the eigenvalues of I + E.
        It tells that sum but for turns by 2π, which k equal joints make where each turns by 2π/k;
        the traces of E, E², E³ and E⁴ tell which, if no eigenvalue of E is larger than ½: ‖E‖, or
        ‖E¹⁶‖ where that is too large, bounds them.
        """
        turn, moved, far = np.full((3, len(low)), np.nan)
        for first in range(0, len(low), _CHUNK):
            rows = slice(first, first + _CHUNK)
            ends = np.concatenate([low[rows], high[rows]])
            omega, at = np.unique(ends, return_inverse=True)
            start, end = at[: len(at) // 2], at[len(at) // 2 :]
            with np.errstate(all="ignore"):
                T = self._difference(omega, delay)
                sign, size = np.linalg.slogdet(T)
                away = np.abs(sign * np.exp(size) - 1.0)
                E = _solved(T[start], T[end] - T[start])
                square = E @ E
                shifted = np.einsum("kii->k", E) - _trace(E, E) / 2.0
                shifted += _trace(E, square) / 3.0 - _trace(square, square) / 4.0
                angle = np.angle(sign[end] / sign[start])
                turn[rows] = angle + math.tau * np.round((shifted.imag - angle) / math.tau)
                bound = np.linalg.norm(E, axis=(1, 2))
                long = ~(bound <= _TURN)
                bound[long] = _radius_bound(square[long])
                moved[rows], far[rows] = bound, np.maximum(away[start], away[end])
        return _Steps(turn, moved, far)


class _Steps(NamedTuple):
    """(N,) each: rad that det T turns; a bound of the eigenvalues of E, NaN where T₁ is singular;
    the larger distance of det T from 1 at the two ends."""

    turn: Array
    moved: Array
    far: Array


def _halves(matrix: Array) -> tuple[Array, Array]:
    """L (n, r) and R (r, n) with L R the matrix, up to its rounding."""
    U, values, V = np.linalg.svd(matrix)
    rank = int((values > EPS * values.max(initial=0.0)).sum())
    root = np.sqrt(values[:rank])
    return U[:, :rank] * root, root[:, None] * V[:rank]


def _trace(A: Array, B: Array) -> Array:
    """Traces of A B, (N,)."""
    return np.einsum("kij,kji->k", A, B)


def _radius_bound(square: Array) -> Array:
    """‖E¹⁶‖^{1/16} of E², (N, r, r)."""
    for _ in range(3):
        square = square @ square
    return np.linalg.norm(square, axis=(1, 2)) ** (1.0 / 16.0)


def _solved(P: Array, Q: Array) -> Array:
    """P⁻¹ Q of (N, n, n) each; NaN where P is singular."""
    try:
        return np.linalg.solve(P, Q)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(P)[0] == 0.0
        P = np.where(singular[:, None, None], np.eye(P.shape[-1]), P)
        return np.where(singular[:, None, None], np.nan, np.linalg.solve(P, Q))
