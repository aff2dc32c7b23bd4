"""Sampled loops as they are: a command that is computed once a period, late, and held."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from sealag.errors import InputError
from sealag.margin._loop import prepare, time_of
from sealag.typing import Array, ArrayLike
from sealag.units import in_ms

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
    """A loop without symmetries, ẋ = A x + left u, sampled as u_k = right x_k + says ξ_k, and the
    controller's own memory, ξ_{k+1} = keeps ξ_k + reads x_k."""

    A: Array
    left: Array
    right: Array
    keeps: Array
    reads: Array
    says: Array
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
        return cls(
            A=A, left=left, right=right, keeps=np.zeros((0, 0)), reads=np.zeros((0, len(A))),
            says=np.zeros((len(right), 0)), period=_positive(period),
        )  # fmt: skip

    @classmethod
    def with_memory(
        cls,
        A_0: Array,
        B: Array,
        C: Array,
        *,
        symmetries: ArrayLike | None,
        memory: int,
        own: float,
        period: float,
    ) -> Self:
        """Split a controller's memory off, which goes on at the ticks.

        Args:
            A_0: (n, n) undelayed part, the memory's states last.
            B: (n, m) what a command does.
            C: (m, n) the command.
            symmetries: (n, s) or None.
            memory: number of the controller's states.
            own: period that these are the bilinear equivalent for, s; 0 for none.
            period: T, s.

        Raises:
            InputError: the memory acts past the command, or is of another period.
            SolverError: a matrix moves a symmetry.
        """
        T, rest = _positive(period), len(A_0) - memory
        A, A_c, G = A_0[:rest, :rest], A_0[rest:, rest:], A_0[rest:, :rest]
        if A_0[:rest, rest:].any() or B[rest:].any():
            raise InputError("The last states are a controller's memory, but act past its command.")
        right, says, one = C[:, :rest], C[:, rest:], np.eye(memory)
        if not own:
            keeps, gain = _integrated(A_c, one, T)
        elif math.isclose(own, T, rel_tol=1e-9):
            keeps = np.linalg.solve(one - A_c * T / 2.0, one + A_c * T / 2.0)
            gain = keeps + one
            says = (T / 4.0) * says @ gain
            right = right + says @ G
        else:
            raise InputError(
                f"The controller is given for a period of {in_ms(own)}, and {in_ms(T)} is asked "
                "for; its matrices say nothing of other rates."
            )
        # Gᵀ G has the null space of G: what memory does not see
        plant = prepare(
            A, B[:rest] @ right, A_e=G.T @ G, embedded_delay=1.0,
            symmetries=None if symmetries is None else np.asarray(symmetries)[:rest],
        )  # fmt: skip
        return cls(
            A=plant.A_0, left=np.linalg.pinv(plant.lift) @ B[:rest], right=right @ plant.lift,
            keeps=keeps, reads=gain @ G @ plant.lift, says=says, period=T,
        )  # fmt: skip

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
        kept = len(self.A) + len(self.keeps)
        return kept + (math.floor(delay / self.period) + 1) * len(self.right)

    def stable(self, delay: float) -> bool:
        return self.radius(delay) < 1.0 - _AT

    def radius(self, delay: float) -> float:
        n, s, r, T = len(self.A), len(self.keeps), len(self.right), self.period
        if not n + s:
            return 0.0
        size, waiting = self.size(delay), math.floor(delay / T)
        if size > _LARGEST:
            raise InputError(
                f"{waiting + 1} commands of {r} signals wait in a delay of {delay:g} s at a period "
                f"of {T:g} s: more than can be lifted. Give a longer period."
            )
        rest = delay - waiting * T
        move, new = _integrated(self.A, self.left, T - rest)
        early, old = _integrated(self.A, self.left, rest)
        lifted, kept = np.zeros((size, size)), n + s
        lifted[:n, :n] = move @ early
        lifted[n:kept, :kept] = np.hstack([self.reads, self.keeps])
        command = np.hstack([self.right, self.says])
        arrives = [(waiting, new), (waiting + 1, move @ old)]
        for late, gain in arrives:
            if late == 0:
                lifted[:n, :kept] += gain @ command
            else:
                lifted[:n, kept + (late - 1) * r : kept + late * r] = gain
        lifted[kept : kept + r, :kept] = command
        lifted[kept + r :, kept:-r] = np.eye(size - kept - r)
        return float(np.abs(np.linalg.eigvals(lifted)).max())


def _positive(period: float) -> float:
    T = time_of("period", period)
    if T == 0.0:
        raise InputError("period is 0 s; a positive time is needed.")
    return T


def _integrated(A: Array, left: Array, time: float) -> tuple[Array, Array]:
    """e^{A t} and ∫_0^t e^{A s} ds left."""
    from scipy.linalg import expm

    n, r = left.shape
    both = np.zeros((n + r, n + r))
    both[:n, :n], both[:n, n:] = A, left
    whole = expm(both * time)
    return whole[:n, :n], whole[:n, n:]
