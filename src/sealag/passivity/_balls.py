"""Positive definite or not, in ball arithmetic: every number is a ball that holds the true one."""

from typing import TYPE_CHECKING, Any

import numpy as np

from sealag.typing import Array

if TYPE_CHECKING:
    from flint import arb_mat, fmpq_mat

BITS = 400
"""Of a ball's middle. Half as many leave open what rounds to 1e-30 of its terms; twice as many take
twice as long."""


def exact_matrix(values: Array) -> "fmpq_mat":
    """Read doubles or rationals as a matrix of rationals.

    Args:
        values: (m, n) doubles or rationals.
    """
    from flint import fmpq, fmpq_mat

    exact = values.dtype == object
    flat = values.ravel().tolist()
    entries = flat if exact else [fmpq(*value.as_integer_ratio()) for value in flat]
    rows, columns = values.shape
    return fmpq_mat(rows, columns, entries)


def enclosed(matrix: "fmpq_mat") -> "arb_mat":
    """The matrix in balls; within `precise`.

    Args:
        matrix: of rationals.
    """
    from flint import arb_mat

    return arb_mat(matrix)


def precise() -> Any:
    """The context in which balls have `BITS`."""
    from flint import ctx

    return ctx.workprec(BITS)


def surely_positive(matrix: "arb_mat") -> bool | None:
    """Tell whether all pivots of L D Lᵀ are positive; None where a ball holds 0. Within `precise`.

    Args:
        matrix: symmetric; what is below the diagonal counts.
    """
    rows = np.array(matrix.tolist(), dtype=object)
    for k in range(len(rows)):
        pivot, column = rows[k, k], rows[k + 1 :, k]
        if not pivot > 0:
            return False if pivot < 0 else None
        rest = rows[k + 1 :, k + 1 :]
        rest -= np.outer(column / pivot, column)
    return True
