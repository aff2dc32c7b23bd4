"""Positive definite or not: doubles with a rounding bound, rationals without any error."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sealag.typing import Array

Reader = Callable[[Any], Array]
"""Turns numbers of a file into an array of doubles, or of rationals."""

EPS = float(np.finfo(float).eps)


class Decision(NamedTuple):
    """Whether a matrix is positive definite.

    A doubtful one, of which rounding may have moved an eigenvalue over 0, does not hold.
    """

    holds: bool
    doubtful: bool
    words: str


_NOT_POSITIVE = Decision(False, False, "an entry on the diagonal is not positive")


def doubles(values: Any) -> Array:
    """Read numbers of a file as doubles.

    Args:
        values: nested lists of numbers, or an array.

    Raises:
        ValueError: one is missing or not finite.
    """
    array = np.array(values, dtype=float)
    if not np.isfinite(array).all():
        raise ValueError("a number is missing or not finite")
    return array


def rationals(values: Any) -> Array:
    """Read numbers of a file as exact rationals: a double is a fraction.

    Args:
        values: nested lists of numbers, or an array.

    Raises:
        ValueError: one is missing or not finite.
    """
    from flint import fmpq

    array = doubles(values)
    exact = np.empty(array.shape, dtype=object)
    for index, value in np.ndenumerate(array):
        exact[index] = fmpq(*float(value).as_integer_ratio())
    return exact


def like(array: Array, values: Array) -> Array:
    """Give doubles the kind of another array.

    Args:
        array: doubles or rationals.
        values: doubles.
    """
    return rationals(values) if array.dtype == object else values


def as_doubles(array: Array) -> Array:
    """Round an array of either kind to doubles.

    Args:
        array: doubles or rationals.
    """
    if array.dtype != object:
        return array
    rounded = [int(value.p) / int(value.q) for value in array.ravel()]
    return np.array(rounded, dtype=float).reshape(array.shape)


def size(array: Array) -> float:
    """Frobenius norm, to double precision.

    Args:
        array: doubles or rationals.
    """
    return float(np.linalg.norm(as_doubles(array)))


def positive_definite(matrix: Array) -> Decision:
    """Decide whether a symmetric matrix is positive definite.

    Doubles: eigenvalues of the matrix, scaled by powers of two to a diagonal near 1, must exceed
    what rounding of the entries and of the eigenvalues can amount to. Rationals: all leading
    minors, from fraction-free elimination of integers, must be positive (Sylvester), without any
    error.

    Args:
        matrix: (N, N) doubles or rationals; its symmetric part is meant.

    """
    if matrix.dtype == object:
        return _exactly(matrix)
    even = (matrix + matrix.T) / 2.0
    scale = _near_one(even)
    if scale is None:
        return _NOT_POSITIVE
    return _decision(*_lowest(even * scale[:, None] * scale[None, :]))


def positive_complement(
    diagonal: Array, loss: Array, M: Array, W: Array, *, terms: tuple[Array, Array]
) -> Decision:
    """Decide in doubles whether [[C, M], [Mᵀ, W]] is positive definite: W and C − M W⁻¹ Mᵀ are.

    For any X, with R = Mᵀ − W X, M W⁻¹ Mᵀ = Xᵀ Mᵀ + Rᵀ X + Rᵀ W⁻¹ R: the error of the solution X
    counts twice only, and every rounding is bounded by sums of absolute values.

    Args:
        diagonal: (n,) positive.
        loss: (n, n) with C = diag(diagonal) − loss.
        M: (n, m).
        W: (m, m).
        terms: sums of the absolute values that loss and M were added up from.
    """
    whole = np.diag(diagonal)
    outer, inner = _near_one(whole), _near_one(W)
    if outer is None or inner is None:
        return _NOT_POSITIVE
    both = outer[:, None] * outer[None, :]
    C, C_terms = (whole - loss) * both, (whole + terms[0]) * both
    M, M_terms = (part * outer[:, None] * inner[None, :] for part in (M, terms[1]))
    W = W * inner[:, None] * inner[None, :]
    least, doubt = _lowest(W)
    if not least > doubt:
        return _decision(least, doubt, of=" of W")
    X = np.linalg.solve(W, M.T)
    R = M.T - W @ X
    R_error = M_terms.T + np.abs(W) @ np.abs(X)
    turn = M @ X + R.T @ X
    added = C_terms + M_terms @ np.abs(X) + 2.0 * R_error.T @ np.abs(X)
    unit = (len(W) + 8) * EPS
    lowest, room = _lowest((C + C.T) / 2.0 - (turn + turn.T) / 2.0)
    room += unit * float(np.linalg.norm(added))
    room += float(np.linalg.norm(np.abs(R) + unit * R_error)) ** 2 / (least - doubt)
    return _decision(lowest, room)


def _decision(lowest: float, room: float, of: str = "") -> Decision:
    doubtful = abs(lowest) <= room
    words = f"lowest eigenvalue{of} {lowest:.3e}, rounding {room:.1e}"
    return Decision(lowest > room, doubtful, words + ", in doubt: --exact decides" * doubtful)


def _near_one(matrix: Array) -> Array | None:
    """Powers of two that bring a diagonal near 1; None if it is not positive."""
    diagonal = np.diag(matrix)
    if not (diagonal > 0.0).all():
        return None
    return np.array([2.0 ** -round(math.log2(value) / 2.0) for value in diagonal])


def _lowest(matrix: Array) -> tuple[float, float]:
    """Lowest eigenvalue of a symmetric matrix of rounded entries, and its rounding error."""
    room = 16.0 * len(matrix) * EPS * float(np.linalg.norm(matrix))
    return float(np.linalg.eigvalsh(matrix)[0]), room


def _exactly(matrix: Array) -> Decision:
    from flint import fmpq_mat

    even = (matrix + matrix.T) / 2
    integers, _ = fmpq_mat(even.tolist()).numer_denom()
    order, _, _, minors = integers.fflu()
    for k in range(len(even)):
        if order[k, k] != 1 or not minors[k, k] > 0:
            return Decision(False, False, f"leading minor {k + 1} is not positive")
    return Decision(True, False, "all leading minors positive")
