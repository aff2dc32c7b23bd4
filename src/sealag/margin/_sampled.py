"""Sampled loops as they are: a command that is computed once a period, late, and held."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from sealag.errors import InputError
from sealag.margin._loop import time_of
from sealag.typing import Array

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """A loop without symmetries, ẋ = A x + left u, and what is sampled of it, right x."""

    A: Array
    left: Array
    right: Array
    period: float

    @classmethod
    def of(cls, A: Array, left: Array, right: Array, *, period: float) -> Self:
        """Check the period.

        Args:
            A: (n, n) undelayed part, 1/s.
            left: (n, r) what a held signal does.
            right: (r, n) the signals.
            period: T, s.
        """
        T = time_of("period", period)
        if T == 0.0:
            raise InputError("period is 0 s; a positive time is needed.")
        return cls(A=A, left=left, right=right, period=T)

    def margin(self, varying: float) -> SampledMargin:
        """Find the largest delay beside the hold.

        Args:
            varying: jitter margin of the loop, s.
        """
        period = self.period
        if math.isinf(varying):
            return SampledMargin(period=period, delay=math.inf, proven=math.inf)
        proven = max(0.0, varying - period)
        if self.size(proven) > _LARGEST:
            return SampledMargin(period=period, delay=None, proven=proven)
        low, step = proven, period / _STEPS
        if not self.stable(low):
            return SampledMargin(period=period, delay=0.0, proven=0.0)
        while self.stable(low + step):
            low += step
            if self.size(low + step) > _LARGEST:
                return SampledMargin(period=period, delay=None, proven=proven)
        high = low + step
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self.stable(middle) else (low, middle)
        return SampledMargin(period=period, delay=low, proven=proven)

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
