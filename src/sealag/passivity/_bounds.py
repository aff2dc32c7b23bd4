"""Theorem 1 in closed form: the largest delay as one over a numerical radius."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

EPS = float(np.finfo(float).eps)
_NEGATIVE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayBound:
    """A guaranteed bracket of the largest delay, for one instant or a batch.

    Attributes:
        delay: (…) s, never above the supremum of Theorem 1; inf for zero stiffness.
        upper: (…) s, never below it.
        angle: (…) φ at which the numerical radius is reached, rad; 0 for symmetric stiffness.
    """

    delay: Array
    upper: Array
    angle: Array

    @property
    def width(self) -> Array:
        """Relative width of the bracket, (…)."""
        with np.errstate(invalid="ignore"):
            return np.where(np.isinf(self.delay), 0.0, self.upper / self.delay - 1.0)


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
    and rank of J* (Ando's theorem; THEORY section 5). With `form="published"`, S = Λ K_x and this
    is the criterion as printed; it is sufficient for a passive loop only where S is symmetric
    and x(θ) is what is fed back (THEORY section 6).

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
    J, inertia, gain, form = checked_task(J_star, Lambda, K_x, form=form)
    scaled, root_error = _scaled_jacobian(J, D_theta)
    S, S_error = task_stiffness(inertia, gain, form=form)
    A = np.swapaxes(scaled, -1, -2) @ S @ scaled
    size2 = np.sum(scaled**2, axis=(-2, -1))
    m, n = J.shape[-2:]
    norm_S = np.linalg.norm(S, axis=(-2, -1))
    slack = size2 * ((8.0 * (m + n) * EPS + 2.0 * root_error) * norm_S + S_error)
    return _bracket(A, slack, tolerance=tolerance)


def max_delay_from_stiffness(
    F: ArrayLike, D_theta: ArrayLike, *, tolerance: float = 1e-6
) -> DelayBound:
    """Largest delay for a delayed motor-side stiffness F, d = 1 / w(D^-½ F D^-½).

    The certified criterion of THEORY section 6 when F = −∂τ_osc/∂θ is the whole stiffness of the
    law that is run and is symmetric.

    Args:
        F: (…, n, n) Nm/rad.
        D_theta: (n,) or (…, n, n) motor damping, symmetric positive definite, Nms/rad.
        tolerance: relative width of the bracket at which refinement stops.

    Returns:
        The bracket, of F's batch shape.

    Raises:
        InputError: a shape does not fit, an entry is not finite, or D_θ is not positive definite.
    """
    stiffness = np.asarray(F, dtype=float)
    if stiffness.ndim < 2 or stiffness.shape[-1] != stiffness.shape[-2]:
        raise InputError(f"F has shape {stiffness.shape}; (…, n, n) is needed.")
    if not np.isfinite(stiffness).all():
        raise InputError("F has entries that are not finite.")
    root, error = inverse_root(D_theta, stiffness.shape[-1])
    A = root @ stiffness @ np.swapaxes(root, -1, -2)
    n = stiffness.shape[-1]
    size2 = np.sum(root**2, axis=(-2, -1))
    norm_A = np.linalg.norm(A, axis=(-2, -1))
    if np.ndim(D_theta) == 1:
        slack = 8.0 * EPS * norm_A
    else:
        norm_F = np.linalg.norm(stiffness, axis=(-2, -1))
        slack = (8.0 * n * EPS + 2.0 * error) * size2 * norm_F
    return _bracket(A, slack, tolerance=tolerance)


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
    A = root @ stiffness @ np.swapaxes(root, -1, -2)
    A_t = np.swapaxes(A, -1, -2)
    phi = np.asarray(angle)[..., None, None]
    H = np.cos(phi) * (A + A_t) / 2.0 + 0.5j * np.sin(phi) * (A - A_t)
    vectors = np.linalg.eigh(H)[1]
    return np.square(np.abs(vectors[..., -1]), dtype=np.float64)


def inverse_root(D_theta: ArrayLike, n: int) -> tuple[Array, Array]:
    """Return R with Rᵀ R = D_θ⁻¹, and the relative error of R.

    Args:
        D_theta: (n,) or (…, n, n) motor damping.
        n: number of joints.

    Returns:
        R (…, n, n), diagonal for a diagonal D_θ, else an inverse Cholesky factor; and its
        norm-wise relative error (…).

    Raises:
        InputError: D_θ has another shape, is not finite, or is not symmetric positive definite.
    """
    D = np.asarray(D_theta, dtype=float)
    if not np.isfinite(D).all():
        raise InputError("D_theta has entries that are not finite numbers.")
    if D.shape == (n,):
        if not (D > 0.0).all():
            at = int((~(D > 0.0)).argmax())
            raise InputError(
                f"D_theta[{at}] is {D[at]:g} Nms/rad; every motor damping must be positive."
            )
        return np.diag(1.0 / np.sqrt(D)), np.array(2.0 * EPS)
    if D.shape[-2:] != (n, n):
        raise InputError(f"D_theta has shape {D.shape}; ({n},) or (…, {n}, {n}) is needed.")
    if not np.allclose(D, np.swapaxes(D, -1, -2), rtol=1e-12, atol=0.0):
        raise InputError("D_theta is not symmetric.")
    values = np.linalg.eigvalsh(D)
    if (values[..., 0] <= n * EPS * values[..., -1]).any():
        raise InputError("D_theta is not positive definite; every motor needs damping.")
    factor = np.linalg.cholesky(D)
    return np.linalg.inv(factor), 8.0 * n * EPS * values[..., -1] / values[..., 0]


def checked_task(
    J_star: ArrayLike, Lambda: ArrayLike, K_x: ArrayLike, *, form: StiffnessForm | str
) -> tuple[Array, Array, Array, StiffnessForm]:
    try:
        kind = StiffnessForm(form)
    except ValueError:
        known = ", ".join(StiffnessForm)
        raise InputError(f"form is {form!r}; it must be one of {known}.") from None
    J = np.asarray(J_star, dtype=float)
    inertia = np.asarray(Lambda, dtype=float)
    gain = np.asarray(K_x, dtype=float)
    if J.ndim < 2 or 0 in J.shape[-2:]:
        raise InputError(f"J_star has shape {J.shape}; (…, m, n) is needed.")
    m = J.shape[-2]
    if gain.ndim <= 1:
        gain = np.diag(np.full(m, float(gain)) if gain.ndim == 0 else gain)
    for name, array in (("Lambda", inertia), ("K_x", gain)):
        if array.shape[-2:] != (m, m):
            raise InputError(f"{name} has shape {array.shape}; J_star's {m} rows need {m} x {m}.")
    for name, array in (("J_star", J), ("Lambda", inertia), ("K_x", gain)):
        if not np.isfinite(array).all():
            raise InputError(f"{name} has entries that are not finite numbers.")
    _check_semidefinite("K_x", gain)
    if kind is not StiffnessForm.FORCE:
        _check_semidefinite("Lambda", inertia)
    return J, inertia, gain, kind


def _check_semidefinite(name: str, array: Array) -> None:
    skew = np.abs(array - np.swapaxes(array, -1, -2)).max(axis=(-2, -1))
    size = np.abs(array).max(axis=(-2, -1))
    if (skew > _NEGATIVE * size).any():
        raise InputError(f"{name} is not symmetric.")
    lowest = np.linalg.eigvalsh(array)[..., 0]
    if (lowest < -_NEGATIVE * size).any():
        raise InputError(
            f"{name} is not positive semidefinite; its lowest eigenvalue is {lowest.min():.3g}."
        )


def _scaled_jacobian(J: Array, D_theta: ArrayLike) -> tuple[Array, Array]:
    root, error = inverse_root(D_theta, J.shape[-1])
    return J @ np.swapaxes(root, -1, -2), error


def task_stiffness(inertia: Array, gain: Array, *, form: StiffnessForm) -> tuple[Array, Array]:
    """S of a form, and a norm-wise bound of its rounding error."""
    m = gain.shape[-1]
    norm_K = np.linalg.norm(gain, axis=(-2, -1))
    if form is StiffnessForm.FORCE:
        return gain, np.zeros(gain.shape[:-2])
    if form is StiffnessForm.PUBLISHED:
        return inertia @ gain, 2 * m * EPS * np.linalg.norm(inertia, axis=(-2, -1)) * norm_K
    values, vectors = np.linalg.eigh((inertia + np.swapaxes(inertia, -1, -2)) / 2.0)
    values = np.clip(values, 0.0, None)
    root = (vectors * np.sqrt(values)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    largest = values[..., -1]
    uncertainty = 8.0 * m * EPS * largest
    root_error = uncertainty / np.sqrt(np.maximum(values[..., 0], np.maximum(uncertainty, 1e-300)))
    S = root @ gain @ root
    return (S + np.swapaxes(S, -1, -2)) / 2.0, 2.0 * root_error * np.sqrt(m * largest) * norm_K


def _bracket(A: Array, slack: Array, *, tolerance: float) -> DelayBound:
    """Turn matrices and their uncertainty into delays."""
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
        delay=delay.reshape(shape), upper=longest.reshape(shape), angle=angle.reshape(shape)
    )
