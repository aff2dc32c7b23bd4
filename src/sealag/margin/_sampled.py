"""Sampled loops as they are: a command that is computed once a period, late, and held."""

import math
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.margin._jitter import broken_at, jitter_margin
from sealag.margin._loop import time_of
from sealag.typing import Array, ArrayLike

_LARGEST = 500
"""States and waiting commands of one lifted loop. Its eigenvalues take a fifth of a second; ten
times more take minutes."""

_STEPS = 8
"""Delays that are tried in a period. A loop that is unstable over less than an eighth of a period
of delays, and stable again, would not be seen."""

_BISECTIONS = 12  # of an eighth of a period: to 1/30,000 of it
_AT = 1e-9
"""Distance of the spectral radius from 1 that counts as none: ten times less is rounding of the
exponentials, ten times more takes slow modes for drifting ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledMargin:
    """How much constant delay a sampled loop tolerates beside its hold.

    Attributes:
        period: T, s.
        delay: s; every delay that was tried up to here is stable, and the next one is not. 0 where
            the loop is unstable without delay, inf where nothing is late. None where more commands
            wait than can be lifted.
        proven: s; the loop is stable for every constant delay up to here: jitter margin − T.
    """

    period: float
    delay: float | None
    proven: float


def sampled_radius(
    A_0: ArrayLike,
    B: ArrayLike,
    C: ArrayLike,
    *,
    period: float,
    delay: float,
    symmetries: ArrayLike | None = None,
) -> float:
    """Spectral radius of ẋ = A_0 x + B u with u(t) = C x(kT) held on kT + d ≤ t < (k + 1) T + d.

    Exact: with d = m T + r, 0 ≤ r < T,

        x_{k+1} = Φ x_k + Γ_new u_{k−m} + Γ_old u_{k−m−1} ,   Φ = e^{A_0 T} ,
        Γ_new = ∫_0^{T−r} e^{A_0 s} ds B ,   Γ_old = e^{A_0 (T−r)} ∫_0^r e^{A_0 s} ds B

    on x_k and the m + 1 commands that wait. The loop is stable if and only if it is less than 1.

    Args:
        A_0: (n, n) undelayed part, 1/s.
        B: (n, m) what the command does.
        C: (m, n) the command of a state.
        period: T, s.
        delay: d of measurement, computation and command together, s; the hold comes on top.
        symmetries: (n, s) columns along which nothing acts, as `delay_margin` takes them.

    Raises:
        InputError: matrices do not fit, a time is no time, or more commands wait than can be
            lifted.
        SolverError: a matrix moves a symmetry.
    """
    return _Held.of(A_0, B, C, period=period, symmetries=symmetries).radius(time_of("delay", delay))


def sampled_margin(
    A_0: ArrayLike,
    B: ArrayLike,
    C: ArrayLike,
    *,
    period: float,
    symmetries: ArrayLike | None = None,
) -> SampledMargin:
    """Find the largest constant delay of a sampled and held loop; docs/theory section 7.6.

    A hold is a delay that grows from d to d + T and falls back: up to the jitter margin less T the
    loop is stable for sure. From there delays are tried, eight in a period, until one is unstable,
    and the last step is bisected.

    Args:
        A_0: (n, n) undelayed part, 1/s.
        B: (n, m) what the command does.
        C: (m, n) the command of a state.
        period: T, s.
        symmetries: (n, s) columns along which nothing acts, as `delay_margin` takes them.

    Returns:
        The margin.

    Raises:
        InputError: matrices do not fit or the period is no time.
        SolverError: a matrix moves a symmetry, or rounding leaves the jitter margin open.
    """
    held = _Held.of(A_0, B, C, period=period, symmetries=symmetries)
    varying = jitter_margin(A_0, B, C, symmetries=symmetries)
    if math.isinf(varying.delay):
        return SampledMargin(period=period, delay=math.inf, proven=math.inf)
    proven = max(0.0, varying.delay - period)
    if held.size(proven) > _LARGEST:
        return SampledMargin(period=period, delay=None, proven=proven)
    low, step = proven, period / _STEPS
    if not held.stable(low):
        return SampledMargin(period=period, delay=0.0, proven=0.0)
    while held.stable(low + step):
        low += step
        if held.size(low + step) > _LARGEST:
            return SampledMargin(period=period, delay=None, proven=proven)
    high = low + step
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if held.stable(middle) else (low, middle)
    return SampledMargin(period=period, delay=low, proven=proven)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Held:
    """A loop without symmetries, ẋ = A x + left u, and what is sampled of it, right x."""

    A: Array
    left: Array
    right: Array
    period: float

    @classmethod
    def of(
        cls, A_0: ArrayLike, B: ArrayLike, C: ArrayLike, *, period: float,
        symmetries: ArrayLike | None,
    ) -> "_Held":  # fmt: skip
        T = time_of("period", period)
        if T == 0.0:
            raise InputError("period is 0 s; a positive time is needed.")
        loop, broken = broken_at(A_0, B, C, symmetries=symmetries)
        return cls(A=loop.A_0, left=broken.left, right=broken.right, period=T)

    def size(self, delay: float) -> int:
        """States and waiting commands."""
        return len(self.A) + (math.floor(delay / self.period) + 1) * len(self.right)

    def stable(self, delay: float) -> bool:
        return self.radius(delay) < 1.0 - _AT

    def radius(self, delay: float) -> float:
        n, r, T = len(self.A), len(self.right), self.period
        if not n:
            return 0.0
        size, waiting = self.size(delay), math.floor(delay / T)
        if size > _LARGEST:
            raise InputError(
                f"{waiting + 1} commands of {r} signals wait in a delay of {delay:g} s at a period "
                f"of {T:g} s: more than can be lifted. Give a longer period."
            )
        rest = delay - waiting * T
        move, new = self._integrated(T - rest)
        early, old = self._integrated(rest)
        lifted = np.zeros((size, size))
        lifted[:n, :n] = move @ early
        arrives = [(waiting, new), (waiting + 1, move @ old)]
        for late, gain in arrives:
            if late == 0:
                lifted[:n, :n] += gain @ self.right
            else:
                lifted[:n, n + (late - 1) * r : n + late * r] = gain
        lifted[n : n + r, :n] = self.right
        lifted[n + r :, n:-r] = np.eye(size - n - r)
        return float(np.abs(np.linalg.eigvals(lifted)).max())

    def _integrated(self, time: float) -> tuple[Array, Array]:
        """e^{A t} and ∫_0^t e^{A s} ds left."""
        from scipy.linalg import expm

        n, r = self.left.shape
        both = np.zeros((n + r, n + r))
        both[:n, :n], both[:n, n:] = self.A, self.left
        whole = expm(both * time)
        return whole[:n, :n], whole[:n, n:]
