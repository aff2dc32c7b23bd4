"""The question: the largest delay for which a multiplier makes the delayed loop passive.

The inequality of Theorem 1 and Corollary 1, scaled by D_θ^-½, is for instant t

    [[2I − J_tᵀ W J_t, d M_t], [⋆, W]] ⪰ 0,   W = d Q = diag(W_1 … W_k) ≻ 0,

with J = J* D^-½ and M = D^-½ J*ᵀ S. Priority levels are the blocks of W. The certified criterion is
J* = I and M = D^-½ F, with one multiplier in joint coordinates (docs/theory section 6).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from sealag.errors import InputError, word
from sealag.store import Store, blocks, release
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

EPS = float(np.finfo(float).eps)

_NEGATIVE = 1e-9
"""Relative asymmetry and negative eigenvalue of Λ and K_x that count as rounding. Ten times less
refuses a Λ inverted from a mass matrix of condition 1e7; ten times more accepts wrong data."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """The scaled matrices of one or many instants, with bounds of the rounding in them.

    Attributes:
        J: (…, m, n) J* D^-½, levels stacked.
        M: (…, n, m) D^-½ J*ᵀ S, levels side by side, 1/s.
        blocks: rows of each level; they sum to m.
        A_error: (…, k) norm-wise error of each level's D^-½ J*ᵀ S J* D^-½, 1/s.
        M_error: (…, k) norm-wise error of each level's M, that of J included, 1/s.
        semidefinite: whether every level's J*ᵀ S J* is symmetric positive semidefinite.
    """

    J: Array
    M: Array
    blocks: tuple[int, ...]
    A_error: Array = field(default_factory=lambda: np.zeros(1))
    M_error: Array = field(default_factory=lambda: np.zeros(1))
    semidefinite: bool = False

    def __post_init__(self) -> None:
        """Refuse shapes that do not fit.

        Raises:
            InputError: J, M and blocks do not fit together, or there is no instant.
        """
        *batch, m, n = self.J.shape
        if self.M.shape != (*batch, n, m) or sum(self.blocks) != m or 0 in batch:
            raise InputError(
                f"J {self.J.shape}, M {self.M.shape} and blocks {self.blocks} do not fit together."
            )
        for name in ("A_error", "M_error"):
            error = getattr(self, name)
            if error.shape[-1] == len(self.blocks):
                continue
            if error.shape[-1] != 1:
                raise InputError(f"{name} has shape {error.shape}; one error a level is needed.")
            each = np.repeat(error, len(self.blocks), axis=-1)
            object.__setattr__(self, name, each)

    @classmethod
    def of_tasks(
        cls,
        J_star: ArrayLike,
        Lambda: ArrayLike,
        K_x: ArrayLike,
        D_theta: ArrayLike,
        *,
        levels: Sequence[int] | None = None,
        form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    ) -> "Problem":
        """State Theorem 1 (29), or Corollary 1 (31) for several priority levels.

        Args:
            J_star: (…, m, n) contact-consistent Jacobian J*, levels stacked.
            Lambda: (…, m, m) task inertia, symmetric positive semidefinite, zero between levels;
                not used for `force`.
            K_x: (m,) or (…, m, m) task gains, symmetric positive semidefinite.
            D_theta: (n,) or (…, n, n) motor damping, symmetric positive definite, Nms/rad.
            levels: (k + 1,) first row of each priority level, then m; one level if None.
            form: symmetric S = Λ^½ K_x Λ^½, published S = Λ K_x, or force S = K_x.

        Raises:
            InputError: a shape does not fit, an entry is not finite, D_θ is not positive definite,
                Λ or K_x is not symmetric positive semidefinite or couples levels.
        """
        kind = word(StiffnessForm, form, what="form")
        J, inertia, gain = _checked_task(J_star, Lambda, K_x, kind)
        m, n = J.shape[-2:]
        rows = _rows(m if levels is None else levels, m)
        _check_apart(rows, K_x=gain)
        if kind is not StiffnessForm.FORCE:
            _check_apart(rows, Lambda=inertia)
        even = all(_even(gain[..., at, at]) for at in rows)
        inertia = symmetric(inertia) if even else inertia  # k Λ is symmetric
        root, root_error = _inverse_root(D_theta, n)
        batch = _common_batch(J_star=J, Lambda=inertia, K_x=gain, D_theta=root)
        scaled = J @ transposed(root)
        parts = [
            _level(scaled[..., at, :], inertia[..., at, at], gain[..., at, at], root_error, kind)
            for at in rows
        ]
        return cls(
            J=np.broadcast_to(scaled, (*batch, m, n)),
            M=np.concatenate(
                [np.broadcast_to(one.M, (*batch, *one.M.shape[-2:])) for one in parts], axis=-1
            ),
            blocks=tuple(at.stop - at.start for at in rows),
            A_error=np.stack([np.broadcast_to(one.A_error, batch) for one in parts], axis=-1),
            M_error=np.stack([np.broadcast_to(one.M_error, batch) for one in parts], axis=-1),
            semidefinite=even or kind is not StiffnessForm.PUBLISHED,
        )

    @classmethod
    def of_stiffness(cls, F: ArrayLike, D_theta: ArrayLike) -> "Problem":
        """State the certified criterion for a delayed motor-side stiffness F = −∂τ_osc/∂θ.

        Args:
            F: (…, n, n) Nm/rad.
            D_theta: (n,) or (…, n, n) motor damping, symmetric positive definite, Nms/rad.

        Raises:
            InputError: a shape does not fit, an entry is not finite, or D_θ is not positive
                definite.
        """
        F = _real(F, "F")
        if F.ndim < 2 or F.shape[-1] != F.shape[-2] or not F.shape[-1]:
            raise InputError(f"F has shape {F.shape}; (…, n, n) is needed.")
        if not np.isfinite(F).all():
            raise InputError("F has entries that are not finite.")
        n = F.shape[-1]
        root, root_error = _inverse_root(D_theta, n)
        batch = _common_batch(F=F, D_theta=root)
        J, M = transposed(root), root @ F
        if np.ndim(D_theta) == 1:
            A_error, M_error = 8.0 * EPS * norm(M @ J), 4.0 * EPS * norm(M)
        else:
            M_error = (8.0 * n * EPS + 2.0 * root_error) * norm(root) * norm(F)
            A_error = norm(root) * M_error
        return cls(
            J=np.broadcast_to(J, (*batch, n, n)),
            M=np.broadcast_to(M, (*batch, n, n)),
            blocks=(n,),
            A_error=np.broadcast_to(A_error, batch)[..., None],
            M_error=np.broadcast_to(M_error, batch)[..., None],
        )

    @property
    def rows(self) -> list[slice]:
        """Each level's rows of J and columns of M."""
        ends = np.cumsum(self.blocks)
        return [slice(int(end - size), int(end)) for end, size in zip(ends, self.blocks)]

    @property
    def closed_form(self) -> bool:
        """Whether every instant by itself has a bound without a solver."""
        return self.semidefinite or len(self.blocks) == 1

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the instants."""
        return self.J.shape[:-2]

    def at(self, instants: Any) -> "Problem":
        """Return the same problem for some instants, or for one.

        Args:
            instants: an index of the batch, as of an array.

        Raises:
            InputError: there is no such instant.
        """
        try:
            np.broadcast_to(0.0, self.batch)[instants]
        except IndexError:
            has = f"{self.batch} instants" if self.batch else "one instant, without a number"
            raise InputError(f"There is no instant {instants!r}; the problem has {has}.") from None
        A_error, M_error = (
            np.broadcast_to(error, (*self.batch, error.shape[-1]))
            for error in (self.A_error, self.M_error)
        )
        return Problem(
            J=self.J[instants],
            M=self.M[instants],
            blocks=self.blocks,
            A_error=A_error[instants],
            M_error=M_error[instants],
            semidefinite=self.semidefinite,
        )

    def parts(self) -> Iterator["Problem"]:
        """Go through one axis of instants block by block, in little memory however many.

        Yields:
            The same problem for the next instants.
        """
        for rows in blocks(len(self.J)):
            yield self.at(rows)
            release(self.J, self.M)

    def room(self, count: int) -> "Problem":
        """Return a problem with room for more instants, to be filled by `put`.

        Args:
            count: how many instants.
        """
        same_J = self.J.strides[0] == 0  # J* = I, stated once
        store = Store.of(
            count,
            self.M[0].size * (1 if same_J else 2),
            what="A motion",
            remedy="certify fewer of its instants",
        )
        shape = (count, *self.J.shape[1:])
        return replace(
            self,
            J=np.broadcast_to(self.J[0], shape) if same_J else store.zeros(shape),
            M=store.zeros((count, *self.M.shape[1:])),
            A_error=np.zeros((count, len(self.blocks))),
            M_error=np.zeros((count, len(self.blocks))),
        )

    def put(self, rows: slice, part: "Problem") -> None:
        """Fill in instants of a part of a motion.

        Args:
            rows: which instants these are.
            part: their problem.
        """
        if self.J.strides[0]:
            self.J[rows] = part.J
        self.M[rows], self.A_error[rows], self.M_error[rows] = part.M, part.A_error, part.M_error
        release(self.J, self.M)

    def motion(self) -> "Problem":
        """Return the same problem with exactly one axis of instants.

        Raises:
            InputError: it has more than one.
        """
        if len(self.batch) > 1:
            raise InputError(f"A motion has one axis of instants, not {self.batch}.")
        return self if self.batch else self.at(None)

    def scaled_stiffness(self, rows: slice = slice(None)) -> Array:
        """Return D^-½ J*ᵀ S J* D^-½ of some rows, (…, n, n), 1/s.

        Args:
            rows: of a level; all levels together without it.
        """
        A = self.M[..., rows] @ self.J[..., rows, :]
        return symmetric(A) if self.semidefinite else A


@dataclass(frozen=True, slots=True, kw_only=True)
class _Level:
    """One level's M = D^-½ J*ᵀ S, and the errors of M and of M J."""

    M: Array
    A_error: Array
    M_error: Array


def _even(gain: Array) -> bool:
    """Whether a level has one gain k, K_x = k I."""
    return np.array_equal(gain, gain[..., :1, :1] * np.eye(gain.shape[-1]))


def _level(J: Array, inertia: Array, gain: Array, root_error: Array, kind: StiffnessForm) -> _Level:
    m, n = J.shape[-2:]
    size = norm(J)
    if kind is StiffnessForm.SYMMETRIC:
        S, S_error, change = _symmetric_stiffness(inertia, gain, J)
    else:
        S = gain if kind is StiffnessForm.FORCE else inertia @ gain
        S_error = 2 * m * EPS * norm(inertia) * norm(gain) if S is not gain else np.zeros(())
        change = size**2 * S_error
    rounding = size * (8.0 * (m + n) * EPS + 2.0 * root_error) * norm(S)
    return _Level(
        M=transposed(J) @ S,
        A_error=size * rounding + change,
        M_error=rounding + size * S_error,
    )


def _symmetric_stiffness(inertia: Array, gain: Array, J: Array) -> tuple[Array, Array, Array]:
    """S = X K X with X ≈ Λ^½; bounds of the error in S, and of what it does to Jᵀ S J.

    Let Y = Λ^½ exactly and δ bound ‖X² − Y²‖. For Z = X − Y, X Z + Z Y = X² − Y², so that
    ‖Z‖ ≤ √δ, while the part of Z outside the k lowest eigenvectors V of Λ is below 2δ/√λ_{k+1}.
    A rank-deficient Λ, whose V do not meet J, therefore costs nothing; the best k is taken.
    """
    m = gain.shape[-1]
    inertia, K = symmetric(inertia), symmetric(gain)
    values, V = np.linalg.eigh(inertia)
    values = np.clip(values, 0.0, None)
    V_t = transposed(V)
    X = (V * np.sqrt(values)[..., None, :]) @ V_t
    norm_K, trace = norm(K), values.sum(axis=-1)
    delta = norm(X @ X - inertia) + 4.0 * (m + 2) * EPS * trace
    blur = 20.0 * m * EPS * np.sqrt(trace)
    KXJ, VJ = K @ X @ J, V_t @ J
    VKXJ, norm_J, norm_KXJ = V_t @ KXJ, norm(J), norm(KXJ)
    inside = np.sqrt(delta) + blur
    change = np.full(np.broadcast_shapes(J.shape[:-2], inertia.shape[:-2], K.shape[:-2]), np.inf)
    for k in range(m + 1):
        with np.errstate(divide="ignore", invalid="ignore"):
            outside = blur + (2.0 * delta / np.sqrt(values[..., k]) if k < m else 0.0)
            low = inside * norm(VJ[..., :k, :])
            ZJ = low + outside * norm_J
            first = low * norm(VKXJ[..., :k, :]) + outside * norm_J * norm_KXJ
            change = np.fmin(change, 2.0 * first + norm_K * ZJ**2)
    rounding = 8.0 * m * EPS * trace * norm_K
    with np.errstate(divide="ignore", invalid="ignore"):
        Z = np.fmin(inside, blur + delta / np.sqrt(values[..., 0]))
    S_error = rounding + norm_K * Z * (2.0 * np.sqrt(trace) + Z)
    return symmetric(X @ K @ X), S_error, change + norm_J**2 * rounding


def _inverse_root(D_theta: ArrayLike, n: int) -> tuple[Array, Array]:
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


def _rows(levels: int | Sequence[int], m: int) -> list[slice]:
    """Rows of each level, from the first row of each and m."""
    edges = [0, levels] if isinstance(levels, int) else [int(edge) for edge in levels]
    if len(edges) < 2 or edges[0] != 0 or edges[-1] != m or (np.diff(edges) <= 0).any():
        raise InputError(f"levels is {edges}; it must rise from 0 to J_star's {m} rows.")
    return [slice(first, after) for first, after in pairwise(edges)]


def _check_apart(rows: Sequence[slice], **arrays: Array) -> None:
    """Refuse Λ or K_x that couple levels, which (31) does not."""
    for name, array in arrays.items():
        apart = array.copy()
        for at in rows:
            apart[..., at, at] = 0.0
        if apart.any():
            raise InputError(f"{name} couples priority levels; its blocks between them must be 0.")


def _common_batch(**arrays: Array) -> tuple[int, ...]:
    shapes = [array.shape[:-2] for array in arrays.values()]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        names = ", ".join(arrays)
        raise InputError(f"The batches {shapes} of {names} do not fit together.") from None


def _checked_task(
    J_star: ArrayLike, Lambda: ArrayLike, K_x: ArrayLike, kind: StiffnessForm
) -> tuple[Array, Array, Array]:
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
    return J, inertia, gain


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


def transposed(array: Array) -> Array:
    """The transposes of stacked matrices."""
    return np.swapaxes(array, -1, -2)


def symmetric(array: Array) -> Array:
    """The symmetric parts of stacked matrices."""
    return (array + transposed(array)) / 2.0


def norm(array: Array) -> Array:
    """The Frobenius norms of stacked matrices."""
    return np.linalg.norm(array, axis=(-2, -1))
