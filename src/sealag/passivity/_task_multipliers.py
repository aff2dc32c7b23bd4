"""Multipliers of Corollary 1 (31) in task coordinates."""

from collections.abc import Sequence

import numpy as np

from sealag.errors import SolverError
from sealag.passivity._bounds import max_delay
from sealag.passivity._multipliers import TaskMultiplier, task_multiplier
from sealag.passivity._problem import MultiplierProblem, factorise
from sealag.passivity._scaling import inverse_root, scaled_task
from sealag.passivity._solvers import ClarabelDirect, Solver
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

_LEAST = 1e-9
"""Share of the damping that even a task without stiffness gets."""


def task_multipliers(
    tasks: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    D_theta: ArrayLike,
    *,
    delay: float,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    solver: Solver | None = None,
) -> tuple[TaskMultiplier, ...]:
    """Compute W_i = d Q_i ≻ 0 with which (31) holds, at one instant, for a delay below its bound.

    The damping is divided among the tasks, D_θ = Σ D_i, so that (29) holds for task i with D_i; the
    sum of these is (31). D_i ∝ w(A_i) does for delays up to 1/Σ w(A_i). Beyond, a solver proposes
    multipliers Y_i in joint coordinates, and D_i = ½ (Y_i + d² F_i Y_i⁻¹ F_iᵀ) with what is left
    shared equally.

    Args:
        tasks: (m_i, n), (m_i, m_i) and (m_i,) or (m_i, m_i) of each task.
        D_theta: (n,) motor damping, Nms/rad.
        delay: d, s; below the supremum.
        form: symmetric, published or force stiffness.
        solver: where multipliers come from; Clarabel's own interface if None.

    Returns:
        One multiplier a task, each checked with its part of the damping.

    Raises:
        InputError: an array is unusable, or a batch.
        SolverError: the delay is not below the supremum, or too close to it, or the solver found
            nothing that proves it.
    """
    D = np.diag(np.asarray(D_theta, dtype=float))
    with np.errstate(divide="ignore"):
        loads = np.array(
            [1.0 / float(max_delay(*task, D_theta, form=form).delay) for task in tasks]
        )
    if len(tasks) == 1:
        parts = [D]
    elif delay * loads.sum() <= 1.0 - 2.0 * _LEAST * len(tasks):
        shares = loads / max(loads.sum(), 1e-300) + _LEAST
        parts = [share * D for share in shares / shares.sum()]
    else:
        parts = _solved(tasks, D_theta, delay, form, solver or ClarabelDirect())
    return tuple(
        task_multiplier(*task, part, delay=delay, form=form)
        for task, part in zip(tasks, parts, strict=True)
    )


def _solved(
    tasks: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    D_theta: ArrayLike,
    delay: float,
    form: StiffnessForm | str,
    solver: Solver,
) -> list[Array]:
    """Parts of the damping from a solver's multipliers in joint coordinates."""
    stiffness = [scaled_task(*task, D_theta, form=form).A for task in tasks]
    n, count = stiffness[0].shape[-1], len(stiffness)
    problem = MultiplierProblem(
        J=np.tile(np.eye(n), (count, 1))[None],
        M=np.concatenate(stiffness, axis=-1)[None],
        blocks=(n,) * count,
    )
    solution = solver.solve(problem)
    W = solution.W
    if W is None or factorise(problem, W) is None:
        raise SolverError(
            f"{solver.name} found no multipliers for the delay {delay:.6g} s: {solution.status}."
        )
    needs = [
        (W[at, at] + delay**2 * A @ np.linalg.solve(W[at, at], A.T)) / 2.0
        for A, at in zip(stiffness, problem.slices(), strict=True)
    ]
    rest = (np.eye(n) - sum(needs)) / count
    if not np.linalg.eigvalsh(rest)[0] > 0.0:
        raise SolverError(
            f"{solver.name}'s multipliers do not prove the delay {delay:.6g} s: {solution.status}."
        )
    back = np.linalg.inv(inverse_root(D_theta, n)[0])
    parts = [back @ (need + rest) @ back.T for need in needs]
    return [(part + part.T) / 2.0 for part in parts]
