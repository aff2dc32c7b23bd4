"""Multipliers that prove a delay: the maximal solution of Y + d² F Y⁻¹ Fᵀ = 2D."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.passivity._problem import MultiplierProblem, factorise, proven_delays
from sealag.passivity._scaling import inverse_root, scaled_task
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskMultiplier:
    """A multiplier of Theorem 1 in task coordinates, checked.

    Attributes:
        delay: d that it proves, s.
        W: (m, m) symmetric positive definite, W = d Q.
        Q: (m, m) the multiplier of (29) and of the storage function V_4.
    """

    delay: float
    W: Array
    Q: Array


def joint_multiplier(F: ArrayLike, D_theta: ArrayLike, delay: float) -> Array:
    """Compute Y ≻ 0 with [[2D − Y, dF], [dFᵀ, Y]] ⪰ 0 for a delay below the supremum.

    Where D = I, every Y lies between the maximal solution of Y + d² F Y⁻¹ Fᵀ = 2I and 2I less the
    maximal solution of V + d² Fᵀ V⁻¹ F = 2I; their mean leaves room for rounding. Both come from
    cyclic reduction (Meini, Math. Comp. 2002), which converges quadratically, and exist if and
    only if d ≤ 1 / w(D^-½ F D^-½). For J* = I the multiplier of (29) is Q = Y / d.

    Args:
        F: (n, n) delayed stiffness, Nm/rad.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        delay: d, s; below the supremum.

    Returns:
        (n, n) symmetric Y, checked to satisfy the inequality with room for rounding.

    Raises:
        SolverError: the delay is not below the supremum, or too close to it.
    """
    stiffness = np.asarray(F, dtype=float)
    root, _ = inverse_root(D_theta, len(stiffness))
    A = delay * (root @ stiffness @ root.T)
    identity = np.eye(len(A))
    middle = _middle(A)
    problem = MultiplierProblem(J=identity[None], M=A[None], blocks=(len(A),))
    if proven_delays(problem, factorise(problem, middle))[0] < 1.0:
        raise SolverError(f"No multiplier proves the delay {delay:.6g} s: it is at the supremum.")
    back = np.linalg.inv(root)
    scaled = back @ middle @ back.T
    return (scaled + scaled.T) / 2.0


def task_multiplier(
    J_star: ArrayLike,
    Lambda: ArrayLike,
    K_x: ArrayLike,
    D_theta: ArrayLike,
    *,
    delay: float,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
) -> TaskMultiplier:
    """Compute W = dQ ≻ 0 with which (29) holds, at one instant, for a delay below the supremum.

    W⁻¹ = J* Y⁻¹ J*ᵀ + εI from the multiplier Y in joint coordinates, ε as large as the room that Y
    leaves. It exists for any m, n and rank of J*: where J* loses rank, W grows as d nears the
    supremum, which is then not attained.

    Args:
        J_star: (m, n) contact-consistent Jacobian J*.
        Lambda: (m, m) task inertia.
        K_x: (m,) or (m, m) task gains.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        delay: d, s; below the supremum.
        form: symmetric, published or force stiffness.

    Returns:
        The multiplier, checked to satisfy the inequality with room for rounding.

    Raises:
        InputError: an array is unusable, or a batch.
        SolverError: the delay is not below the supremum, or too close to it.
    """
    task = scaled_task(J_star, Lambda, K_x, D_theta, form=form)
    if task.J.ndim != 2 or task.M.ndim != 2:
        raise InputError("A task multiplier belongs to one instant; loop over a batch.")
    if not (np.isfinite(delay) and delay > 0.0):
        raise InputError(f"delay is {delay:g} s; a positive finite time is needed.")
    W = closed_form_multiplier(task.J, task.M, delay)
    problem = MultiplierProblem(J=task.J[None], M=task.M[None], blocks=(len(task.J),))
    if proven_delays(problem, factorise(problem, W))[0] < delay or W is None:
        raise SolverError(f"No multiplier proves the delay {delay:.6g} s: it is at the supremum.")
    return TaskMultiplier(delay=delay, W=W, Q=W / delay)


def closed_form_multiplier(J: Array, M: Array, delay: float) -> Array | None:
    """W for one instant in coordinates scaled by D_θ^-½; None where no room is left.

    Args:
        J: (m, n) scaled Jacobian.
        M: (n, m) scaled Jᵀ S.
        delay: d, s.
    """
    A = delay * (M @ J)
    Y = _middle(A)
    if not np.isfinite(Y).all():
        return None
    values, vectors = np.linalg.eigh(Y)
    if not values[0] > 0.0:
        return None
    half = (vectors / np.sqrt(values)).T
    room = 2.0 * np.eye(len(Y)) - Y - (A @ half.T) @ (A @ half.T).T
    lowest = float(np.linalg.eigvalsh(room)[0])
    if not lowest > 0.0:
        return None
    load = float(np.linalg.norm(delay * M)) ** 2
    epsilon = 0.25 * lowest / load if load > 0.0 else 1.0
    wide = J @ half.T
    sides, sizes, _ = np.linalg.svd(wide, full_matrices=True)
    squares = np.zeros(len(J))
    squares[: len(sizes)] = sizes**2
    return (sides / (squares + epsilon)) @ sides.T


def _middle(A: Array) -> Array:
    """Mean of the largest and the smallest Y with [[2I − Y, A], [Aᵀ, Y]] ⪰ 0."""
    return (_maximal(A.T) + 2.0 * np.eye(len(A)) - _maximal(A)) / 2.0


def _maximal(A: Array) -> Array:
    """Maximal solution X of X + Aᵀ X⁻¹ A = 2I; not finite or no solution where there is none."""
    X = rest = 2.0 * np.eye(len(A))
    for _ in range(60):
        try:
            left, right = np.linalg.solve(rest, A), np.linalg.solve(rest, A.T)
        except np.linalg.LinAlgError:
            break
        change = A.T @ left
        X, rest, A = X - change, rest - change - A @ right, A @ left
        if not np.isfinite(X).all() or np.linalg.norm(change) <= 1e-17 * np.linalg.norm(X):
            break
    return (X + X.T) / 2.0
