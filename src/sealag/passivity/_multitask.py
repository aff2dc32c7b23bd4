"""Corollary 1 (31): several tasks with one delay."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.passivity._bounds import (
    DelayBound,
    checked_task,
    inverse_root,
    max_delay,
    max_delay_from_stiffness,
    task_stiffness,
)
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm


@dataclass(frozen=True, slots=True, kw_only=True)
class MultitaskBound:
    """A guaranteed bracket of the largest delay of Corollary 1.

    Attributes:
        delay: (…) s, never above the supremum.
        upper: (…) s, never below it.
        attained: (…) whether the upper end was proven to be the supremum, to the tolerance, by a
            verified multiplier.
        method: how the lower end was proven.
    """

    delay: Array
    upper: Array
    attained: Array
    method: str


def max_delay_multitask(
    tasks: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    tolerance: float = 1e-6,
    solve: bool = True,
) -> MultitaskBound:
    """Largest delay of Corollary 1 (31) for tasks (J*_i, Λ_i, K_x,i).

    1 / Σ w(A_i) ≤ d ≤ 1 / w(Σ A_i) with A_i = D^-½ J*_iᵀ S_i J*_i D^-½. Where every A_i is
    symmetric positive semidefinite the upper end is the supremum (Z_i = d A_i proves it).
    Elsewhere the block inequality is solved as an SDP and its answer verified by eigenvalues, so
    that a solver can cost tightness but not truth.

    Args:
        tasks: (…, m_i, n), (…, m_i, m_i) and (m_i,) or (…, m_i, m_i) of each task.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        form: symmetric, published or force stiffness.
        tolerance: relative width of bracket at which nothing more is tried.
        solve: whether open brackets are closed by an SDP; without it the lower end is 1/Σw.

    Returns:
        The bracket, of the common batch shape.

    Raises:
        InputError: there is no task, or one has an unusable array.
    """
    if not tasks:
        raise InputError("Corollary 1 needs at least one task.")
    bounds = [max_delay(*task, D_theta, form=form, tolerance=tolerance) for task in tasks]
    parts = [_joint_stiffness(*task, form=form) for task in tasks]
    whole = max_delay_from_stiffness(sum(parts), D_theta, tolerance=tolerance)
    with np.errstate(divide="ignore"):
        split = (1.0 - 1e-15 * len(tasks)) / sum(1.0 / bound.delay for bound in bounds)
    upper = whole.upper
    if StiffnessForm(form) is not StiffnessForm.PUBLISHED:
        # Each A_i is symmetric PSD by construction: the supremum is 1 / w(Σ A_i).
        return MultitaskBound(
            delay=np.maximum(split, _shared(whole, bounds)),
            upper=upper,
            attained=np.ones(np.shape(upper), dtype=bool),
            method="symmetric positive semidefinite tasks",
        )
    open_ = np.atleast_1d(upper / split - 1.0 > tolerance)
    delay = np.atleast_1d(np.array(split))
    if solve and open_.any():
        root, _ = inverse_root(D_theta, np.shape(parts[0])[-1])
        n = len(root)
        scaled = [(root @ F @ np.swapaxes(root, -1, -2)).reshape(-1, n, n) for F in parts]
        flat = delay.reshape(-1)
        limit = np.atleast_1d(upper).reshape(-1)
        for k in np.flatnonzero(open_.reshape(-1)):
            blocks = [F[k % len(F)] for F in scaled]
            flat[k] = max(flat[k], verified_delay(blocks, guess=limit[k]))
    delay = delay.reshape(np.shape(upper))
    return MultitaskBound(
        delay=delay,
        upper=upper,
        attained=upper / delay - 1.0 <= 10.0 * tolerance,
        method="verified SDP where 1/Σw and 1/w(Σ) differ" if solve else "1/Σw",
    )


def _shared(whole: DelayBound, bounds: Sequence[DelayBound]) -> Array:
    """1 / w(Σ A_i) lessened by the tasks' own uncertainty: Λ^½ is known only to rounding."""
    slack = sum((bound.upper - bound.delay) / bound.upper / bound.delay for bound in bounds)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.isinf(whole.delay), whole.delay, 1.0 / (1.0 / whole.delay + slack))


def _joint_stiffness(
    J_star: ArrayLike, Lambda: ArrayLike, K_x: ArrayLike, *, form: StiffnessForm | str
) -> Array:
    J, inertia, gain, kind = checked_task(J_star, Lambda, K_x, form=form)
    S, _ = task_stiffness(inertia, gain, form=kind)
    return np.swapaxes(J, -1, -2) @ S @ J


def verified_delay(blocks: Sequence[Array], *, guess: float) -> float:
    """A delay proven by multipliers from an SDP: sup d with (31) for scaled tasks A_i.

    In joint coordinates (31) is [[2I − Σ Y_i, d A_i …], [⋆, Y_i]] ⪰ 0 with one Y_i a task. The
    solver's Y_i are taken as a candidate only: the delay returned is the largest for which the
    block matrix, with its multipliers pushed inside, has no negative eigenvalue beyond rounding.

    Args:
        blocks: (n, n) each, D^-½ F_i D^-½.
        guess: a delay near the supremum, s, for scaling.

    Returns:
        A proven delay, 0 if the solver's candidate proves none.
    """
    Y = _candidate([guess * A for A in blocks])
    if Y is None:
        return 0.0
    low, high = 0.0, 1.0 + 1e-9
    for _ in range(60):
        middle = 0.5 * (low + high)
        if proves([middle * guess * A for A in blocks], Y):
            low = middle
        else:
            high = middle
    return low * guess


def proves(blocks: Sequence[Array], Y: Sequence[Array]) -> bool:
    """Whether multipliers prove the block inequality, with a margin for rounding.

    Args:
        blocks: (n, n) d A_i each.
        Y: (n, n) symmetric multipliers.

    Returns:
        True only if [[2I − ΣY_i, dA_i …], [⋆, diag(Y_i)]] is positive semidefinite for sure.
    """
    n, count = len(blocks[0]), len(blocks)
    matrix = np.zeros(((count + 1) * n, (count + 1) * n))
    matrix[:n, :n] = 2.0 * np.eye(n) - sum(Y)
    for i, (A, block) in enumerate(zip(blocks, Y, strict=True), start=1):
        rows = slice(i * n, (i + 1) * n)
        matrix[rows, rows] = block
        matrix[:n, rows] = A
        matrix[rows, :n] = A.T
    lowest = float(np.linalg.eigvalsh((matrix + matrix.T) / 2.0)[0])
    return lowest > 8.0 * len(matrix) * np.finfo(float).eps * float(np.linalg.norm(matrix))


def _candidate(blocks: Sequence[Array]) -> list[Array] | None:
    """Multipliers of a slightly smaller problem, from Clarabel; None if it gives none."""
    import cvxpy as cp

    n = len(blocks[0])
    Y = [cp.Variable((n, n), symmetric=True) for _ in blocks]
    d = cp.Variable()
    rows = [[2 * np.eye(n) - sum(Y), *(d * A for A in blocks)]]
    for i, A in enumerate(blocks):
        row = [d * A.T] + [Y[j] if j == i else np.zeros((n, n)) for j in range(len(blocks))]
        rows.append(row)
    matrix = cp.bmat(rows)
    problem = cp.Problem(cp.Maximize(d), [(matrix + matrix.T) / 2 >> 0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # whatever the solver says of itself is checked here
            problem.solve(solver=cp.CLARABEL)
    except (cp.SolverError, ValueError):
        return None
    found = [np.asarray(block.value, dtype=float) for block in Y]
    if not all(block.shape == (n, n) and np.isfinite(block).all() for block in found):
        return None
    inside = 1e-8 * np.eye(n)
    return [(1.0 - 1e-7) * (block + block.T) / 2.0 + inside for block in found]
