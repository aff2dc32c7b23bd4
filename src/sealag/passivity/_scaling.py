"""From a user's arrays to D^-½ F D^-½, with a bound of every rounding error on the way."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

EPS = float(np.finfo(float).eps)
_NEGATIVE = 1e-9
"""Relative size up to which asymmetry and negative eigenvalues of Λ and K_x count as rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaledTask:
    """A task seen through D_θ^-½.

    Attributes:
        J: (…, m, n) J* D^-½.
        M: (…, n, m) D^-½ J*ᵀ S.
        A: (…, n, n) M J, 1/s; symmetric unless the form is published.
        A_error: (…) norm-wise uncertainty of A.
        M_error: (…) norm-wise uncertainty of M; that of J is counted here too.
    """

    J: Array
    M: Array
    A: Array
    A_error: Array
    M_error: Array


def scaled_task(
    J_star: ArrayLike,
    Lambda: ArrayLike,
    K_x: ArrayLike,
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str,
) -> ScaledTask:
    """Check a task's arrays and scale them.

    Args:
        J_star: (…, m, n) contact-consistent Jacobian J*.
        Lambda: (…, m, m) task inertia; not used for `force`.
        K_x: (m,) or (…, m, m) task gains.
        D_theta: (n,) or (…, n, n) motor damping, Nms/rad.
        form: symmetric, published or force.

    Raises:
        InputError: an array has the wrong shape, is not finite, or lacks a needed definiteness.
    """
    J, inertia, gain, kind = _checked_task(J_star, Lambda, K_x, form=form)
    m, n = J.shape[-2:]
    root, root_error = inverse_root(D_theta, n)
    shapes = [array.shape[:-2] for array in (J, inertia, gain, root)]
    try:
        np.broadcast_shapes(*shapes)
    except ValueError:
        raise InputError(
            f"The batches {shapes} of J_star, Lambda, K_x and D_theta do not fit together."
        ) from None
    scaled = J @ np.swapaxes(root, -1, -2)
    size = _norm(scaled)
    if kind is StiffnessForm.SYMMETRIC:
        S, S_error, change = _symmetric_stiffness(inertia, gain, scaled)
    else:
        S = gain if kind is StiffnessForm.FORCE else inertia @ gain
        S_error = 2 * m * EPS * _norm(inertia) * _norm(gain) if S is not gain else np.zeros(())
        change = size**2 * S_error
    M = np.swapaxes(scaled, -1, -2) @ S
    A = M @ scaled
    if kind is not StiffnessForm.PUBLISHED:
        A = _symmetric(A)
    rounding = size * (8.0 * (m + n) * EPS + 2.0 * root_error) * _norm(S)
    return ScaledTask(
        J=scaled,
        M=M,
        A=A,
        A_error=size * rounding + change,
        M_error=rounding + size * S_error,
    )


def scaled_stiffness(F: ArrayLike, D_theta: ArrayLike) -> ScaledTask:
    """Check a motor-side stiffness and scale it: the task J* = I with M = F.

    Args:
        F: (…, n, n) delayed stiffness, Nm/rad.
        D_theta: (n,) or (…, n, n) motor damping, Nms/rad.

    Raises:
        InputError: a shape does not fit, an entry is not finite, or D_θ is not positive definite.
    """
    stiffness = _real(F, "F")
    if stiffness.ndim < 2 or stiffness.shape[-1] != stiffness.shape[-2] or not stiffness.shape[-1]:
        raise InputError(f"F has shape {stiffness.shape}; (…, n, n) is needed.")
    if not np.isfinite(stiffness).all():
        raise InputError("F has entries that are not finite.")
    n = stiffness.shape[-1]
    root, root_error = inverse_root(D_theta, n)
    J = np.swapaxes(root, -1, -2)
    M = root @ stiffness
    A = M @ J
    if np.ndim(D_theta) == 1:
        return ScaledTask(J=J, M=M, A=A, A_error=8.0 * EPS * _norm(A), M_error=4.0 * EPS * _norm(M))
    relative = 8.0 * n * EPS + 2.0 * root_error
    M_error = relative * _norm(root) * _norm(stiffness)
    return ScaledTask(J=J, M=M, A=A, A_error=_norm(root) * M_error, M_error=M_error)


def _symmetric_stiffness(inertia: Array, gain: Array, J: Array) -> tuple[Array, Array, Array]:
    """S = X K X with X ≈ Λ^½; bounds of the error in S, and of what it does to Jᵀ S J.

    Let Y = Λ^½ exactly and δ bound ‖X² − Y²‖. For Z = X − Y, X Z + Z Y = X² − Y², so that
    ‖Z‖ ≤ √δ, while the part of Z outside the k lowest eigenvectors V of Λ is below 2δ/√λ_{k+1}.
    A rank-deficient Λ, whose V do not meet J, therefore costs nothing; the best k is taken.
    """
    m = gain.shape[-1]
    inertia, K = _symmetric(inertia), _symmetric(gain)
    values, V = np.linalg.eigh(inertia)
    values = np.clip(values, 0.0, None)
    V_t = np.swapaxes(V, -1, -2)
    X = (V * np.sqrt(values)[..., None, :]) @ V_t
    norm_K, trace = _norm(K), values.sum(axis=-1)
    delta = _norm(X @ X - inertia) + 4.0 * (m + 2) * EPS * trace
    blur = 20.0 * m * EPS * np.sqrt(trace)
    KXJ, VJ = K @ X @ J, V_t @ J
    VKXJ, norm_J, norm_KXJ = V_t @ KXJ, _norm(J), _norm(KXJ)
    inside = np.sqrt(delta) + blur
    change = np.full(np.broadcast_shapes(J.shape[:-2], inertia.shape[:-2], K.shape[:-2]), np.inf)
    for k in range(m + 1):
        with np.errstate(divide="ignore", invalid="ignore"):
            outside = blur + (2.0 * delta / np.sqrt(values[..., k]) if k < m else 0.0)
            low = inside * _norm(VJ[..., :k, :])
            ZJ = low + outside * norm_J
            first = low * _norm(VKXJ[..., :k, :]) + outside * norm_J * norm_KXJ
            change = np.fmin(change, 2.0 * first + norm_K * ZJ**2)
    rounding = 8.0 * m * EPS * trace * norm_K
    with np.errstate(divide="ignore", invalid="ignore"):
        Z = np.fmin(inside, blur + delta / np.sqrt(values[..., 0]))
    S_error = rounding + norm_K * Z * (2.0 * np.sqrt(trace) + Z)
    return _symmetric(X @ K @ X), S_error, change + norm_J**2 * rounding


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
    D = _real(D_theta, "D_theta")
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
    size = np.abs(D).max(axis=(-2, -1))
    if (np.abs(D - np.swapaxes(D, -1, -2)).max(axis=(-2, -1)) > 1e-12 * size).any():
        raise InputError("D_theta is not symmetric.")
    values = np.linalg.eigvalsh(D)
    if (values[..., 0] <= n * EPS * values[..., -1]).any():
        raise InputError("D_theta is not positive definite; every motor needs damping.")
    factor = np.linalg.cholesky(D)
    return np.linalg.inv(factor), 8.0 * n * EPS * values[..., -1] / values[..., 0]


def _checked_task(
    J_star: ArrayLike, Lambda: ArrayLike, K_x: ArrayLike, *, form: StiffnessForm | str
) -> tuple[Array, Array, Array, StiffnessForm]:
    try:
        kind = StiffnessForm(form)
    except ValueError:
        known = ", ".join(StiffnessForm)
        raise InputError(f"form is {form!r}; it must be one of {known}.") from None
    J = _real(J_star, "J_star")
    inertia = _real(Lambda, "Lambda")
    gain = _real(K_x, "K_x")
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


def _real(values: ArrayLike, name: str) -> Array:
    """The values as doubles; numbers that are not real are refused, not cut."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InputError(f"{name} is no array: its rows have different lengths.") from error
    if array.dtype.kind not in "fiub":
        raise InputError(f"{name} has entries of type {array.dtype}; real numbers are needed.")
    return array.astype(float, copy=False)


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


def _symmetric(array: Array) -> Array:
    return (array + np.swapaxes(array, -1, -2)) / 2.0


def _norm(array: Array) -> Array:
    return np.linalg.norm(array, axis=(-2, -1))
