"""Small dense linear algebra without allocation: factors, solutions, pseudo-inverses."""

import math

import numpy as np

from sealag.kernels._jit import inner, shared, summing

_ROUNDING = 1e-13
"""Of the trace: what a Cholesky factorisation leaves. Ten times smaller takes rounding for rank;
ten times larger drops directions that the rank tolerance of tasks, 1e-9, is to decide about."""
_NOTHING = 1e-34
"""Square of the share of two diagonal entries below which the one beside them is rounding. A
hundred times larger shows in the last digit of eigenvalues; a hundred times smaller turns what is
0."""
_WORST_CONDITION = 1e4
"""Up to which A⁺ through G⁻² loses no more than six digits; ten times more loses eight."""


@inner
def copy(source, target):
    """target = source, of the same shape and one or two dimensions."""
    if source.ndim == 1:
        for i in range(source.shape[0]):
            target[i] = source[i]
    else:
        for i in range(source.shape[0]):
            for j in range(source.shape[1]):
                target[i, j] = source[i, j]


@inner
def trace(A):
    """Return the trace of A (n, n)."""
    total = 0.0
    for i in range(A.shape[0]):
        total += A[i, i]
    return total


@shared
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


@summing
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


@inner
def cholesky(A, L):
    """Write the lower factor L of A = L Lᵀ (n, n); False if A is not positive definite."""
    n = A.shape[0]
    for j in range(n):
        for i in range(j, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if not s > 0.0:
                    return False
                L[j, j] = math.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
    return True


@inner
def forward_solve(L, x):
    """x ← L⁻¹ x in place, L (≥ n, ≥ n) lower triangular, x (n,)."""
    for i in range(x.size):
        s = x[i]
        for k in range(i):
            s -= L[i, k] * x[k]
        x[i] = s / L[i, i]


@inner
def backward_solve(L, x):
    """x ← L⁻ᵀ x in place, L (≥ n, ≥ n) lower triangular, x (n,)."""
    for i in range(x.size - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, x.size):
            s -= L[k, i] * x[k]
        x[i] = s / L[i, i]


@shared
def invert_spd(A, out, factor):
    """out = A⁻¹ of a symmetric positive definite A (n, n) by Cholesky; False if it is not.

    ``factor`` (n, n) receives the inverse of the Cholesky factor.
    """
    if not cholesky(A, factor):
        return False
    n = A.shape[0]
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


@inner
def jacobi_eigh(A, values, vectors):
    """Eigenvalues and eigenvectors (columns) of a symmetric A (n, n), of which the upper part is
    read and overwritten.

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
                off += A[j, i] * A[j, i]
        for p in range(n - 1):
            for q in range(p + 1, n):
                _rotate(A, vectors, p, q)
        if off <= 1e-18 * scale:
            break
    for i in range(n):
        values[i] = A[i, i]


@inner
def _rotate(A, vectors, p, q):
    """Rotate A[p, q] away, p < q, in the upper part of A; not if it is rounding."""
    a = A[p, q]
    if a * a <= _NOTHING * abs(A[p, p] * A[q, q]):
        return
    n = A.shape[0]
    ratio = (A[q, q] - A[p, p]) / (2.0 * a)
    t = 1.0 / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
    if ratio < 0.0:
        t = -t
    c = 1.0 / np.sqrt(t * t + 1.0)
    s = t * c
    for k in range(p):
        A[k, p], A[k, q] = c * A[k, p] - s * A[k, q], s * A[k, p] + c * A[k, q]
    for k in range(p + 1, q):
        A[p, k], A[k, q] = c * A[p, k] - s * A[k, q], s * A[p, k] + c * A[k, q]
    for k in range(q + 1, n):
        A[p, k], A[q, k] = c * A[p, k] - s * A[q, k], s * A[p, k] + c * A[q, k]
    A[p, p] -= t * a
    A[q, q] += t * a
    A[p, q] = 0.0
    for k in range(n):
        a, b = vectors[k, p], vectors[k, q]
        vectors[k, p], vectors[k, q] = c * a - s * b, s * a + c * b


@shared
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


@inner
def _factor(A, L, left):
    """A = L Lᵀ by Cholesky with pivots, rows of Lᵀ (r, n) in ``L``; r, and the trace of A.

    It ends where what is left of every diagonal entry is rounding.
    """
    n, whole = A.shape[0], trace(A)
    for i in range(n):
        left[i] = A[i, i]
    for r in range(n):
        p = 0
        for i in range(1, n):
            if left[i] > left[p]:
                p = i
        if not left[p] > _ROUNDING * max(whole, 0.0):
            return r, whole
        copy(A[p], L[r])
        for k in range(r):
            factor = L[k, p]
            for i in range(n):
                L[r, i] -= factor * L[k, i]
        scale = 1.0 / np.sqrt(left[p])
        for i in range(n):
            L[r, i] *= scale
            left[i] -= L[r, i] * L[r, i]
        left[p] = 0.0
    return n, whole


@inner
def invert_low_rank(A, threshold, out, scratch, values):
    """out = A⁺ of a symmetric positive semidefinite A (n, n), if that is safe without eigenvalues.

    A = L Lᵀ by Cholesky with pivots, L (n, r), and A⁺ = L G⁻² Lᵀ with G = Lᵀ L, whose eigenvalues
    are those of A that are not 0; A⁻¹ at full rank.

    Args:
        A: (n, n), kept.
        threshold: eigenvalues up to this count as zero.
        out: (n, n), written.
        scratch: (5, ≥ n²).
        values: (≥ n,) scratch.

    Returns:
        The rank; -1 if eigenvalues must decide what it is, because one may lie near the threshold
        or A is too badly conditioned. It is given only where it is certain: what is left of the
        trace is rounding, and λ_r ≥ 1 / trace G⁻¹ is above the threshold.
    """
    n = A.shape[0]
    r, whole = _factor(A, scratch[0][: n * n].reshape(n, n), values)
    least = max(threshold, whole / _WORST_CONDITION)
    if r == n:
        if invert_spd(A, out, scratch[1][: n * n].reshape(n, n)) and trace(out) * least < 1.0:
            return n
        return -1
    L, W = scratch[0][: r * n].reshape(r, n), scratch[1][: r * n].reshape(r, n)
    G, G_inverse = scratch[2][: r * r].reshape(r, r), scratch[3][: r * r].reshape(r, r)
    multiply_transposed(L, L, G)
    if not invert_spd(G, G_inverse, scratch[4][: r * r].reshape(r, r)):
        return -1
    if trace(G_inverse) * least >= 1.0:
        return -1
    multiply(G_inverse, L, W)
    out[:, :] = 0.0
    for k in range(r):
        for i in range(n):
            factor = W[k, i]
            for j in range(n):
                out[i, j] += factor * W[k, j]
    return r


@shared
def pseudo_inverse(A, threshold, out, scratch, values):
    """out = A⁺; eigenvalues only where `invert_low_rank` gives no answer. A is overwritten."""
    if invert_low_rank(A, threshold, out, scratch, values) < 0:
        n = A.shape[0]
        root, vectors = scratch[0][: n * n].reshape(n, n), scratch[1][: n * n].reshape(n, n)
        pseudo_inverse_psd(A, threshold, out, root, values, vectors)


@shared
def least_squares(A, r, damping, x, scratch):
    """Write the least-squares solution x (m,) of A x = r, damped where A is nearly singular.

    Args:
        A: (m, m).
        r: (m,).
        damping: share of the trace of AᵀA that is added to it.
        x: (m,), written; not a number if A is not finite.
        scratch: (2, m, m).
    """
    m = A.shape[0]
    G, L = scratch[0], scratch[1]
    G[:] = 0.0
    x[:] = 0.0
    for k in range(m):
        for i in range(m):
            a = A[k, i]
            x[i] += a * r[k]
            if a != 0.0:
                for j in range(i + 1):
                    G[i, j] += a * A[k, j]
    ridge = damping * trace(G) + 1e-300
    for i in range(m):
        G[i, i] += ridge
    if not cholesky(G, L):
        x[:] = np.nan
        return
    forward_solve(L, x)
    backward_solve(L, x)


@inner
def eliminate(A, share, scale):
    """A ← its factors L and U without pivoting; L's diagonal of ones is not written.

    Args:
        A: (n, n) whose pivots are positive if the question has an answer, overwritten.
        share: of its scale (n,) that each pivot must exceed.
        scale: (n,).

    Returns:
        False if a pivot does not.
    """
    n = scale.size
    for p in range(n):
        if not A[p, p] > share * scale[p]:
            return False
        for i in range(p + 1, n):
            A[i, p] /= A[p, p]
            for j in range(p + 1, n):
                A[i, j] -= A[i, p] * A[p, j]
    return True


@inner
def substitute(A, x):
    """x (n,) ← (L U)⁻¹ x in place, with the factors (n, n) that `eliminate` writes."""
    n = x.size
    for i in range(n):
        for j in range(i):
            x[i] -= A[i, j] * x[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= A[i, j] * x[j]
        x[i] /= A[i, i]
