"""Corollary 1 (31): several tasks with one delay."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.passivity._bounds import bracket
from sealag.passivity._problem import (
    MultiplierProblem,
    factorise,
    lessened,
    proven_delays,
    refuted_delay,
)
from sealag.passivity._scaling import EPS, scaled_task
from sealag.passivity._solvers import ClarabelDirect, Solver
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm


@dataclass(frozen=True, slots=True, kw_only=True)
class MultitaskBound:
    """A guaranteed bracket of the largest delay of Corollary 1.

    Attributes:
        delay: (…) s, never above the supremum.
        upper: (…) s, never below it.
        closed: (…) whether the two agree to the tolerance.
        method: how the lower end was proven.
        reason: why some bracket is open, in words; empty if none is.
    """

    delay: Array
    upper: Array
    closed: Array
    method: str
    reason: str


def max_delay_multitask(
    tasks: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    tolerance: float = 1e-6,
    solve: bool = True,
    solver: Solver | None = None,
) -> MultitaskBound:
    """Largest delay of Corollary 1 (31) for tasks (J*_i, Λ_i, K_x,i).

    1 / Σ w(A_i) ≤ d ≤ 1 / w(Σ A_i) with A_i = D^-½ J*_iᵀ S_i J*_i D^-½. Where every A_i is
    symmetric positive semidefinite the upper end is the supremum (Y_i = d A_i proves it).
    Elsewhere a solver proposes multipliers for open brackets: primal ones that pass an eigenvalue
    check raise the lower end, dual ones lower the upper end, and nothing else is believed.

    Args:
        tasks: (…, m_i, n), (…, m_i, m_i) and (m_i,) or (…, m_i, m_i) of each task.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        form: symmetric, published or force stiffness.
        tolerance: relative width of bracket at which nothing more is tried.
        solve: whether open brackets are given to the solver; without it the lower end is 1/Σw.
        solver: where multipliers come from; Clarabel's own interface if None, a few ms an instant.

    Returns:
        The bracket, of the common batch shape.

    Raises:
        InputError: there is no task, or one has an unusable array.
    """
    if not tasks:
        raise InputError("Corollary 1 needs at least one task.")
    scaled = [scaled_task(*task, D_theta, form=form) for task in tasks]
    try:
        parts = np.broadcast_arrays(*(task.A for task in scaled))
    except ValueError:
        shapes = ", ".join(str(task.A.shape[:-1]) for task in scaled)
        raise InputError(f"The tasks' batches or joints do not fit together: {shapes}.") from None
    sizes = _sum([np.linalg.norm(A, axis=(-2, -1)) for A in parts])
    error = _sum([task.A_error for task in scaled]) + len(parts) * EPS * sizes
    whole = bracket(_sum(parts), error, tolerance=tolerance)
    if StiffnessForm(form) is not StiffnessForm.PUBLISHED:
        # Each A_i is PSD; what gains within rounding of PSD leave negative is taken off.
        lowest = _sum([np.minimum(np.linalg.eigvalsh(A)[..., 0], 0.0) for A in parts])
        delay = lessened(whole.delay, -2.0 * lowest)
        method = "symmetric positive semidefinite tasks"
        return _bound(delay, whole.upper, tolerance=tolerance, method=method, reason="")
    each = [bracket(task.A, task.A_error, tolerance=tolerance).delay for task in scaled]
    with np.errstate(divide="ignore"):
        split = (1.0 - 4.0 * len(parts) * EPS) / _sum([1.0 / delay for delay in each])
    if not solve:
        return _bound(
            split, whole.upper, tolerance=tolerance, method="1/Σw", reason="no solver was asked"
        )
    chosen = solver if solver is not None else ClarabelDirect()
    delay, upper, reason = _close(parts, error, split, whole.upper, tolerance, chosen)
    method = f"1/Σw, and multipliers by {chosen.name} where it differs from 1/w(Σ)"
    return _bound(delay, upper, tolerance=tolerance, method=method, reason=reason)


def _close(
    parts: Sequence[Array],
    error: Array,
    low: Array,
    high: Array,
    tolerance: float,
    solver: Solver,
) -> tuple[Array, Array, str]:
    """Move both ends of open brackets as far as measured multipliers allow."""
    n, count = parts[0].shape[-1], len(parts)
    M = np.concatenate(parts, axis=-1).reshape(-1, n, count * n)
    J = np.tile(np.eye(n), (count, 1))[None]
    shape = np.shape(high)
    delay, upper = np.array(low).reshape(-1), np.array(high).reshape(-1)
    slack = np.broadcast_to(error, shape).reshape(-1)
    reason = ""
    for k in np.flatnonzero(upper > delay * (1.0 + tolerance)):
        problem = MultiplierProblem(J=J, M=M[k : k + 1], blocks=(n,) * count)
        solution = solver.solve(problem)
        proven = proven_delays(problem, factorise(problem, solution.W))[0]
        refuted = refuted_delay(problem, solution.P)
        delay[k] = max(delay[k], lessened(proven, slack[k]))
        upper[k] = min(upper[k], lessened(refuted, -slack[k]))
        if upper[k] > delay[k] * (1.0 + tolerance):
            reason = f"{solver.name} proved too little: {solution.status}"
    return delay.reshape(shape), upper.reshape(shape), reason


def _sum(arrays: Sequence[Array]) -> Array:
    return np.asarray(sum(np.broadcast_arrays(*arrays)))


def _bound(
    delay: Array, upper: Array, *, tolerance: float, method: str, reason: str
) -> MultitaskBound:
    delay, upper = np.asarray(delay), np.asarray(upper)
    with np.errstate(invalid="ignore"):
        closed = np.isinf(delay) | (upper <= delay * (1.0 + tolerance))
    open_ = "" if closed.all() else reason or "the arrays' own rounding leaves the bracket open"
    return MultitaskBound(delay=delay, upper=upper, closed=closed, method=method, reason=open_)
