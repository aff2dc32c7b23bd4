"""The delayed loop in the form the margin works on: neutral directions out, balanced, low rank."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.typing import Array, ArrayLike

EPS = float(np.finfo(float).eps)
_STRUCTURE = 1e-8
_RANK = 1e-13
_WORST_BASIS = 1e6
_REFERENCES = (0.0, 2.399963, 1.0, 4.1, 5.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A balanced quotient of ẋ = A_0 x + A_1 x(t − d).

    Attributes:
        A_0: (n, n) undelayed part, balanced.
        A_1: (n, n) delayed part, balanced, A_1 = B C.
        B: (n, r) left factor.
        C: (r, n) right factor.
        lift: (states, n) a state of the user's loop from one of this loop.
        neutral: number of structural zero roots taken out.
        size: ‖A_0‖ + ‖A_1‖, rad/s: no root on the imaginary axis lies above it.
    """

    A_0: Array
    A_1: Array
    B: Array
    C: Array
    lift: Array
    neutral: int
    size: float


def square_pair(A_0: ArrayLike, A_1: ArrayLike) -> tuple[Array, Array]:
    """Check the two matrices of a delayed loop.

    Args:
        A_0: (n, n) undelayed part.
        A_1: (n, n) delayed part.

    Returns:
        Both as arrays of doubles.

    Raises:
        InputError: they are not square, not of one size, or not finite.
    """
    pair = []
    for name, value in (("A_0", A_0), ("A_1", A_1)):
        matrix = np.asarray(value, dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
            raise InputError(f"{name} has shape {matrix.shape}; a square matrix is needed.")
        if not np.isfinite(matrix).all():
            raise InputError(f"{name} has entries that are not finite numbers.")
        pair.append(matrix)
    if pair[0].shape != pair[1].shape:
        raise InputError(f"A_0 is {pair[0].shape} and A_1 {pair[1].shape}; they must agree.")
    return pair[0], pair[1]


def prepare(A_0: ArrayLike, A_1: ArrayLike, *, symmetries: ArrayLike | None) -> Loop:
    """Take the neutral directions out by a quotient, balance, and factor A_1 = B C.

    Args:
        A_0: (n, n) undelayed part.
        A_1: (n, n) delayed part.
        symmetries: (n, s) states v with A_0 v = 0 and A_1 v = 0, or None.

    Returns:
        The loop that is left; its size is 0 where nothing is left.

    Raises:
        InputError: a matrix cannot be used.
        SolverError: a symmetry is none.
    """
    from scipy.linalg import matrix_balance

    first, second = square_pair(A_0, A_1)
    neutral, complement = _neutral(first, second, symmetries=symmetries)
    first = complement.T @ first @ complement
    second = complement.T @ second @ complement
    if not len(first):
        none = np.zeros((0, 0))
        return Loop(A_0=none, A_1=none, B=none, C=none, lift=complement, neutral=neutral, size=0.0)
    scale = matrix_balance(np.abs(first) + np.abs(second), permute=False, separate=True)[1][0]
    first, second = (matrix * scale / scale[:, None] for matrix in (first, second))
    U, values, V = np.linalg.svd(second)
    rank = int((values > _RANK * values[0]).sum())
    root = np.sqrt(values[:rank])
    return Loop(
        A_0=first,
        A_1=second,
        B=U[:, :rank] * root,
        C=root[:, None] * V[:rank],
        lift=complement * scale,
        neutral=neutral,
        size=float(np.linalg.norm(first, 2) + np.linalg.norm(second, 2)),
    )


def _neutral(A_0: Array, A_1: Array, *, symmetries: ArrayLike | None) -> tuple[int, Array]:
    """Dimension of the neutral subspace with its chains, and a basis of its complement."""
    n = len(A_0)
    if symmetries is None:
        return 0, np.eye(n)
    given = np.asarray(symmetries, dtype=float)
    if given.ndim != 2 or len(given) != n or not np.isfinite(given).all():
        raise InputError(f"symmetries has shape {given.shape}; ({n}, s) finite numbers are needed.")
    if not given.shape[1]:
        return 0, np.eye(n)
    basis = _span(given)
    stacked = np.vstack([A_0, A_1])
    lost = np.abs(stacked @ basis).max()
    if lost > _STRUCTURE * np.abs(stacked).max():
        raise SolverError(
            "A column v of symmetries is moved by the dynamics, so it is none: A_0 v or A_1 v is "
            f"{lost:.2g} instead of 0."
        )
    newest = basis
    inverse = np.linalg.pinv(stacked, rcond=1e-12)
    while newest.shape[1] and basis.shape[1] < n:
        target = np.vstack([newest, np.zeros_like(newest)])
        chain = inverse @ target
        chain += inverse @ (target - stacked @ chain)
        _, values, rows = np.linalg.svd(stacked @ chain - target)
        newest = chain @ rows[values < _STRUCTURE].T
        basis = _span(np.hstack([basis, newest]))
    return basis.shape[1], np.linalg.svd(basis, full_matrices=True)[0][:, basis.shape[1] :]


def _span(columns: Array) -> Array:
    lengths = np.linalg.norm(columns, axis=0)
    U, values, _ = np.linalg.svd(columns / np.where(lengths > 0.0, lengths, 1.0))
    return U[:, : int((values > _STRUCTURE).sum())]


def roots_without_delay(loop: Loop) -> tuple[int, bool]:
    """Count the roots at zero delay that are not surely in the open left half-plane.

    Args:
        loop: the loop.

    Returns:
        The count, and whether one of them lies on the imaginary axis to rounding.
    """
    values, error = _eigenvalues_with_error(loop.A_0 + loop.A_1)
    outside = values.real >= -error
    return int(outside.sum()), bool((outside & (values.real <= error)).any())


def has_zero_root(loop: Loop) -> bool:
    """Tell whether A_0 + A_1 is singular to rounding: a root at zero whatever the delay.

    Args:
        loop: the loop.
    """
    values = np.linalg.svd(loop.A_0 + loop.A_1, compute_uv=False)
    return bool(values[-1] <= 64.0 * len(values) * EPS * loop.size)


def _eigenvalues_with_error(A: Array) -> tuple[Array, Array]:
    """Eigenvalues of A, corrected by their residuals, and bounds of their errors.

    To first order an eigenvalue moves by yᴴ E x / yᴴ x. What E is in the entries of A is bounded
    entry by entry, so that slow modes beside stiff springs keep their digits; what the eigensolver
    adds, a share of ‖A‖, is taken out by the residual up to its square over the distance to the
    next eigenvalue. Where that distance is too small, the bounds of the whole norm are left.
    """
    from scipy.linalg import eig

    values, left, right = eig(A, left=True, right=True)[:3]  # pyright: ignore
    n, norm = len(A), float(np.linalg.norm(A, 2))
    products = np.sum(left.conj() * right, axis=0)
    overlap = np.maximum(np.abs(products), EPS)
    simple = 4.0 * n * EPS * norm / overlap
    wide = right.astype(np.clongdouble)
    residual = A.astype(np.clongdouble) @ wide - wide * values
    moved = (np.sum(left.conj() * residual, axis=0) / products).astype(complex)
    entries = 4.0 * n * EPS * np.sum(np.abs(left) * (np.abs(A) @ np.abs(right)), axis=0) / overlap
    gap = np.abs(values[:, None] - values) + np.diag(np.full(n, np.inf))
    gap = gap.min(axis=1)
    apart = (gap > 10.0 * simple) & (np.abs(moved) <= simple)
    error = np.where(apart, entries + simple**2 / np.maximum(gap, EPS * norm), simple)
    defective = np.cbrt(4.0 * n * EPS * norm**3)
    return np.where(apart, values + moved, values), np.minimum(error, defective)


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """G(ω) = C (jω − A_ref)⁻¹ B about a reference z_0 of the delay factor, A_ref = A_0 + z_0 A_1.

    A root jω with delay factor z = e^{-jωd} is an eigenvalue ν = 1/(z − z_0) of G(ω), and
    |z| = 1 is the line Re(z_0 ν) = −½.

    Attributes:
        loop: the loop.
        reference: z_0, of modulus 1, for which A_ref has no root on the imaginary axis.
        A: (n, n) A_ref.
        poles: (n,) its eigenvalues.
        left: (r, n) C V with its eigenvectors V; None where V is too badly conditioned to use.
        right: (n, r) V⁻¹ B, or None.
        rounding: relative rounding error of a term of G.
    """

    loop: Loop
    reference: complex
    A: Array
    poles: Array
    left: Array | None
    right: Array | None
    rounding: float

    def resolvents(self, omega: Array) -> Array:
        """Return (N, n, n) inverses (jω − A_ref)⁻¹ at (N,) frequencies `omega`."""
        n = len(self.A)
        return np.linalg.inv(1j * omega[:, None, None] * np.eye(n) - self.A)

    def near(self, omega: float) -> tuple[Array, Array]:
        """Return G (r, r) and dG/dλ (r, r) at λ = jω, solved without the eigenvectors."""
        n = len(self.A)
        P = 1j * omega * np.eye(n) - self.A
        RB = np.linalg.solve(P, self.loop.B)
        return self.loop.C @ RB, -self.loop.C @ np.linalg.solve(P, RB)


def transfer_of(loop: Loop) -> Transfer:
    """Choose a reference delay factor without roots on the imaginary axis.

    Args:
        loop: the loop.

    Returns:
        The transfer about it.

    Raises:
        SolverError: whatever the delay factor, a root stays on the imaginary axis.
    """
    for angle in _REFERENCES:
        z = np.exp(-1j * angle) if angle else 1.0
        A = loop.A_0 + z * loop.A_1
        poles, error = _eigenvalues_with_error(A)
        if (np.abs(poles.real) > error).all():
            break
    else:
        raise SolverError(
            "A root stays on the imaginary axis whatever the delay: the loop has an undamped "
            "motion that the delay does not reach; name it in symmetries if it is neutral."
        )
    poles, V = np.linalg.eig(A)
    condition = float(np.linalg.cond(V))
    usable = condition < _WORST_BASIS
    return Transfer(
        loop=loop,
        reference=complex(z),
        A=A,
        poles=poles,
        left=loop.C @ V if usable else None,
        right=np.linalg.solve(V, loop.B.astype(complex)) if usable else None,
        rounding=16.0 * len(A) * EPS * (condition if usable else 1.0),
    )
