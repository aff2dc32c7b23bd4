"""Multipliers that prove a delay: the maximal solution of Y + d² F Y⁻¹ Fᵀ = 2D."""

import numpy as np

from sealag.errors import SolverError
from sealag.passivity._bounds import inverse_root
from sealag.passivity._multitask import proves
from sealag.typing import Array, ArrayLike


def joint_multiplier(F: ArrayLike, D_theta: ArrayLike, delay: float) -> Array:
    """Compute Y ≻ 0 with [[2D − Y, dF], [dFᵀ, Y]] ⪰ 0 for a delay below the supremum.

    Where D = I, every Y lies between the maximal solution of Y + d² F Y⁻¹ Fᵀ = 2I and 2I less the
    maximal solution of V + d² Fᵀ V⁻¹ F = 2I; their mean leaves room for rounding. Both come from
    cyclic reduction (Meini, Math. Comp. 2002), which converges quadratically, and exist if and
    only if d ≤ 1 / w(D^-½ F D^-½). Y belongs to the multiplier Q = Y / d of (29) for J* = I.

    Args:
        F: (n, n) delayed stiffness, Nm/rad.
        D_theta: (n,) motor damping, Nms/rad.
        delay: d, s; below the supremum.

    Returns:
        (n, n) symmetric Y, checked to satisfy the inequality with room for rounding.

    Raises:
        SolverError: the delay is not below the supremum, or too close to it.
    """
    stiffness = np.asarray(F, dtype=float)
    root, _ = inverse_root(D_theta, len(stiffness))
    A = delay * (root @ stiffness @ root.T)
    largest, smallest = _maximal(A.T), 2.0 * np.eye(len(A)) - _maximal(A)
    middle = (largest + smallest) / 2.0
    if not np.isfinite(middle).all() or not proves([A], [middle]):
        raise SolverError(f"No multiplier proves the delay {delay:.6g} s: it is at the supremum.")
    back = np.linalg.inv(root)
    scaled = back @ middle @ back.T
    return (scaled + scaled.T) / 2.0


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
