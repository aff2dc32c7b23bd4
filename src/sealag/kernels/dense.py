"""Small dense symmetric matrices without allocation: pseudo-inverse and eigenvectors."""

import numpy as np
from numba import njit


@njit(cache=True)
def multiply(A, B, out):
    """out = A B for C-contiguous A (m, k), B (k, n), out (m, n)."""
    m, k = A.shape
    n = B.shape[1]
    for i in range(m):
        for j in range(n):
            out[i, j] = 0.0
        for p in range(k):
            a = A[i, p]
            if a != 0.0:
                for j in range(n):
                    out[i, j] += a * B[p, j]


@njit(cache=True)
def multiply_transposed(A, B, out):
    """out = A Bᵀ for A (m, k), B (n, k), out (m, n)."""
    m, k = A.shape
    n = B.shape[0]
    for i in range(m):
        for j in range(n):
            total = 0.0
            for p in range(k):
                total += A[i, p] * B[j, p]
            out[i, j] = total


@njit(cache=True)
def invert_spd(A, out, factor):
    """out = A⁻¹ of a symmetric positive definite A (n, n) by Cholesky; False if it is not.

    ``factor`` (n, n) receives the inverse of the Cholesky factor.
    """
    n = A.shape[0]
    for j in range(n):
        for i in range(j, n):
            total = A[i, j]
            for p in range(j):
                total -= factor[i, p] * factor[j, p]
            if i == j:
                if not total > 0.0:
                    return False
                factor[j, j] = np.sqrt(total)
            else:
                factor[i, j] = total / factor[j, j]
    for j in range(n):
        factor[j, j] = 1.0 / factor[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for p in range(j, i):
                total -= factor[i, p] * factor[p, j]
            factor[i, j] = total / factor[i, i]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for p in range(i, n):
                total += factor[p, i] * factor[p, j]
            out[i, j] = total
            out[j, i] = total
    return True


@njit(cache=True)
def jacobi_eigh(A, values, vectors):
    """Eigenvalues and eigenvectors (columns) of a symmetric A (n, n); A is overwritten.

    Cyclic Jacobi rotations. Convergence is quadratic: once the off-diagonal part is below 1e-9 of
    the diagonal, one more sweep takes it below rounding.
    """
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(60):
        off, scale = 0.0, 0.0
        for i in range(n):
            scale += A[i, i] * A[i, i]
            for j in range(i):
                off += A[i, j] * A[i, j]
        for p in range(n - 1):
            for q in range(p + 1, n):
                _rotate(A, vectors, p, q)
        if off <= 1e-18 * scale:
            break
    for i in range(n):
        values[i] = A[i, i]


@njit(cache=True)
def _rotate(A, vectors, p, q):
    if A[p, q] == 0.0:
        return
    n = A.shape[0]
    ratio = (A[q, q] - A[p, p]) / (2.0 * A[p, q])
    t = 1.0 / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
    if ratio < 0.0:
        t = -t
    c = 1.0 / np.sqrt(t * t + 1.0)
    s = t * c
    for k in range(n):
        a, b = A[k, p], A[k, q]
        A[k, p], A[k, q] = c * a - s * b, s * a + c * b
    for k in range(n):
        a, b = A[p, k], A[q, k]
        A[p, k], A[q, k] = c * a - s * b, s * a + c * b
    for k in range(n):
        a, b = vectors[k, p], vectors[k, q]
        vectors[k, p], vectors[k, q] = c * a - s * b, s * a + c * b


@njit(cache=True)
def pseudo_inverse_psd(A, threshold, out, root, values, vectors):
    """out = A⁺ and root = (A⁺)^½ of a symmetric positive semidefinite A (n, n); A is overwritten.

    Eigenvalues up to ``threshold`` count as zero. Returns the rank.
    """
    n = A.shape[0]
    jacobi_eigh(A, values, vectors)
    rank = 0
    for i in range(n):
        if values[i] > threshold:
            values[i] = 1.0 / values[i]
            rank += 1
        else:
            values[i] = 0.0
    for i in range(n):
        for j in range(i + 1):
            inverse, half = 0.0, 0.0
            for k in range(n):
                product = vectors[i, k] * vectors[j, k]
                inverse += product * values[k]
                half += product * np.sqrt(values[k])
            out[i, j] = inverse
            out[j, i] = inverse
            root[i, j] = half
            root[j, i] = half
    return rank


def warm() -> None:
    """Compile every kernel of this module."""
    A, B, C = np.eye(2), np.eye(2), np.eye(2)
    multiply(A, B, C)
    multiply_transposed(A, B, C)
    invert_spd(A, B, C)
    pseudo_inverse_psd(A, 1e-9, B, C, np.zeros(2), np.eye(2))
