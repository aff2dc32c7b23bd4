"""Contact-consistent, prioritised operational space at one instant, on preallocated arrays."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sealag.kernels.dense import invert_spd, multiply, multiply_transposed, pseudo_inverse_psd
from sealag.typing import Array

SYMMETRIC, PUBLISHED, FORCE = 0, 1, 2
_ROUNDING = 1e-13  # of the trace: what a Cholesky factorisation leaves
_WORST_CONDITION = 1e4  # up to which A⁺ through G⁻² loses no more than six digits


class Space(NamedTuple):
    """Results and scratch of `operational_space`; everything is written in place.

    Sizes: nv velocities, n actuated joints, c contact rows, m task rows in all levels.
    """

    J_star: Array  # (m, n)
    Lambda: Array  # (m, m), blocks of the levels on the diagonal
    stiffness: Array  # (m, m), likewise
    joint_from_base: Array  # (nv, n): dynamically consistent inverse of U N_s
    lift: Array  # (m, nv): rows of Λ_k J_k P_k, the motion that one unit of a task's error means
    gravity: Array  # (n,) compensation torque
    M_inverse: Array  # (nv, nv)
    P: Array  # (nv, nv)
    square_n: Array  # (8, n, n)
    square_c: Array  # (7, c, c)
    square_m: Array  # (5, m, m)
    wide_c: Array  # (2, c, nv)
    wide_m: Array  # (m, nv)
    tall_n: Array  # (nv, n)
    values: Array  # (max(n, c, m),)


@njit(cache=True)
def memory_size(nv, n, c, m):
    """Return how many numbers `divide` divides."""
    wide = nv * (n + m + 2 * nv) + n * (m + 1) + 2 * m * m
    return wide + 8 * n * n + 7 * c * c + 5 * m * m + (2 * c + m + n) * nv + max(n, c, m, 1)


@njit(cache=True)
def divide(memory, nv, n, c, m):
    """Return the arrays of one operational space, views of one memory.

    Args:
        memory: (memory_size,).
        nv: number of velocities.
        n: number of actuated joints.
        c: number of contact rows.
        m: number of task rows.
    """
    J_star, memory = memory[: m * n].reshape(m, n), memory[m * n :]
    Lambda, memory = memory[: m * m].reshape(m, m), memory[m * m :]
    stiffness, memory = memory[: m * m].reshape(m, m), memory[m * m :]
    joint_from_base, memory = memory[: nv * n].reshape(nv, n), memory[nv * n :]
    lift, memory = memory[: m * nv].reshape(m, nv), memory[m * nv :]
    gravity, memory = memory[:n], memory[n:]
    M_inverse, memory = memory[: nv * nv].reshape(nv, nv), memory[nv * nv :]
    P, memory = memory[: nv * nv].reshape(nv, nv), memory[nv * nv :]
    square_n, memory = memory[: 8 * n * n].reshape(8, n, n), memory[8 * n * n :]
    square_c, memory = memory[: 7 * c * c].reshape(7, c, c), memory[7 * c * c :]
    square_m, memory = memory[: 5 * m * m].reshape(5, m, m), memory[5 * m * m :]
    wide_c, memory = memory[: 2 * c * nv].reshape(2, c, nv), memory[2 * c * nv :]
    wide_m, memory = memory[: m * nv].reshape(m, nv), memory[m * nv :]
    tall_n, values = memory[: nv * n].reshape(nv, n), memory[nv * n :]
    return Space(
        J_star, Lambda, stiffness, joint_from_base, lift, gravity, M_inverse, P, square_n, square_c,
        square_m, wide_c, wide_m, tall_n, values,
    )  # fmt: skip


def allocate(nv: int, n: int, c: int, *, m: int) -> Space:
    """Allocate the arrays of one operational space.

    Args:
        nv: number of velocities.
        n: number of actuated joints.
        c: number of contact rows.
        m: number of task rows.
    """
    return divide(np.zeros(memory_size(nv, n, c, m)), nv, n, c, m)


@njit(cache=True)
def _factor(A, L, left):
    """A = L Lᵀ by Cholesky with pivots, rows of Lᵀ (r, n) in ``L``; r, and the trace of A.

    It ends where what is left of every diagonal entry is rounding.
    """
    n = A.shape[0]
    trace = 0.0
    for i in range(n):
        left[i] = A[i, i]
        trace += A[i, i]
    for r in range(n):
        p = 0
        for i in range(1, n):
            if left[i] > left[p]:
                p = i
        if not left[p] > _ROUNDING * max(trace, 0.0):
            return r, trace
        L[r] = A[p]
        for k in range(r):
            factor = L[k, p]
            for i in range(n):
                L[r, i] -= factor * L[k, i]
        scale = 1.0 / np.sqrt(left[p])
        for i in range(n):
            L[r, i] *= scale
            left[i] -= L[r, i] * L[r, i]
        left[p] = 0.0
    return n, trace


@njit(cache=True)
def invert_low_rank(A, threshold, out, scratch, values):
    """out = A⁺ of a symmetric positive semidefinite A (n, n), if that is safe without eigenvalues.

    A = L Lᵀ by Cholesky with pivots, L (n, r), and A⁺ = L G⁻² Lᵀ with G = Lᵀ L, whose eigenvalues
    are those of A that are not 0.

    Args:
        A: (n, n), kept.
        threshold: eigenvalues up to this count as zero.
        out: (n, n), written.
        scratch: (5, n, n).
        values: (≥ n,) scratch.

    Returns:
        The rank; -1 if eigenvalues must decide what it is, because one may lie near the threshold
        or A is too badly conditioned. It is given only where it is certain: what is left of the
        trace is rounding, and λ_r ≥ 1 / trace G⁻¹ is above the threshold.
    """
    n = A.shape[0]
    r, trace = _factor(A, scratch[0], values)
    L, W = scratch[0][:r], scratch[1][:r]
    G = scratch[2].ravel()[: r * r].reshape(r, r)
    G_inverse = scratch[3].ravel()[: r * r].reshape(r, r)
    multiply_transposed(L, L, G)
    if not invert_spd(G, G_inverse, scratch[4].ravel()[: r * r].reshape(r, r)):
        return -1
    weakest = 0.0
    for i in range(r):
        weakest += G_inverse[i, i]
    if weakest * max(threshold, trace / _WORST_CONDITION) >= 1.0:
        return -1
    multiply(G_inverse, L, W)
    out[:, :] = 0.0
    for k in range(r):
        for i in range(n):
            factor = W[k, i]
            for j in range(n):
                out[i, j] += factor * W[k, j]
    return r


@njit(cache=True)
def _pseudo_inverse(A, threshold, out, scratch, values):
    """out = A⁺; eigenvalues only where `invert_low_rank` gives no answer. A is overwritten."""
    if invert_low_rank(A, threshold, out, scratch, values) < 0:
        pseudo_inverse_psd(A, threshold, out, scratch[0], values, scratch[1])


@njit(cache=True)
def _subtract_projection(P, X, inverse, scratch):
    """P ← P − Xᵀ A⁺ X with X (k, nv), A⁺ (k, k) and scratch (k, nv)."""
    multiply(inverse, X, scratch)
    k, nv = X.shape
    for r in range(k):
        for i in range(nv):
            x = X[r, i]
            if x != 0.0:
                for j in range(nv):
                    P[i, j] -= x * scratch[r, j]


@njit(cache=True)
def _constrain(M, J_s, tolerance, space):
    """P = N_s M⁻¹, the inverse inertia that the contacts leave; False if M is not positive."""
    if not invert_spd(M, space.M_inverse, space.P):
        return False
    P = space.P
    P[:, :] = space.M_inverse
    if J_s.shape[0] == 0:
        return True
    X, scratch = space.wide_c[0], space.wide_c[1]
    A, A_inverse = space.square_c[0], space.square_c[1]
    multiply(J_s, P, X)
    multiply_transposed(X, J_s, A)
    threshold = tolerance * np.trace(A)
    _pseudo_inverse(A, threshold, A_inverse, space.square_c[2:], space.values)
    _subtract_projection(P, X, A_inverse, scratch)
    return True


@njit(cache=True)
def _stiffness_block(form, K, Lambda, root, scratch, out):
    """The task stiffness of one level: Λ^½ K Λ^½, Λ K, or K."""
    if form == SYMMETRIC:
        multiply(K, root, scratch)
        multiply(root, scratch, out)
    elif form == PUBLISHED:
        multiply(Lambda, K, out)
    else:
        out[:, :] = K


@njit(cache=True)
def operational_space(M, g, J_s, J_t, K_x, levels, form, star, tolerance, space):
    """Fill ``space`` at one instant, Eqs. (10), (11) with Sentis' recursive null spaces.

    P_1 = N_s M⁻¹,  φ* = U P_1 Uᵀ,  and for each level k:  Λ_k = (J_k P_k J_kᵀ)⁺,
    J*_k = J_k P_k Uᵀ φ*⁺,  P_{k+1} = P_k − P_k J_kᵀ Λ_k J_k P_k.

    Args:
        M: (nv, nv) mass matrix.
        g: (nv,) gravity torque.
        J_s: (c, nv) contact Jacobian, c may be 0.
        J_t: (m, nv) task Jacobians, levels below one another.
        K_x: (m, m) task stiffness, blocks of the levels on the diagonal.
        levels: (k + 1,) first row of each level, then m.
        form: SYMMETRIC, PUBLISHED or FORCE.
        star: whether stiffness uses Λ*_k = (J*_k φ* J*_kᵀ)⁺ instead of Λ_k.
        tolerance: a direction counts as lost where its mobility is below this fraction of the
            mobility (trace) that the task has without contacts and higher levels.
        space: arrays from `allocate`.

    Returns:
        False if M is not positive definite; the arrays are then without meaning.
    """
    if not _constrain(M, J_s, tolerance, space):
        return False
    nv = M.shape[0]
    n = space.gravity.shape[0]
    base = nv - n
    P = space.P
    phi, phi_inverse, work = space.square_n[0], space.square_n[1], space.square_n[7]
    scale = 0.0
    for i in range(n):
        scale += space.M_inverse[base + i, base + i]
        for j in range(n):
            phi[i, j] = P[base + i, base + j]
            work[i, j] = phi[i, j]
    _pseudo_inverse(work, tolerance * scale, phi_inverse, space.square_n[2:7], space.values)
    for i in range(nv):
        for j in range(n):
            space.tall_n[i, j] = P[i, base + j]
    multiply(space.tall_n, phi_inverse, space.joint_from_base)
    for j in range(n):
        total = 0.0
        for i in range(nv):
            total += space.joint_from_base[i, j] * g[i]
        space.gravity[j] = total
    space.Lambda[:, :] = 0.0
    space.stiffness[:, :] = 0.0
    for k in range(len(levels) - 1):
        _level(J_t, K_x, levels[k], levels[k + 1], form, star, tolerance, space)
    return True


@njit(cache=True)
def _mobility(J, M_inverse):
    """trace(J M⁻¹ Jᵀ): the scale against which a lost direction is small."""
    total = 0.0
    for r in range(J.shape[0]):
        for i in range(J.shape[1]):
            if J[r, i] != 0.0:
                for j in range(J.shape[1]):
                    total += J[r, i] * M_inverse[i, j] * J[r, j]
    return total


@njit(cache=True)
def _level(J_t, K_x, first, last, form, star, tolerance, space):
    """One priority level: J*, its stiffness, and what is left for the next level."""
    size = last - first
    if size == 0:
        return
    P, phi_inverse = space.P, space.square_n[1]
    nv, n = space.joint_from_base.shape
    base = nv - n
    X, scratch = space.wide_m[:size], space.lift[first:last]
    multiply(J_t[first:last], P, X)
    H = space.square_m[0].ravel()[: size * size].reshape(size, size)
    Lambda = space.square_m[1].ravel()[: size * size].reshape(size, size)
    root = space.square_m[2].ravel()[: size * size].reshape(size, size)
    vectors = space.square_m[3].ravel()[: size * size].reshape(size, size)
    block = space.square_m[4].ravel()[: size * size].reshape(size, size)
    multiply_transposed(X, J_t[first:last], H)
    threshold = tolerance * _mobility(J_t[first:last], space.M_inverse)
    pseudo_inverse_psd(H, threshold, Lambda, root, space.values, vectors)
    for r in range(size):
        for j in range(n):
            total = 0.0
            for p in range(n):
                total += X[r, base + p] * phi_inverse[p, j]
            space.J_star[first + r, j] = total
    _subtract_projection(P, X, Lambda, scratch)
    if star:
        J_phi = X.ravel()[: size * n].reshape(size, n)
        multiply(space.J_star[first:last], space.square_n[0], J_phi)
        multiply_transposed(J_phi, space.J_star[first:last], H)
        pseudo_inverse_psd(H, threshold, Lambda, root, space.values, vectors)
    K = K_x[first:last, first:last]
    for i in range(size):
        for j in range(size):
            vectors[i, j] = K[i, j]
    _stiffness_block(form, vectors, Lambda, root, H, block)
    for i in range(size):
        for j in range(size):
            space.stiffness[first + i, first + j] = block[i, j]
            space.Lambda[first + i, first + j] = Lambda[i, j]


@njit(cache=True)
def operational_spaces(M, g, J_s, J_t, K_x, levels, form, star, tolerance, space, out):
    """`operational_space` at N instants, one after the other.

    Args:
        M: (N, nv, nv); g: (N, nv); J_s: (N, c, nv); J_t: (N, m, nv).
        K_x: as in `operational_space`, with levels, form, star, tolerance and space.
        out: J_star (N, m, n), Lambda (N, m, m), stiffness (N, m, m), joint_from_base
            (N, nv, n), gravity (N, n), lift (N, m, nv), all written.

    Returns:
        The first instant at which M is not positive definite, or -1.
    """
    J_star, Lambda, stiffness, joint_from_base, gravity, lift = out
    for k in range(M.shape[0]):
        if not operational_space(
            M[k], g[k], J_s[k], J_t[k], K_x, levels, form, star, tolerance, space
        ):
            return k
        J_star[k] = space.J_star
        Lambda[k] = space.Lambda
        stiffness[k] = space.stiffness
        joint_from_base[k] = space.joint_from_base
        gravity[k] = space.gravity
        lift[k] = space.lift
    return -1


@njit(cache=True)
def task_torque(J_star, stiffness, error, gravity, out):
    """out = J*ᵀ S error + gravity, Eqs. (11), (17)."""
    m, n = J_star.shape
    for j in range(n):
        out[j] = gravity[j]
    for r in range(m):
        force = 0.0
        for s in range(m):
            force += stiffness[r, s] * error[s]
        for j in range(n):
            out[j] += J_star[r, j] * force


def warm() -> None:
    """Compile every kernel of this module."""
    space = allocate(2, 1, 1, m=1)
    operational_spaces(
        np.eye(2)[None],
        np.zeros((1, 2)),
        np.array([[[1.0, 0.5]]]),
        np.array([[[0.0, 1.0]]]),
        np.eye(1),
        np.array([0, 1]),
        SYMMETRIC,
        False,
        1e-10,
        space,
        (
            np.zeros((1, 1, 1)),
            np.zeros((1, 1, 1)),
            np.zeros((1, 1, 1)),
            np.zeros((1, 2, 1)),
            np.zeros((1, 1)),
            np.zeros((1, 1, 2)),
        ),
    )
    task_torque(space.J_star, space.stiffness, np.zeros(1), space.gravity, np.zeros(1))
