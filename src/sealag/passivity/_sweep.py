"""Delays below which no root of ẋ = A_0 x + A_1 x(t − d) is on the axis, in doubles.

A root jω at the delay d is an eigenvalue of A_0 + e^{-jψ} A_1 with ψ = ωd: for all delays, one
circle of ψ has to be searched. About a middle ψ_0 with eigenvectors X the matrix is

    X⁻¹ (A_0 + e^{-jψ} A_1) X = Λ + (e^{-jδ} − 1) C + rounding ,   C = e^{-jψ_0} X⁻¹ A_1 X ,

with |e^{-jδ} − 1| ≤ |δ| and |e^{-jδ} − 1 + jδ| ≤ δ²/2, δ the distance from the middle.
"""

import math
from typing import NamedTuple

import numpy as np

from sealag.passivity._axis import balanced
from sealag.passivity._definite import EPS
from sealag.typing import Array, BoolArray

EARLIER = 1e-6
"""Relative distance below which two crossings are not distinguished. Ten times less cuts the circle
into pieces that rounding keeps open; ten times more passes a crossing 1e-5 too late."""

_PIECES = 8  # of the half circle, to begin with
_MOST_ENTRIES = 12_000_000
"""Of all matrices over pieces of the circle: 4,000 pieces for 56 states, 80,000 for 12. A lightly
damped pair of roots takes 10,000; ten times more entries take minutes."""

_NARROW = 1e-3 * EARLIER
_SLOW = 1e-4
"""Narrowest piece of the circle, relative to its phase, which counts as at least the second:
rounding keeps narrower pieces from being excluded, and each cut would double their number."""

_CHUNK = 64
_BALANCING = 4  # rounds after which discs hardly shrink
_WEIGHING = 12  # rounds after which weights hardly change
_DOMINANT = 0.999
"""Share of a diagonal that the rest of its row may be; the distance to 1 is far above rounding."""


def earliest_crossing(A_0: Array, A_1: Array, *, limit: float) -> float:
    """Return a delay below which no root lies on the axis, up to a limit.

    The half circle ψ ∈ [0, π] is cut until no eigenvalue of A_0 + e^{-jψ} A_1 in a piece can be jω
    with a delay ψ/|ω|, or (2π − ψ)/|ω| for the conjugate, below the limit.

    Args:
        A_0: (n, n), without roots on the axis at zero delay.
        A_1: (n, n).
        limit: s, inf for none.

    Returns:
        The limit if no root is on the axis before; else the shortest delay that is not excluded.
    """
    if limit <= 0.0:
        return limit
    A_0, A_1 = balanced(A_0, A_1)
    edges = np.linspace(0.0, math.pi, _PIECES + 1)
    low, high = edges[:-1], edges[1:]
    count = 0
    while len(low):
        count += len(low)
        delays = np.concatenate(
            [_Pieces.of(A_0, A_1, low[k : k + _CHUNK], high[k : k + _CHUNK]).shortest(limit)
             for k in range(0, len(low), _CHUNK)]
        )  # fmt: skip
        open_ = delays < limit
        if count * A_0.size > _MOST_ENTRIES:
            return float(min(limit, delays.min()))
        low, high = low[open_], high[open_]
        if (high - low <= _NARROW * np.maximum(high, _SLOW)).any():
            return float(delays[open_].min())
        middle = (low + high) / 2.0
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return limit


class _Pieces(NamedTuple):
    """Pieces of the circle in the eigenvectors of their middles.

    Attributes:
        middle: (N,) ψ_0.
        half: (N,) largest |δ|.
        values: (N, n) Λ.
        motion: (N, n, n) C.
        rounding: (N, n, n) bound of what the eigenvectors leave.
    """

    middle: Array
    half: Array
    values: Array
    motion: Array
    rounding: Array

    @classmethod
    def of(cls, A_0: Array, A_1: Array, low: Array, high: Array) -> "_Pieces":
        middle = (low + high) / 2.0
        late = np.exp(-1j * middle)[:, None, None] * A_1
        values, X = np.linalg.eig(A_0 + late)
        rest = np.linalg.solve(X, (A_0 + late) @ X)
        rest[:, range(len(A_0)), range(len(A_0))] -= values
        return cls(
            middle=middle,
            half=(high - low) / 2.0,
            values=values,
            motion=np.linalg.solve(X, late @ X),
            rounding=2.0 * np.abs(rest) + EPS * np.abs(values)[:, :, None] / len(A_0),
        )

    def shortest(self, limit: float) -> Array:
        """Shortest delay that each piece cannot exclude, (N,); inf if none below the limit is left.

        Roots below the real axis are the conjugates of roots above it at 2π − ψ.
        """
        conjugate = self._replace(
            middle=math.tau - self.middle, values=self.values.conj(), motion=self.motion.conj()
        )
        return np.minimum(self._above(limit), conjugate._above(limit))

    def _above(self, limit: float) -> Array:
        """The same of roots above the real axis only."""
        return np.where(self._excluded(limit), np.inf, self._by_discs())

    def _excluded(self, limit: float) -> BoolArray:
        """Whether no eigenvalue is jω with ω ≥ ψ/limit, (N,).

        On the diagonal, Λ_i − jδ C_ii keeps a distance D_i from that part of the axis, up to the
        second order in δ. Where weights x > 0 have Σ_j E_ij x_j < D_i x_i in each row i, E what is
        off the diagonal, no point of it is an eigenvalue: the matrix less it is dominant there.
        """
        h, n = self.half[:, None], self.values.shape[1]
        E = h[:, :, None] * np.abs(self.motion) + self.rounding
        own = np.einsum("kii->ki", self.motion)
        slack = h**2 / 2.0 * np.abs(own) + np.einsum("kii->ki", self.rounding)
        E[:, range(n), range(n)] = 0.0
        D = self._distances(-1j * own, limit) - slack
        apart = (D > 0.0).all(axis=1)
        D = np.where(D > 0.0, D, 1.0)
        x, share = np.ones_like(D), np.full(len(D), np.inf)
        for _ in range(_WEIGHING):
            y = (E @ x[:, :, None])[:, :, 0] / D
            share = np.minimum(share, (y / x).max(axis=1))
            x = (x + y) / (x + y).max(axis=1, keepdims=True)
        return apart & (share < _DOMINANT)

    def _distances(self, rate: Array, limit: float) -> Array:
        """Distances (N, n) of Λ + δ rate from jω, ω ≥ (ψ_0 + δ)/limit, over all |δ| ≤ half.

        Real part a and lack of height b are linear in δ, and √(a² + max(b, 0)²) is convex: least at
        an end, or where a² or a² + b² is.
        """
        h, slope = self.half[:, None], 1.0 / limit
        a, by_a = self.values.real, rate.real
        b, by_b = self.middle[:, None] * slope - self.values.imag, slope - rate.imag
        with np.errstate(divide="ignore", invalid="ignore"):
            least = np.stack([-a / by_a, -(a * by_a + b * by_b) / (by_a**2 + by_b**2)])
        least = np.clip(np.nan_to_num(least), -h, h)
        delta = np.concatenate([least, np.broadcast_to([-h, h], least.shape)])
        return np.hypot(a + delta * by_a, np.maximum(b + delta * by_b, 0.0)).min(axis=0)

    def _by_discs(self) -> Array:
        """Shortest delay of what Gershgorin's discs reach of the axis, (N,); inf for nothing."""
        E = self.half[:, None, None] * np.abs(self.motion) + self.rounding
        for _ in range(_BALANCING):
            scale = np.sqrt((E.sum(axis=2) + 1e-300) / (E.sum(axis=1) + 1e-300))
            E = E * scale[:, None, :] / scale[:, :, None]
        radius = E.sum(axis=2)
        height = self.values.imag + radius
        reach = (np.abs(self.values.real) <= radius) & (height > 0.0)
        delays = (self.middle - self.half)[:, None] / np.where(reach, height, 1.0)
        return np.where(reach, delays, np.inf).min(axis=1, initial=np.inf)
