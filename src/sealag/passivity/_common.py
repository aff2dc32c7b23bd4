"""One multiplier for a whole motion, by constraint generation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.passivity._bounds import DelayBound, bracket
from sealag.passivity._problem import (
    Factor,
    MultiplierProblem,
    estimated_delays,
    factorise,
    lessened,
    proven_delays,
    refuted_delay,
)
from sealag.passivity._scaling import EPS, ScaledTask, scaled_stiffness, scaled_task
from sealag.passivity._solvers import ClarabelDirect, Solver
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

_ROUNDS = 60
_FIRST = 8
_ADDED = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonBound:
    """Largest delay with one multiplier for all instants of a motion.

    Attributes:
        delay: s; proven at every instant by W, never above the supremum.
        upper: s; never below the supremum.
        W: (m, m) the multiplier, one diagonal block a task; None if nothing was proven.
        pointwise: (N,) s; quasi-static bound of each instant with a multiplier of its own (for
            several tasks 1/Σw where the closed form is open).
        binding: instants that the solver was given.
        rounds: how often it was called.
        closed: whether the multipliers' two ends agree to the tolerance.
        reason: why they do not, in words; empty if they do.
    """

    delay: float
    upper: float
    W: Array | None
    pointwise: Array
    binding: tuple[int, ...]
    rounds: int
    closed: bool
    reason: str

    @property
    def Q(self) -> Array | None:
        """The constant Q of the storage function V_4, W / d; None if nothing was proven."""
        return None if self.W is None or not np.isfinite(self.delay) else self.W / self.delay


def max_delay_common(
    tasks: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    tolerance: float = 1e-6,
    solver: Solver | None = None,
) -> CommonBound:
    """Largest delay of (29), or of (31), with one constant Q over a whole motion.

    V_4 needs a constant Q: this is the answer that is rigorous for V_4, beside the paper's
    quasi-static one (`pointwise`). It says nothing of the change of S in V_3. The inequality is
    convex in (J*, J*ᵀS), so that what holds at the instants holds on the straight lines between
    them. A solver sees few instants; the worst of all others join until none is worse.

    Args:
        tasks: (N, m_i, n), (N, m_i, m_i) and (m_i,) or (N, m_i, m_i) of each task; one entry is
            Theorem 1.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        form: symmetric, published or force stiffness.
        tolerance: relative distance of proven and refuted delay at which the search stops.
        solver: where multipliers come from; Clarabel's own interface if None.

    Returns:
        The bracket with its multiplier.

    Raises:
        InputError: there is no task, or one has an unusable array.
    """
    scaled = [scaled_task(*task, D_theta, form=form) for task in tasks]
    problem, slack = stacked_problem(scaled)
    parts = [bracket(task.A, task.A_error, tolerance=1e-6).delay for task in scaled]
    with np.errstate(divide="ignore"):
        pointwise = 1.0 / np.sum(np.broadcast_arrays(*(1.0 / delay for delay in parts)), axis=0)
    if len(scaled) > 1 and StiffnessForm(form) is not StiffnessForm.PUBLISHED:
        pointwise = lessened(_together(problem).delay, slack)
    return _common(problem, slack, np.broadcast_to(pointwise, len(problem.J)), tolerance, solver)


def max_delay_common_from_stiffness(
    F: ArrayLike, D_theta: ArrayLike, *, tolerance: float = 1e-6, solver: Solver | None = None
) -> CommonBound:
    """Largest delay with one multiplier in joint coordinates for all delayed stiffnesses F_t.

    The certified criterion of docs/theory section 6 with V_4 = ½ ∫∫ θ̇ᵀ Q θ̇ and a constant Q (n, n);
    what holds at the instants holds on the straight lines between them.

    Args:
        F: (N, n, n) Nm/rad.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        tolerance: relative distance of proven and refuted delay at which the search stops.
        solver: where multipliers come from; Clarabel's own interface if None.

    Returns:
        The bracket with its multiplier.

    Raises:
        InputError: a shape does not fit, an entry is not finite, or D_θ is not positive definite.
    """
    scaled = scaled_stiffness(F, D_theta)
    problem, slack = stacked_problem([scaled])
    pointwise = bracket(scaled.A, scaled.A_error, tolerance=1e-6).delay
    return _common(problem, slack, np.broadcast_to(pointwise, len(problem.J)), tolerance, solver)


def stacked_problem(tasks: Sequence[ScaledTask]) -> tuple[MultiplierProblem, float]:
    """Put tasks side by side, and bound what rounding in them does to 1/d.

    Args:
        tasks: scaled tasks of one batch.

    Raises:
        InputError: there is no task, their batches do not fit, or have more than one dimension.
    """
    if not tasks:
        raise InputError("At least one task is needed.")
    try:
        batch = np.broadcast_shapes(*(task.A.shape[:-2] for task in tasks))
    except ValueError:
        shapes = ", ".join(str(task.A.shape[:-2]) for task in tasks)
        raise InputError(f"The tasks' batches do not fit together: {shapes}.") from None
    if len(batch) > 1 or 0 in batch or len({task.A.shape[-1] for task in tasks}) > 1:
        raise InputError(f"A motion has one axis of instants and one set of joints, not {batch}.")
    count = batch[0] if batch else 1
    J = [np.broadcast_to(task.J, (count, *task.J.shape[-2:])) for task in tasks]
    M = [np.broadcast_to(task.M, (count, *task.M.shape[-2:])) for task in tasks]
    slack = sum(
        float(np.linalg.norm(part, axis=(1, 2)).max() * np.max(task.M_error))
        for part, task in zip(J, tasks, strict=True)
    )
    blocks = tuple(part.shape[1] for part in J)
    stacked = MultiplierProblem(
        J=np.concatenate(J, axis=1), M=np.concatenate(M, axis=2), blocks=blocks
    )
    return stacked, slack


def _together(problem: MultiplierProblem) -> DelayBound:
    """1 / w(Σ A_i) at each instant, which no multiplier exceeds."""
    _, m, n = problem.J.shape
    sizes = np.linalg.norm(problem.J, axis=(1, 2)) * np.linalg.norm(problem.M, axis=(1, 2))
    return bracket(problem.M @ problem.J, 4.0 * (m + n) * EPS * sizes, tolerance=1e-6)


def _common(
    problem: MultiplierProblem,
    slack: float,
    pointwise: Array,
    tolerance: float,
    solver: Solver | None,
) -> CommonBound:
    if not 1e-9 <= tolerance <= 0.1:
        raise InputError(f"tolerance is {tolerance:g}; it must lie in 1e-9 … 0.1.")
    chosen = solver if solver is not None else ClarabelDirect()
    found = search(problem, pointwise, tolerance=tolerance, solver=chosen)
    proven = float(proven_delays(problem, found.factor).min())
    upper = min(found.upper, float(_together(problem).upper.min()))
    closed = upper <= proven * (1.0 + tolerance) or np.isinf(proven)
    delay = float(lessened(proven, slack))
    return CommonBound(
        delay=delay,
        upper=float(lessened(upper, -slack)),
        W=None if found.factor is None else found.factor.C @ found.factor.C.T,
        pointwise=np.array(pointwise),
        binding=found.binding,
        rounds=found.rounds,
        closed=bool(closed),
        reason="" if closed else f"{chosen.name} left the bracket open: {found.status}",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Where constraint generation ended.

    Attributes:
        factor: of the best multiplier; None if there was none.
        delay: s; that it proves at every instant, to rounding.
        upper: s; smallest delay that was refuted.
        binding: instants that the solver was given.
        rounds: how often it was called.
        status: its last words.
    """

    factor: Factor | None
    delay: float
    upper: float
    binding: tuple[int, ...]
    rounds: int
    status: str


def search(
    problem: MultiplierProblem, pointwise: Array, *, tolerance: float, solver: Solver
) -> Search:
    """Find one multiplier for all instants by giving the solver ever more of them.

    Args:
        problem: all instants.
        pointwise: (N,) s, each instant's own bound, from which the first are chosen.
        tolerance: relative distance of the two ends at which to stop.
        solver: where candidates come from.
    """
    count, m, _ = problem.J.shape
    if not problem.M.any():
        small = np.eye(m) / (1.0 + float(np.linalg.norm(problem.J, axis=(1, 2)).max()) ** 2)
        factor = factorise(problem, small)
        return Search(
            factor=factor, delay=np.inf, upper=np.inf, binding=(), rounds=0, status="no stiffness"
        )
    spread = np.linspace(0, count - 1, min(count, _FIRST)).astype(int)
    active = np.unique(np.concatenate([spread, _worst(pointwise, np.inf)]))
    best, best_delay, upper, status, rounds = None, 0.0, np.inf, "", 0
    while rounds < _ROUNDS:
        rounds += 1
        part = problem.at(active)
        solution = solver.solve(part)
        status = solution.status
        upper = min(upper, refuted_delay(part, solution.P))
        factor = factorise(problem, solution.W)
        if factor is None:
            break
        delays = estimated_delays(problem, factor)
        if delays.min() > best_delay:
            best, best_delay = factor, float(delays.min())
        if upper <= best_delay * (1.0 + 0.25 * tolerance) or np.isinf(best_delay):
            break
        fresh = np.setdiff1d(_worst(delays, upper * (1.0 - 0.1 * tolerance)), active)
        if not len(fresh):
            break
        active = np.union1d(active, fresh)
    return Search(
        factor=best,
        delay=best_delay,
        upper=upper,
        binding=tuple(int(k) for k in active),
        rounds=rounds,
        status=status,
    )


def _worst(delays: Array, limit: float) -> Array:
    """Some instants below a limit: the lowest of all, and the lowest local minima along time."""
    left = np.concatenate([[np.inf], delays[:-1]])
    right = np.concatenate([delays[1:], [np.inf]])
    minima = np.flatnonzero((delays <= left) & (delays <= right) & (delays < limit))
    return minima[np.argsort(delays[minima], kind="stable")][:_ADDED]
