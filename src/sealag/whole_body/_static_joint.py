"""The static joint state q̄(θ), Eqs. (15), (16)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sealag.errors import ContractionError, InputError
from sealag.typing import Array, ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticJointState:
    """Joint angles at which springs and static torques balance.

    Attributes:
        q_joint: (n,) q̄, rad.
        contraction: estimated factor by which each iteration shrinks the error, below 1.
        iterations: how many were needed.
    """

    q_joint: Array
    contraction: float
    iterations: int


def static_joint_state(
    theta: ArrayLike,
    torque: Callable[[Array], Array],
    spring_stiffness: ArrayLike,
    *,
    tolerance: float = 1e-12,
    max_iterations: int = 500,
) -> StaticJointState:
    """Solve θ = q̄ + K⁻¹ l(q̄) for q̄ by the iteration q̄ ← θ − K⁻¹ l(q̄).

    It converges to the only solution while ‖K⁻¹ ∂l/∂q‖ < 1 (sufficient).

    Args:
        theta: (n,) motor angles, rad.
        torque: l(q̄) = J*ᵀ S x̃(q̄) + ḡ(q̄), (n,) Nm.
        spring_stiffness: (n,) K, Nm/rad.
        tolerance: largest change of the last iteration, rad.
        max_iterations: how many are allowed.

    Returns:
        q̄ with its contraction factor.

    Raises:
        ContractionError: the iteration does not contract: the springs are softer than the task.
        InputError: θ or K are not finite, or K is not positive.
    """
    theta = np.asarray(theta, dtype=float)
    K = np.asarray(spring_stiffness, dtype=float)
    if not np.isfinite(theta).all() or not np.isfinite(K).all() or not (K > 0.0).all():
        raise InputError("Motor angles must be finite and spring stiffnesses finite and positive.")
    q = theta.copy()
    change, factor = np.inf, 0.0
    for iteration in range(1, max_iterations + 1):
        new = theta - torque(q) / K
        step = float(np.linalg.norm((new - q) * np.sqrt(K)))
        if np.isfinite(change) and change > 1e3 * tolerance:
            factor = max(factor, step / change)
        q, change = new, step
        if not np.isfinite(step) or (iteration > 20 and factor >= 1.0 and step > 1e3 * tolerance):
            break
        if step <= tolerance * np.sqrt(K.max()):
            return StaticJointState(q_joint=q, contraction=factor, iterations=iteration)
    raise ContractionError(
        f"The static joint state does not exist or is not unique here: its iteration grows by "
        f"{factor:.2f} a step; use stiffer springs or a softer task."
    )
