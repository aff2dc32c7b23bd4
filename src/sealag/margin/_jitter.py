"""Jitter margin: how much delay that varies as it likes a frozen loop tolerates."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Self

import numpy as np

from sealag.errors import SolverError
from sealag.margin._loop import (
    Loop,
    eigenvalues_with_error,
    roots_at_once,
)
from sealag.typing import Array

_RANK = 1e-13
"""Share of the largest singular value of C below which a direction carries no command."""

_BRACKET = 1e-9
"""Relative width of the bracket of a norm. Ten times narrower, double roots of the Hamiltonian lie
closer to the axis than rounding; ten times wider shows in nothing that is printed."""

_WIDEST = 1e-2
"""Relative width at which a bracket is given up. Loops that need more have roots on the axis."""

_ROUNDS = 60  # of the level set; three or four are usual


@dataclass(frozen=True, slots=True, kw_only=True)
class JitterMargin:
    """How much varying delay a loop tolerates; sufficient for the frozen loop.

    Attributes:
        delay: s; the loop is stable for every measurable τ(t) with 0 ≤ τ(t) ≤ delay. 0 where a root
            is not in the open left half-plane without delay, inf where nothing is late; `at_most`
            where that was given and is proven.
        upper: s; no multiplier X proves more. A longer delay need not be unstable. inf where
            `at_most` is proven.
        frequency: at which the bound is reached, rad/s; inf above all roots, NaN without a bound.
        unstable_roots: roots not in the open left half-plane without delay, symmetries left out.
        neutral: structural zero roots taken out.
        channels: s; the same of each channel that was named, if only that is late.
    """

    delay: float
    upper: float
    frequency: float
    unstable_roots: int
    neutral: int
    channels: Mapping[str, float] = field(default_factory=dict)


def jitter_margin(loop: Loop, broken: "Broken", *, at_most: float | None = None) -> JitterMargin:
    """Bound `DelayedLoop.jitter_margin` of a loop whose one delay is that of its command.

    Args:
        loop: the prepared loop.
        broken: it, broken where it is late.
        at_most: longest delay of interest, s.
    """
    unstable = roots_at_once(loop.A_0 + loop.A_1)[0] if len(loop.A_0) else 0
    found = _Bound(0.0, 0.0, math.nan)
    if not unstable:
        enough = None if at_most is None or at_most <= 0.0 else _tolerates(broken, at_most)
        found = enough or _bound(broken)
    return JitterMargin(
        delay=found.delay, upper=found.upper, frequency=found.frequency, unstable_roots=unstable,
        neutral=loop.neutral,
    )  # fmt: skip


class _Bound(NamedTuple):
    delay: float
    upper: float
    frequency: float


class _Peak(NamedTuple):
    """The norm of a transfer matrix lies between low, attained at a frequency, and high."""

    low: float
    high: float
    frequency: float


class System(NamedTuple):
    """D + C (s − A)⁻¹ B."""

    A: Array
    B: Array
    C: Array
    D: Array

    def at(self, frequencies: Array) -> Array:
        """Responses (f, p, m) at frequencies (f,), rad/s."""
        inside = 1j * frequencies[:, None, None] * np.eye(len(self.A)) - self.A
        return self.D + self.C @ np.linalg.solve(inside, self.B[None].astype(complex))

    def hamiltonian(self, level: float) -> Array:
        """The matrix (2k, 2k) with an eigenvalue jω if and only if a singular value at jω is the
        level, which is larger than those of D; its two states are scaled alike."""
        A, B, C, D = self
        inner = np.linalg.inv(level**2 * np.eye(D.shape[1]) - D.T @ D)
        F = A + B @ inner @ D.T @ C
        G, Q = B @ inner @ B.T, C.T @ (np.eye(len(D)) + D @ inner @ D.T) @ C
        scale = math.sqrt(float(np.linalg.norm(Q)) / float(np.linalg.norm(G)))
        return np.block([[F, scale * G], [-Q / scale, -F.T]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Broken:
    """A loop without delay, broken where signals are late: the command's first, then the drives'.

    Attributes:
        A: (k, k) the loop without delay, 1/s.
        left: (k, r) what w does.
        right: (r, k) the signals.
        late: number of them that the command takes.
    """

    A: Array
    left: Array
    right: Array
    late: int

    @classmethod
    def of(cls, loop: Loop, B: Array, C: Array) -> Self:
        """Break a loop at the singular values of C (m, n), and at those of its embedded part."""
        back = np.linalg.pinv(loop.lift)
        L, R = halves(C)
        L_e, R_e = halves(loop.A_e)
        return cls(
            A=loop.A_0 + loop.A_1 + loop.A_e,
            left=np.hstack([back @ B @ L, L_e]),
            right=np.vstack([R @ loop.lift, R_e]),
            late=L.shape[1],
        )

    def scaled(self, rows: Array, columns: Array) -> System:
        """From w to the signals' rates, s R (s − A)⁻¹ L, with scaled rows and columns."""
        left, right = self.left * columns, rows[:, None] * self.right
        return System(self.A, left, right @ self.A, right @ left)


def halves(matrix: Array) -> tuple[Array, Array]:
    """L (m, r) and R (r, n) with L R the matrix, of one scale."""
    U, values, V = np.linalg.svd(matrix, full_matrices=False)
    rank = int((values > _RANK * values[0]).sum()) if values.size and values[0] > 0.0 else 0
    root = np.sqrt(values[:rank])
    return U[:, :rank] * root, root[:, None] * V[:rank]


def _bound(broken: Broken) -> _Bound:
    """The largest d that is proven, where nothing is late but the command."""
    if not broken.late:
        return _Bound(math.inf, math.inf, math.nan)
    one = np.ones(broken.late)
    plain = broken.scaled(one, one)
    peak = peak_of(plain)
    delay, frequency = 1.0 / peak.high if peak.high else math.inf, peak.frequency
    at = plain.D if not math.isfinite(frequency) else plain.at(np.array([frequency]))[0]
    radius = float(np.abs(np.linalg.eigvals(at)).max())
    return _Bound(delay, max(1.0 / radius if radius else math.inf, delay), frequency)


def _tolerates(broken: Broken, delay: float) -> _Bound | None:
    """Whether a delay is proven: no singular value of T reaches its reciprocal at any frequency.

    Responses are below it above all roots, and can only reach it where the Hamiltonian matrix of
    this level has an eigenvalue on the axis; what rounding could hold there counts as such.
    """
    if not broken.late or not math.isfinite(delay):
        return None
    one = np.ones(len(broken.right))
    plain, level = broken.scaled(one, one), 1.0 / delay
    if float(np.linalg.norm(plain.D, 2)) * (1.0 + _BRACKET) >= level:
        return None
    roots, error = eigenvalues_with_error(plain.hamiltonian(level))
    if (np.abs(roots.real) <= error).any():
        return None
    return _Bound(delay, math.inf, math.nan)


def frequencies_of(A: Array) -> Array:
    """Where a response may have its peaks: 0, and the roots' imaginary parts and sizes, rad/s."""
    roots = np.linalg.eigvals(A)
    return np.unique(np.concatenate([[0.0], np.abs(roots.imag), np.abs(roots)]))


def peak_of(system: System) -> _Peak:
    """Bracket the largest singular value over all frequencies.

    Raises:
        SolverError: rounding leaves it open.
    """
    low = high = float(np.linalg.norm(system.D, 2))
    frequency, width, tried = math.inf, _BRACKET, frequencies_of(system.A)
    for turn in range(_ROUNDS):
        sizes = np.linalg.norm(system.at(tried), 2, axis=(1, 2))
        best = int(sizes.argmax())
        if sizes[best] > high:
            low, frequency = float(sizes[best]), float(tried[best])
        elif turn:  # nothing exceeds the level: only rounding holds roots on the axis
            width *= 10.0
        if not low:
            return _Peak(0.0, 0.0, math.nan)
        if width > _WIDEST:
            break
        high = low * (1.0 + width)
        roots, error = eigenvalues_with_error(system.hamiltonian(high))
        axis = np.unique(np.abs(roots.imag[np.abs(roots.real) <= error]))
        if not len(axis):
            return _Peak(low, high, frequency)
        between = np.sqrt(axis[:-1] * axis[1:]), (axis[:-1] + axis[1:]) / 2.0
        tried = np.concatenate([axis, *between])
    raise SolverError(
        "The norm of the broken loop could not be bracketed: roots lie on the imaginary axis to "
        "rounding; the jitter margin is not known."
    )
