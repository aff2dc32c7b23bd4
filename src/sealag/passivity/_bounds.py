"""Theorem 1 in closed form: the largest delay as one over a numerical radius."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.passivity._scaling import EPS, inverse_root, scaled_stiffness, scaled_task
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayBound:
    """A guaranteed bracket of the largest delay, for one instant or a batch.

    Attributes:
        delay: (…) s, never above the supremum of Theorem 1; inf for zero stiffness.
        upper: (…) s, never below it.
        angle: (…) φ at which the numerical radius is reached, rad; 0 for symmetric stiffness.
        scaled: (…, n, n) D^-½ F D^-½, 1/s, from which all of this follows.
    """

    delay: Array
    upper: Array
    angle: Array
    scaled: Array

    @property
    def width(self) -> Array:
        """Relative width of the bracket, (…)."""
        with np.errstate(invalid="ignore"):
            return np.where(np.isinf(self.delay), 0.0, self.upper / self.delay - 1.0)

    @property
    def direction(self) -> Array:
        """Share of each joint in the motion that first turns the delayed loop active, (…, n)."""
        return _shares(self.scaled, self.angle)


def max_delay(
    J_star: ArrayLike,
    Lambda: ArrayLike,
    K_x: ArrayLike,
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    tolerance: float = 1e-6,
) -> DelayBound:
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
    task = scaled_task(J_star, Lambda, K_x, D_theta, form=form)
    return bracket(task.A, task.A_error, tolerance=tolerance)


def max_delay_from_stiffness(
    F: ArrayLike, D_theta: ArrayLike, *, tolerance: float = 1e-6
) -> DelayBound:
    """Largest delay for a delayed motor-side stiffness F, d = 1 / w(D^-½ F D^-½).

    The certified criterion of docs/theory section 6 when F = −∂τ_osc/∂θ is the whole stiffness of
    the law that is run and is symmetric.

    Args:
        F: (…, n, n) Nm/rad.
        D_theta: (n,) or (…, n, n) motor damping, symmetric positive definite, Nms/rad.
        tolerance: relative width of the bracket at which refinement stops.

    Returns:
        The bracket, of F's batch shape.

    Raises:
        InputError: a shape does not fit, an entry is not finite, or D_θ is not positive definite.
    """
    scaled = scaled_stiffness(F, D_theta)
    return bracket(scaled.A, scaled.A_error, tolerance=tolerance)


def limiting_direction(F: ArrayLike, D_theta: ArrayLike, angle: ArrayLike) -> Array:
    """Share of each joint in the motion that first turns the delayed loop active.

    The direction is the eigenvector of λ_max(cos φ S + i sin φ T) at the maximising φ; a joint's
    share is its part of that motion's damping power θ̇ᵀ D_θ θ̇.

    Args:
        F: (…, n, n) delayed stiffness, Nm/rad.
        D_theta: (n,) or (…, n, n) motor damping, Nms/rad.
        angle: (…) φ from a `DelayBound`.

    Returns:
        (…, n) shares that sum to 1.
    """
    stiffness = np.asarray(F, dtype=float)
    root, _ = inverse_root(D_theta, stiffness.shape[-1])
    return _shares(root @ stiffness @ np.swapaxes(root, -1, -2), np.asarray(angle))


def _shares(A: Array, angle: Array) -> Array:
    A_t = np.swapaxes(A, -1, -2)
    phi = angle[..., None, None]
    H = np.cos(phi) * (A + A_t) / 2.0 + 0.5j * np.sin(phi) * (A - A_t)
    return np.square(np.abs(np.linalg.eigh(H)[1][..., -1]), dtype=np.float64)


def bracket(A: Array, slack: Array, *, tolerance: float) -> DelayBound:
    """Turn scaled stiffnesses and their norm-wise uncertainty into delays.

    Args:
        A: (…, n, n) D^-½ F D^-½, 1/s.
        slack: (…) uncertainty of A.
        tolerance: relative width at which refinement stops.

    Raises:
        InputError: A is not finite, or the tolerance is out of range.
    """
    from sealag.kernels.numerical_radius import numerical_radii

    if not 1e-12 <= tolerance <= 0.1:
        raise InputError(f"tolerance is {tolerance:g}; it must lie in 1e-12 … 0.1.")
    if not np.isfinite(A).all():
        raise InputError("The scaled stiffness overflows; check the units of K_x and D_theta.")
    shape, n = A.shape[:-2], A.shape[-1]
    flat = np.ascontiguousarray(A).reshape(-1, n, n)
    spread = np.ascontiguousarray(np.broadcast_to(slack, shape)).reshape(-1)
    lower, upper, angle = (np.empty(len(flat)) for _ in range(3))
    numerical_radii(flat, spread, 0.5 * tolerance, lower, upper, angle)
    with np.errstate(divide="ignore"):
        delay = (1.0 - 4.0 * EPS) / upper
        longest = (1.0 + 4.0 * EPS) / lower
    return DelayBound(
        delay=delay.reshape(shape),
        upper=longest.reshape(shape),
        angle=angle.reshape(shape),
        scaled=A,
    )
