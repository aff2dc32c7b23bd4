"""The answer: a bracket of the largest delay, which measures itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sealag.errors import InputError
from sealag.passivity._measure import Complement, factorise
from sealag.passivity._multipliers import multiplier_for
from sealag.passivity._problem import Problem, symmetric, transposed
from sealag.passivity._proofs import Window
from sealag.passivity._solvers import ClarabelDirect, Solver
from sealag.typing import Array, BoolArray

_TURNS = 100
"""Steps in which the angle of the worst motion settles; it takes 2 to 5."""


class Residual(NamedTuple):
    """How far an inequality holds: it does where the lowest eigenvalue exceeds its rounding."""

    lowest: float
    rounding: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Polytope:
    """Matrices that one window of a motion stays in: a box, and a ball around each of its points.

    Attributes:
        first: first instant.
        last: last instant; neighbouring windows share one.
        J: (1 + k, m, n) centre of the box and then its half edges, J* D^-½.
        M: (1 + k, n, m) the same of D^-½ J*ᵀ S.
        corner: largest ‖[JᵀC, d M C^-ᵀ]‖₂ over the corners, W = C Cᵀ.
        radius: of the ball, in the same norm; corner + radius ≤ √2 proves the delay.
    """

    first: int
    last: int
    J: Array
    M: Array
    corner: float
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """A guaranteed bracket of the largest delay.

    Attributes:
        problem: what was asked.
        delay: (…) s, never above the supremum; inf without stiffness, 0 where `refusals` say why.
        upper: (…) s, never below the supremum.
        angle: (…) φ at which the numerical radius is reached, rad; None with a shared multiplier.
        multiplier: (m, m) W, one for all instants; None where each instant has its own (`prove`)
            or nothing was proven.
        reason: why no longer delay was proven, in words; empty if the ends meet.
        refusals: which conditions of the criterion fail, in words.
        binding: instants that the shared multiplier was computed from.
        windows: the polytopes that it holds in.
    """

    problem: Problem
    delay: Array
    upper: Array
    angle: Array | None = None
    multiplier: Array | None = None
    reason: str = ""
    refusals: tuple[str, ...] = ()
    binding: tuple[int, ...] = ()
    windows: tuple[Polytope, ...] = ()

    @staticmethod
    def by_parts(count: int) -> "Joined":
        """Return what joins the bound of a motion from its parts.

        Args:
            count: how many instants there will be.
        """
        return Joined(count)

    @property
    def width(self) -> Array:
        """Relative width of the bracket, (…)."""
        with np.errstate(invalid="ignore"):
            return np.where(np.isinf(self.delay), 0.0, self.upper / self.delay - 1.0)

    @property
    def direction(self) -> Array:
        """Share of each joint in the motion that first turns the delayed loop active, (…, n): its
        part of the damping power θ̇ᵀ D_θ θ̇."""
        motion = _extremal(self.problem.scaled_stiffness(), self._angle)
        return np.square(np.abs(motion), dtype=np.float64)

    @property
    def _angle(self) -> Array:
        if self.angle is None:
            raise InputError("A shared multiplier has no single direction; solve with Instant().")
        return self.angle

    def worst_motion(self, instant: int | None = None) -> Array:
        """Return D_θ^½ θ̇ of the motion that first turns the delayed loop active, (n,) complex.

        Args:
            instant: which one; None for a bound of one instant.

        Raises:
            InputError: there is no such instant, or the bound has a shared multiplier.
        """
        at = () if instant is None else instant
        A, phi = self.problem.at(at).scaled_stiffness(), self._angle[at]
        for _ in range(_TURNS):
            x = _extremal(A, phi)
            before, phi = phi, -np.angle(x.conj() @ A @ x)
            if abs(phi - before) <= 1e-14:
                break
        return _extremal(A, phi)

    @property
    def blocks(self) -> tuple[Array, ...]:
        """W_i of each level, symmetric (m_i, m_i); empty without a multiplier."""
        if self.multiplier is None:
            return ()
        W = symmetric(self.multiplier)
        return tuple(W[rows, rows] for rows in self.problem.rows)

    def stated_windows(self, D_theta: Array) -> tuple[Window, ...]:
        """Return the polytopes of a time-varying bound in Nm/rad, as certificates state them.

        Args:
            D_theta: (n,) motor damping, Nms/rad.
        """
        root = np.sqrt(D_theta)[:, None]
        found = []
        for one in self.windows:
            centre, *axes = root * one.M
            kept = [axis for axis in axes if axis.any()]
            found.append(
                Window(
                    first=one.first,
                    last=one.last,
                    centre=centre,
                    axes=np.array(kept).reshape(-1, *centre.shape),
                    radius=one.radius,
                )
            )
        return tuple(found)

    def residual(self) -> Residual:
        """Measure 2I − JᵀWJ − d² M W⁻¹ Mᵀ: its smallest eigenvalue over the instants.

        Returns:
            The eigenvalue, and the bound of its rounding error.

        Raises:
            InputError: there is no multiplier; `prove` finds that of an instant.
        """
        problem = self.problem.motion()
        factor = factorise(problem, self.multiplier)
        if factor is None:
            raise InputError("There is no multiplier to measure; `prove` finds that of an instant.")
        delay = np.broadcast_to(self.delay, len(problem.J))
        lowest, rounding = Complement(problem, factor).lowest(delay)
        worst = int(np.argmin(lowest - rounding))
        return Residual(lowest=float(lowest[worst]), rounding=float(rounding[worst]))

    def prove(self, instant: int | None = None, *, solver: Solver | None = None) -> "Bound":
        """Return this bound at one instant with a multiplier that proves it.

        Args:
            instant: which one; None for a bound of one instant.
            solver: where multipliers of several levels come from that have no closed form;
                Clarabel's own interface if None.

        Raises:
            InputError: the delay is 0 or unbounded, the bound is a batch, or there is no such
                instant.
            SolverError: nothing proves it: the delay is too close to the supremum.
        """
        at = () if instant is None else instant
        problem, delay = self.problem.at(at), self.delay[at]
        if problem.batch:
            raise InputError("A multiplier belongs to one instant; name it.")
        W = multiplier_for(problem, float(delay), solver=solver or ClarabelDirect())
        return Bound(problem=problem, delay=delay, upper=self.upper[at], multiplier=W)

    def eased(self, share: float) -> "Bound":
        """Return the same for a share of the delay, where multipliers leave room for rounding.

        ‖[JᵀC, d M C^-ᵀ]‖₂ ≤ √2 with s d and √s W is smaller by s^¼ at least.

        Args:
            share: s, just below 1.
        """
        W = None if self.multiplier is None else np.sqrt(share) * self.multiplier
        return replace(self, delay=share * self.delay, multiplier=W)

    def refused(self, instants: BoolArray | Sequence[int], reason: str) -> "Bound":
        """Return the same with no delay at instants where a condition of the criterion fails.

        Args:
            instants: (N,) which.
            reason: the condition, in words.
        """
        delay, upper = np.array(self.delay), np.array(self.upper)
        delay[instants] = upper[instants] = 0.0
        return replace(self, delay=delay, upper=upper, refusals=(*self.refusals, reason))


class Joined:
    """The bound of a motion that is answered part by part, each instant by itself."""

    def __init__(self, count: int) -> None:
        """Begin.

        Args:
            count: how many instants there will be.
        """
        self._count = count
        self._whole: Bound | None = None
        self._least = np.inf

    def add(self, rows: slice, part: Bound) -> None:
        """Add the next instants.

        Args:
            rows: which instants these are.
            part: their bound.
        """
        if len(part.delay) == self._count:
            self._whole = part
            return
        if self._whole is None:
            delay, upper, angle = (np.zeros(self._count) for _ in range(3))
            problem = part.problem.room(self._count)
            self._whole = Bound(problem=problem, delay=delay, upper=upper, angle=angle)
        whole = self._whole
        whole.problem.put(rows, part.problem)
        whole.delay[rows], whole.upper[rows], whole._angle[rows] = (
            part.delay, part.upper, part._angle,
        )  # fmt: skip
        if part.delay.min() < self._least:
            self._least = float(part.delay.min())
            self._whole = replace(whole, reason=part.reason)

    @property
    def bound(self) -> Bound:
        """The bound of all instants."""
        assert self._whole is not None
        return self._whole


def _extremal(A: Array, angle: Array) -> Array:
    """Eigenvector of λ_max(cos φ S + i sin φ T), S and T the symmetric and skew parts of A."""
    phi = np.asarray(angle)[..., None, None]
    H = np.cos(phi) * symmetric(A) + 0.5j * np.sin(phi) * (A - transposed(A))
    return np.linalg.eigh(H)[1][..., -1]
