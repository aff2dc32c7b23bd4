"""One way to ask: who shares a multiplier, each instant, a motion, or all that windows contain."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sealag.errors import InputError
from sealag.passivity._bound import Bound
from sealag.passivity._measure import (
    Factor,
    estimated_delays,
    factorise,
    lessened,
    proven_delays,
    refuted_delay,
)
from sealag.passivity._problem import EPS, Problem, norm
from sealag.passivity._radius import Bracket, bracket
from sealag.passivity._solvers import ClarabelDirect, Solver
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

_ROUNDS = 60
_FIRST = 8
_ADDED = 12
"""Calls of the solver at most, instants at first, and instants added a call. A motion of 7,000
instants takes 3 to 6 calls; ten times fewer rounds leave brackets open, ten times more instants a
call take minutes each."""


class Share(Protocol):
    """Who shares a multiplier."""

    def bound(self, problem: Problem, solver: Solver) -> Bound:
        """Answer a problem.

        Args:
            problem: the question.
            solver: where multipliers come from.
        """
        ...


def solve(problem: Problem, *, share: Share, solver: Solver | None = None) -> Bound:
    """Bracket the largest delay for which a multiplier makes the delayed loop passive.

    What a solver says is measured, not believed: primal multipliers that pass an eigenvalue check
    raise the lower end, dual ones lower the upper end.

    Args:
        problem: the matrices.
        share: `Instant`, `Motion` or `Windows`: what one multiplier has to hold for.
        solver: where multipliers come from that have no closed form; Clarabel's own interface if
            None.

    Returns:
        The bracket; an open one says why.

    Raises:
        InputError: the share cannot be asked of this problem, or a tolerance is out of range.
    """
    return share.bound(problem, solver if solver is not None else ClarabelDirect())


def max_delay(
    J_star: ArrayLike,
    Lambda: ArrayLike,
    K_x: ArrayLike,
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    tolerance: float = 1e-6,
) -> Bound:
    """Largest delay of Theorem 1 (29), d = 1 / w(D^-½ J*ᵀ S J* D^-½), in closed form.

    w is the numerical radius; the value is the supremum over all multipliers Q ≻ 0, for any m, n
    and rank of J* (Ando's theorem; docs/theory section 5). With `form="published"`, S = Λ K_x and
    this is the criterion as printed; it is sufficient for a passive loop only where S is symmetric
    and x(θ) is what is fed back (docs/theory section 6).

    Args:
        J_star: (…, m, n) contact-consistent Jacobian J*.
        Lambda: (…, m, m) task inertia, symmetric positive semidefinite; unused for `force`.
        K_x: (m,) or (…, m, m) task gains, symmetric positive semidefinite.
        D_theta: (n,) or (…, n, n) motor damping, symmetric positive definite, Nms/rad.
        form: symmetric (Λ^½ K_x Λ^½), published (Λ K_x) or force (K_x).
        tolerance: relative width of the bracket at which refinement stops.

    Returns:
        The bracket, of the arguments' common batch shape. Rounding of every step is inside it,
        so that it may be wider than `tolerance` for badly conditioned Λ or D_θ.

    Raises:
        InputError: a shape does not fit, an entry is not finite, D_θ is not positive definite,
            or Λ or K_x is not symmetric positive semidefinite.
    """
    problem = Problem.of_tasks(J_star, Lambda, K_x, D_theta, form=form)
    return solve(problem, share=Instant(tolerance=tolerance))


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """Each instant has a multiplier of its own: the quasi-static bound.

    One level: d = 1 / w(A), A = D^-½ J*ᵀ S J* D^-½, in closed form. Several levels:
    1 / Σ w(A_i) ≤ d ≤ 1 / w(Σ A_i), and the upper end is the supremum where every A_i is symmetric
    positive semidefinite (Y_i = d A_i proves it); elsewhere a solver closes the bracket.

    Attributes:
        tolerance: relative width of the bracket at which refinement stops.
        every: whether the solver closes every open bracket, or only those that can hold the
            smallest delay.
    """

    tolerance: float = 1e-6
    every: bool = True

    def bound(self, problem: Problem, solver: Solver) -> Bound:
        """Answer a problem of any batch shape.

        Args:
            problem: the question.
            solver: where multipliers of several levels come from.
        """
        whole = together(problem, tolerance=self.tolerance)
        if len(problem.blocks) == 1:
            return Bound(problem=problem, delay=whole.delay, upper=whole.upper, angle=whole.angle)
        levels = [problem.scaled_stiffness(rows) for rows in problem.rows]
        if problem.semidefinite:
            # What gains within rounding of PSD leave negative is taken off.
            lowest = sum(np.minimum(np.linalg.eigvalsh(A)[..., 0], 0.0) for A in levels)
            delay = lessened(whole.delay, -2.0 * lowest)
            return Bound(problem=problem, delay=delay, upper=whole.upper, angle=whole.angle)
        each = [
            bracket(A, problem.A_error[..., k], tolerance=self.tolerance).delay
            for k, A in enumerate(levels)
        ]
        with np.errstate(divide="ignore"):
            split = (1.0 - 4.0 * len(each) * EPS) / sum(1.0 / delay for delay in each)
        delay, upper = np.array(split), np.array(whole.upper)
        reason = self._close(problem, delay, upper, solver)
        return Bound(problem=problem, delay=delay, upper=upper, angle=whole.angle, reason=reason)

    def _close(self, problem: Problem, delay: Array, upper: Array, solver: Solver) -> str:
        """Move both ends of open brackets by measured multipliers; return why one stays open."""
        reasons: dict[tuple[int, ...], str] = {}
        share = Motion(tolerance=self.tolerance)

        def close(at: tuple[int, ...]) -> None:
            found = share.bound(problem.at(at), solver)
            delay[at], upper[at] = max(delay[at], found.delay), min(upper[at], found.upper)
            reasons[at] = found.reason if upper[at] > delay[at] * (1.0 + self.tolerance) else ""

        if self.every:
            for at in zip(*np.nonzero(np.atleast_1d(upper > delay * (1.0 + self.tolerance)))):
                close(tuple(int(k) for k in at) if delay.ndim else ())
            return next(filter(None, reasons.values()), "")
        while (at := _smallest(delay)) not in reasons:
            close(at)
        return reasons[at]


def _smallest(delay: Array) -> tuple[int, ...]:
    return tuple(int(k) for k in np.unravel_index(np.argmin(delay), delay.shape))


def together(problem: Problem, *, tolerance: float = 1e-6) -> Bracket:
    """1 / w(Σ A_i) at each instant, which no multiplier exceeds.

    Args:
        problem: the instants.
        tolerance: relative width at which refinement stops.
    """
    A = problem.scaled_stiffness()
    error = problem.A_error.sum(axis=-1)
    if len(problem.blocks) > 1:
        error = error + sum(problem.blocks) * EPS * norm(problem.M) * norm(problem.J)
    return bracket(A, error, tolerance=tolerance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """All instants share one multiplier, as the constant Q of the storage function V_4 asks for.

    The inequality is convex in (J*, J*ᵀS), so that what holds at the instants holds on the straight
    lines between them. It says nothing of the change of S in V_3. A solver sees few instants; the
    worst of all others join until none is worse.

    Attributes:
        tolerance: relative distance of proven and refuted delay at which the search stops.
    """

    tolerance: float = 1e-6

    def bound(self, problem: Problem, solver: Solver) -> Bound:
        """Answer a problem of one axis of instants.

        Args:
            problem: the question.
            solver: where multipliers come from.
        """
        if not 1e-9 <= self.tolerance <= 0.1:
            raise InputError(f"tolerance is {self.tolerance:g}; it must lie in 1e-9 … 0.1.")
        problem = problem.motion()
        whole = [together(part) for part in problem.parts()]
        pointwise = np.concatenate([part.delay for part in whole])
        found = search(problem, pointwise, tolerance=self.tolerance, solver=solver)
        proven = min(float(proven_delays(part, found.factor).min()) for part in problem.parts())
        upper = min(found.upper, *(float(part.upper.min()) for part in whole))
        closed = upper <= proven * (1.0 + self.tolerance) or np.isinf(proven)
        return Bound(
            problem=problem,
            delay=lessened(proven, rounding(problem)),
            upper=lessened(upper, -rounding(problem)),
            multiplier=None if found.factor is None else found.factor.W,
            binding=found.binding,
            reason="" if closed else f"{solver.name} left the bracket open: {found.status}",
        )


def rounding(problem: Problem) -> float:
    """Bound what rounding in the scaled matrices does to 1/d, 1/s.

    Args:
        problem: one axis of instants.
    """
    error = np.broadcast_to(problem.M_error, (len(problem.J), len(problem.blocks)))
    sizes = [max(norm(part.J[:, rows]).max() for part in problem.parts()) for rows in problem.rows]
    return float(sum(size * error[:, k].max() for k, size in enumerate(sizes)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Where constraint generation ended.

    Attributes:
        factor: of the best multiplier; None if there was none.
        delay: s; that it proves at every instant, to rounding.
        upper: s; smallest delay that was refuted.
        binding: instants that the solver was given.
        status: its last words.
    """

    factor: Factor | None
    delay: float
    upper: float
    binding: tuple[int, ...]
    status: str


def search(problem: Problem, pointwise: Array, *, tolerance: float, solver: Solver) -> Search:
    """Find one multiplier for all instants by giving the solver ever more of them.

    Args:
        problem: all instants.
        pointwise: (N,) s, each instant's own bound, from which the first are chosen.
        tolerance: relative distance of the two ends at which to stop.
        solver: where candidates come from.
    """
    count, m, _ = problem.J.shape
    if not any(part.M.any() for part in problem.parts()):
        small = np.eye(m) / (1.0 + float(norm(problem.J).max()) ** 2)
        factor = factorise(problem, small)
        return Search(factor=factor, delay=np.inf, upper=np.inf, binding=(), status="no stiffness")
    spread = np.linspace(0, count - 1, min(count, _FIRST)).astype(int)
    active = np.unique(np.concatenate([spread, _worst(pointwise, np.inf)]))
    best, best_delay, upper, status = None, 0.0, np.inf, ""
    for _ in range(_ROUNDS):
        part = problem.at(active)
        solution = solver.solve(part)
        status = solution.status
        upper = min(upper, refuted_delay(part, solution.P))
        factor = factorise(problem, solution.W)
        if factor is None:
            break
        delays = np.concatenate([estimated_delays(part, factor) for part in problem.parts()])
        if delays.min() > best_delay:
            best, best_delay = factor, float(delays.min())
        if upper <= best_delay * (1.0 + 0.25 * tolerance) or np.isinf(best_delay):
            break
        fresh = np.setdiff1d(_worst(delays, upper * (1.0 - 0.1 * tolerance)), active)
        if not len(fresh):
            break
        active = np.union1d(active, fresh)
    binding = tuple(int(k) for k in active)
    return Search(factor=best, delay=best_delay, upper=upper, binding=binding, status=status)


def _worst(delays: Array, limit: float) -> Array:
    """Some instants below a limit: the lowest of all, and the lowest local minima along time."""
    left = np.concatenate([[np.inf], delays[:-1]])
    right = np.concatenate([delays[1:], [np.inf]])
    minima = np.flatnonzero((delays <= left) & (delays <= right) & (delays < limit))
    return minima[np.argsort(delays[minima], kind="stable")][:_ADDED]
