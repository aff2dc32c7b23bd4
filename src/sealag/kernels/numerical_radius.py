"""Numerical radius w(A) of real matrices, as a bracket that rounding errors cannot break.

w(A) = max_φ λ_max(cos φ · S + i sin φ · T), S and T the symmetric and skew parts of A. λ_max is the
support function of the numerical range, so that each evaluated angle gives a lower bound, and two
neighbouring ones an upper bound for all angles between them (the vertex of two tangents).
"""

import math

import numpy as np

from sealag.kernels._jit import entry, inner, shared

LONGEST = 4096
"""Angles at most: a disc, the slowest numerical range, needs 1,600 for 1e-6."""

EPS = 2.220446049250313e-16


@inner
def _tridiagonal(H, diagonal, off_squared, v, p):
    """Householder reduction of a Hermitian H (n, n), overwritten; squared off-diagonals."""
    n = H.shape[0]
    for k in range(n - 2):
        norm2 = 0.0
        for i in range(k + 1, n):
            norm2 += H[i, k].real ** 2 + H[i, k].imag ** 2
        off_squared[k] = norm2
        rest = norm2 - H[k + 1, k].real ** 2 - H[k + 1, k].imag ** 2
        if rest <= 1e-300 or rest <= 1e-34 * norm2:
            off_squared[k] = H[k + 1, k].real ** 2 + H[k + 1, k].imag ** 2
            continue
        norm = math.sqrt(norm2)
        size = abs(H[k + 1, k])
        phase = H[k + 1, k] / size if size > 0.0 else 1.0 + 0.0j
        for i in range(k + 1, n):
            v[i] = H[i, k]
        v[k + 1] += phase * norm
        beta = 1.0 / (norm * (norm + size))
        inner = 0.0
        for i in range(k + 1, n):
            total = 0.0j
            for j in range(k + 1, n):
                total += H[i, j] * v[j]
            p[i] = beta * total
            inner += (v[i].conjugate() * p[i]).real
        half = 0.5 * beta * inner
        for i in range(k + 1, n):
            p[i] -= half * v[i]
        for i in range(k + 1, n):
            for j in range(k + 1, n):
                H[i, j] -= v[i] * p[j].conjugate() + p[i] * v[j].conjugate()
    for i in range(n):
        diagonal[i] = H[i, i].real
    if n > 1:
        off_squared[n - 2] = H[n - 1, n - 2].real ** 2 + H[n - 1, n - 2].imag ** 2


@inner
def _largest_root(diagonal, off_squared, start, tiny):
    """Largest eigenvalue of a tridiagonal matrix, by Laguerre's iteration from above."""
    n = diagonal.shape[0]
    x = start
    for _ in range(60):
        q = diagonal[0] - x
        dq, ddq = -1.0, 0.0
        if q >= 0.0:
            return x
        log1 = dq / q
        log2 = log1 * log1
        for i in range(1, n):
            e = off_squared[i - 1]
            r = dq / q
            new = diagonal[i] - x - e / q
            new_d = -1.0 + e * r / q
            new_dd = e * (ddq / q - 2.0 * r * r) / q
            q, dq, ddq = new, new_d, new_dd
            if q >= 0.0:
                return x
            log1 += dq / q
            log2 += (dq / q) ** 2 - ddq / q
        root = (n - 1) * (n * log2 - log1 * log1)
        step = n / (log1 + math.sqrt(max(root, 0.0)))
        x -= step
        if step <= tiny:
            return x
    return x


@shared
def support(S, T, phi, H, v, p, diagonal, off_squared, scale):
    """λ_max(cos φ · S + i sin φ · T) to a few units of rounding of ``scale`` = ‖A‖_F."""
    n = S.shape[0]
    c, s = math.cos(phi), math.sin(phi)
    for i in range(n):
        for j in range(n):
            H[i, j] = complex(c * S[i, j], s * T[i, j])
    _tridiagonal(H, diagonal, off_squared, v, p)
    start = diagonal[0]
    for i in range(n):
        radius = 0.0
        if i > 0:
            radius += math.sqrt(off_squared[i - 1])
        if i < n - 1:
            radius += math.sqrt(off_squared[i])
        start = max(start, diagonal[i] + radius)
    start += 8.0 * EPS * scale
    return _largest_root(diagonal, off_squared, start, 4.0 * EPS * scale)


@inner
def _sector_bound(phi_1, h_1, phi_2, h_2):
    """Largest value on [φ_1, φ_2] of the sinusoid through both, and where it is."""
    width = phi_2 - phi_1
    b = (h_2 - h_1 * math.cos(width)) / math.sin(width)
    peak = math.atan2(b, h_1)
    if 0.0 < peak < width:
        return math.hypot(h_1, b), phi_1 + peak
    return max(h_1, h_2), 0.5 * (phi_1 + phi_2)


@inner
def _refine(S, T, tolerance, scale, work, fan):
    """Bracket max λ_max over [0, π] (the other half is its mirror image for real A)."""
    H, v, p, diagonal, off_squared = work
    phi, h, top, peak = fan
    count = 5
    best, best_phi = -np.inf, 0.0
    for k in range(count):
        phi[k] = math.pi * k / 4.0
        h[k] = support(S, T, phi[k], H, v, p, diagonal, off_squared, scale)
        if h[k] > best:
            best, best_phi = h[k], phi[k]
    for k in range(count - 1):
        top[k], peak[k] = _sector_bound(phi[k], h[k], phi[k + 1], h[k + 1])
    while True:
        at = 0
        for k in range(1, count - 1):
            if top[k] > top[at]:
                at = k
        bound = max(best, top[at])
        width = phi[at + 1] - phi[at]
        if bound - best <= tolerance * best or count == LONGEST or width < 1e-9:
            return best, bound, best_phi
        for k in range(count, at + 1, -1):
            phi[k], h[k], top[k], peak[k] = phi[k - 1], h[k - 1], top[k - 1], peak[k - 1]
        where = min(max(peak[at], phi[at] + 0.05 * width), phi[at] + 0.95 * width)
        phi[at + 1] = where
        h[at + 1] = support(S, T, where, H, v, p, diagonal, off_squared, scale)
        count += 1
        for k in range(at, at + 2):
            top[k], peak[k] = _sector_bound(phi[k], h[k], phi[k + 1], h[k + 1])
        if h[at + 1] > best:
            best, best_phi = h[at + 1], where


@entry
def numerical_radii(A, slack, tolerance, lower, upper, angle):
    """Bracket the numerical radius of each matrix.

    Args:
        A: (N, n, n) real matrices.
        slack: (N,) norm-wise uncertainty of each A, which widens the bracket on both sides.
        tolerance: relative width at which refinement stops.
        lower: (N,) out, never above w(A).
        upper: (N,) out, never below w(A).
        angle: (N,) out, φ at which the lower bound was found.
    """
    count, n = A.shape[0], A.shape[1]
    S, T = np.empty((n, n)), np.empty((n, n))
    H, v, p = (
        np.empty((n, n), np.complex128),
        np.empty(n, np.complex128),
        np.empty(n, np.complex128),
    )
    diagonal, off_squared = np.empty(n), np.empty(max(n - 1, 1))
    work = H, v, p, diagonal, off_squared
    fan = (np.empty(LONGEST), np.empty(LONGEST), np.empty(LONGEST), np.empty(LONGEST))
    for k in range(count):
        norm2, skew2, largest = 0.0, 0.0, 0.0
        for i in range(n):
            for j in range(n):
                largest = max(largest, abs(A[k, i, j]))
        if largest == 0.0:
            lower[k], upper[k], angle[k] = 0.0, slack[k], 0.0
            continue
        for i in range(n):
            for j in range(n):
                a, b = A[k, i, j] / largest, A[k, j, i] / largest
                S[i, j], T[i, j] = 0.5 * (a + b), 0.5 * (a - b)
                norm2 += a * a
                skew2 += T[i, j] * T[i, j]
        scale = math.sqrt(norm2)
        at_0 = support(S, T, 0.0, H, v, p, diagonal, off_squared, scale)
        at_pi = support(S, T, math.pi, H, v, p, diagonal, off_squared, scale)
        best = max(at_0, at_pi)
        bound = math.sqrt(best * best + 0.5 * skew2)
        angle[k] = 0.0 if at_0 >= at_pi else math.pi
        if bound - best > tolerance * best:
            best, bound, angle[k] = _refine(S, T, tolerance, scale, work, fan)
        rounding = (20.0 * n + 40.0) * EPS * scale
        lower[k] = max((best - rounding) * largest - slack[k], 0.0)
        upper[k] = (bound + rounding) * (1.0 + 8.0 * EPS) * largest + slack[k]
