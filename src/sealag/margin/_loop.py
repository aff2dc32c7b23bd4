"""The delayed loop in the form the margin works on: neutral directions out, balanced, low rank."""

from contextlib import suppress
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.typing import Array, ArrayLike

if TYPE_CHECKING:
    from flint import fmpq

Complex: TypeAlias = complex | np.clongdouble
EPS = float(np.finfo(float).eps)
_STRUCTURE = 1e-8
_RANK = 1e-13
_ANGLES = (2.399963, 1.0, 4.1, 5.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A balanced quotient of ẋ = A_0 x + A_1 x(t − d) + A_e x(t − e).

    Attributes:
        A_0: (n, n) undelayed part, balanced.
        A_1: (n, n) delayed part, balanced, A_1 = B C.
        A_e: (n, n) part with the fixed delay, balanced; zero without one.
        embedded_delay: e, s; 0 without an embedded part.
        B: (n, r) left factor.
        C: (r, n) right factor.
        lift: (states, n) a state of the user's loop from one of this loop.
        neutral: number of structural zero roots taken out.
        size: ‖A_0‖ + ‖A_1‖ + ‖A_e‖, rad/s: no root on the imaginary axis lies above it.
        exact: whether the entries are the user's own up to powers of two.
    """

    A_0: Array
    A_1: Array
    A_e: Array
    embedded_delay: float
    B: Array
    C: Array
    lift: Array
    neutral: int
    size: float
    exact: bool

    @property
    def embedded(self) -> bool:
        """Whether a part with a fixed delay is left."""
        return self.embedded_delay > 0.0

    def characteristic(self, root: Complex, z: Complex) -> tuple[Array, Array]:
        """Return P = λ − A_0 − z A_1 − A_e e^{-λe} at λ = root, and ∂P/∂λ, both (n, n)."""
        identity = np.eye(len(self.A_0))
        P = root * identity - self.A_0 - z * self.A_1
        if not self.embedded:
            return P, identity
        late = np.exp(-root * self.embedded_delay) * self.A_e
        return P - late, identity + self.embedded_delay * late


def real_square(name: str, value: ArrayLike) -> Array:
    """Check one matrix of a loop.

    Args:
        name: what it is called in the message.
        value: (n, n) numbers.

    Returns:
        It as an array of doubles.

    Raises:
        InputError: it is no square matrix of finite real numbers.
    """
    matrix = real_numbers(name, value, what="a square matrix of real numbers")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise InputError(f"{name} has shape {matrix.shape}; a square matrix is needed.")
    return matrix


def real_numbers(name: str, value: ArrayLike, *, what: str) -> Array:
    """Check that a value is an array of finite real numbers.

    Args:
        name: what it is called in the message.
        value: the numbers.
        what: what is needed instead, in words.

    Returns:
        It as an array of doubles.

    Raises:
        InputError: it holds something else, or its rows differ in length.
    """
    try:
        given = np.asarray(value)
    except (ValueError, TypeError):
        raise InputError(f"{name} has rows of different lengths; {what} is needed.") from None
    if np.iscomplexobj(given):
        raise InputError(
            f"{name} is complex; {what} is needed: roots are counted in conjugate pairs. Write a "
            "complex state as its real and its imaginary part."
        )
    if given.dtype.kind not in "biuf":
        try:
            if given.dtype.kind != "O" or not all(isinstance(one, Real) for one in given.flat):
                raise TypeError
            given = given.astype(float)
        except (TypeError, ValueError):
            kind = "nothing" if value is None else f"no array of numbers ({_kind(given)})"
            raise InputError(f"{name} is {kind}; {what} is needed.") from None
    matrix = given.astype(float)
    if not np.isfinite(matrix).all():
        raise InputError(f"{name} has entries that are not finite numbers.")
    return matrix


def _kind(given: Array) -> str:
    """Name what an array holds that is no number."""
    if given.dtype.kind == "O":
        return next(type(one).__name__ for one in given.flat if not isinstance(one, Real))
    return {"U": "text", "S": "bytes", "M": "dates", "m": "durations"}.get(given.dtype.kind, "data")


def parts_of(
    A_0: ArrayLike, A_1: ArrayLike, A_e: ArrayLike | None, embedded_delay: float
) -> tuple[Array, Array, Array]:
    """Check the matrices of a delayed loop and its embedded delay.

    Args:
        A_0: (n, n) undelayed part.
        A_1: (n, n) delayed part.
        A_e: (n, n) part with the fixed delay, or None.
        embedded_delay: that delay, s.

    Returns:
        The three as arrays of doubles; an embedded part without delay is in the first.

    Raises:
        InputError: they are not square, not of one size, or not finite real numbers, or the
            embedded delay is no time.
    """
    first, second = real_square("A_0", A_0), real_square("A_1", A_1)
    if first.shape != second.shape:
        raise InputError(f"A_0 is {first.shape} and A_1 {second.shape}; they must agree.")
    late = time_of("embedded_delay", embedded_delay)
    if A_e is None:
        if late:
            raise InputError(f"embedded_delay is {late:g} s without an A_e that is delayed by it.")
        return first, second, np.zeros_like(first)
    third = real_square("A_e", A_e)
    if first.shape != third.shape:
        raise InputError(f"A_0 is {first.shape} and A_e {third.shape}; they must agree.")
    return (first, second, third) if late else (first + third, second, np.zeros_like(first))


def time_of(name: str, value: float) -> float:
    """Check a time of at least zero.

    Args:
        name: what it is called in the message.
        value: s.

    Returns:
        It as a float.

    Raises:
        InputError: it is negative, not finite or no number.
    """
    number = real_numbers(name, value, what="a finite time of at least zero")
    if number.ndim or number < 0.0:
        raise InputError(f"{name} is {value} s; a finite time of at least zero is needed.")
    return float(number)


def prepare(
    A_0: ArrayLike,
    A_1: ArrayLike,
    *,
    symmetries: ArrayLike | None,
    A_e: ArrayLike | None = None,
    embedded_delay: float = 0.0,
) -> Loop:
    """Take the neutral directions out by a quotient, balance, and factor A_1 = B C.

    Args:
        A_0: (n, n) undelayed part.
        A_1: (n, n) delayed part.
        symmetries: (n, s) states v with A_0 v = A_1 v = A_e v = 0, or None.
        A_e: (n, n) part with the fixed delay, or None.
        embedded_delay: that delay, s.

    Returns:
        The loop that is left; its size is 0 where nothing is left.

    Raises:
        InputError: a matrix cannot be used.
        SolverError: A_0, A_1 or A_e moves a symmetry.
    """
    from scipy.linalg import matrix_balance

    parts = parts_of(A_0, A_1, A_e, embedded_delay)
    neutral, complement = _neutral(parts, symmetries=symmetries)
    if neutral:
        first, second, third = (complement.T @ part @ complement for part in parts)
    else:
        first, second, third = parts
    n = len(first)
    delay = float(embedded_delay) if third.any() else 0.0
    if not n:
        none = np.zeros((0, 0))
        return Loop(
            A_0=none, A_1=none, A_e=none, embedded_delay=0.0, B=none, C=none, lift=complement,
            neutral=neutral, size=0.0, exact=False,
        )  # fmt: skip
    whole = np.abs(first) + np.abs(second) + np.abs(third)
    scale = matrix_balance(whole, permute=False, separate=True)[1][0]
    first, second, third = (part * scale / scale[:, None] for part in (first, second, third))
    U, values, V = np.linalg.svd(second)
    rank = int((values > _RANK * values[0]).sum())
    root = np.sqrt(values[:rank])
    return Loop(
        A_0=first,
        A_1=second,
        A_e=third,
        embedded_delay=delay,
        B=U[:, :rank] * root,
        C=root[:, None] * V[:rank],
        lift=complement * scale,
        neutral=neutral,
        size=float(sum(np.linalg.norm(part, 2) for part in (first, second, third))),
        exact=not neutral,
    )


def _neutral(parts: tuple[Array, ...], *, symmetries: ArrayLike | None) -> tuple[int, Array]:
    """Dimension of the neutral subspace with its chains, and a basis of its complement.

    A chain needs a bare integrator, A_0 y = v: the delayed parts give nothing to it.
    """
    n = len(parts[0])
    if symmetries is None:
        return 0, np.eye(n)
    given = real_numbers("symmetries", symmetries, what=f"an ({n}, s) array of real numbers")
    if given.ndim != 2 or len(given) != n:
        raise InputError(f"symmetries has shape {given.shape}; ({n}, s) finite numbers are needed.")
    if not given.shape[1]:
        return 0, np.eye(n)
    basis = _span(given)
    stacked = np.vstack(parts)
    lost = np.abs(stacked @ basis).max()
    if lost > _STRUCTURE * np.abs(stacked).max():
        raise SolverError(
            "A column v of symmetries is no symmetry of the loop: A_0 v, A_1 v or A_e v is "
            f"{lost:.2g} instead of 0."
        )
    newest = basis
    inverse = np.linalg.pinv(stacked, rcond=1e-12)
    while newest.shape[1] and basis.shape[1] < n:
        target = np.vstack([newest] + [np.zeros_like(newest)] * (len(parts) - 1))
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


def roots_at_once(A: Array) -> tuple[int, bool]:
    """Count the eigenvalues of a matrix that are not surely in the open left half-plane.

    Args:
        A: (n, n).

    Returns:
        The count, and whether one of them lies on the imaginary axis to rounding.
    """
    values, error = eigenvalues_with_error(A)
    outside = values.real >= -error
    return int(outside.sum()), bool((outside & (values.real <= error)).any())


def has_zero_root(loop: Loop) -> bool:
    """Tell whether A_0 + A_1 + A_e is singular to rounding: a root at zero whatever the delay.

    Args:
        loop: the loop.
    """
    values = np.linalg.svd(loop.A_0 + loop.A_1 + loop.A_e, compute_uv=False)
    return bool(values[-1] <= 64.0 * len(values) * EPS * loop.size)


def undamped_whatever_the_delay(loop: Loop) -> bool:
    """Tell whether a root stays on the imaginary axis for every delay factor that was tried.

    Args:
        loop: a loop without an embedded delay.
    """
    for angle in _ANGLES:
        values, error = eigenvalues_with_error(loop.A_0 + np.exp(-1j * angle) * loop.A_1)
        if (np.abs(values.real) > error).all():
            return False
    return True


def exact_determinant(A: Array) -> "fmpq":
    """Determinant of a matrix of doubles, in rational arithmetic.

    Args:
        A: (n, n).
    """
    from flint import fmpq_mat

    entries = [rational(value) for value in A.ravel().tolist()]
    return fmpq_mat(len(A), len(A), entries).det()


def rational(value: float) -> "fmpq":
    """A double as the fraction that it is.

    Args:
        value: finite.
    """
    from flint import fmpq

    return fmpq(*float(value).as_integer_ratio())


def eigenvalues_with_error(A: Array) -> tuple[Array, Array]:
    """Eigenvalues of A, corrected by their residuals, and bounds of their errors.

    To first order an eigenvalue moves by yᴴ E x / yᴴ x. What E is in the entries of A is bounded
    entry by entry, so that slow modes beside stiff springs keep their digits; what the eigensolver
    adds, a share of ‖A‖, is taken out by the residual up to its square over the distance to the
    next eigenvalue. Where that distance is too small, the bounds of the whole norm are left: with
    the left vectors that belong to the right ones, as equal joints have equal eigenvalues, whose
    own left vectors may be of another of them.

    Args:
        A: (n, n).
    """
    from scipy.linalg import eig

    values, left, right = eig(A, left=True, right=True)[:3]  # pyright: ignore
    n, norm = len(A), float(np.linalg.norm(A, 2))
    products = np.sum(left.conj() * right, axis=0)
    overlap = np.maximum(np.abs(products), EPS)
    simple = 4.0 * n * EPS * norm / overlap
    with suppress(np.linalg.LinAlgError):  # a defective matrix has no such vectors
        simple = np.minimum(
            simple, 4.0 * n * EPS * norm * np.linalg.norm(np.linalg.inv(right), axis=1)
        )
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
