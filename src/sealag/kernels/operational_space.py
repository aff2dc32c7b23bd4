"""Contact-consistent, prioritised operational space at one instant, on preallocated arrays."""

from typing import NamedTuple

import numpy as np

from sealag.kernels._jit import entry, inner, summing
from sealag.kernels.linalg import (
    copy,
    invert_spd,
    multiply,
    multiply_transposed,
    pseudo_inverse,
    pseudo_inverse_psd,
    trace,
)
from sealag.typing import Array, IntArray

SYMMETRIC, PUBLISHED, FORCE = 0, 1, 2


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
    phi: Array  # (n, n) φ* = U P_1 Uᵀ
    phi_inverse: Array  # (n, n)
    phi_copy: Array  # (n, n) scratch
    scratch_n: Array  # (5, n²)
    contact_mobility: Array  # (c, c) J_s M⁻¹ J_sᵀ
    contact_inertia: Array  # (c, c) its pseudo-inverse
    scratch_c: Array  # (5, c²)
    square_m: Array  # (5, m²) scratch
    scratch_m: Array  # (5, m²)
    moved_c: Array  # (c, nv) J_s M⁻¹
    wide_c: Array  # (c, nv) scratch
    wide_m: Array  # (m, nv)
    low_m: Array  # (m, n)
    tall_n: Array  # (nv, n)
    values: Array  # (max(n, c, m),)


class StackedTerms(NamedTuple):
    """What N operational spaces are made of."""

    M: Array  # (N, nv, nv) mass matrices
    g: Array  # (N, nv) gravity torques
    J_s: Array  # (N, c, nv) contact Jacobians
    J_t: Array  # (N, m, nv) task Jacobians


class StackedSpaces(NamedTuple):
    """Results of `operational_spaces` at N instants."""

    J_star: Array  # (N, m, n)
    Lambda: Array  # (N, m, m)
    stiffness: Array  # (N, m, m)
    along: Array  # (N, nv, n) motions of the whole robot per joint rate
    gravity: Array  # (N, n)
    lift: Array  # (N, m, nv) rows of Λ_k J_k P_k


class Stack(NamedTuple):
    """N operational spaces, one after the other."""

    terms: StackedTerms
    K_x: Array  # as in `operational_space`, with levels, form, star and tolerance
    levels: IntArray
    form: int
    star: bool
    tolerance: float
    out: StackedSpaces  # written
    space: Space  # scratch


def allocate(nv: int, n: int, c: int, *, m: int) -> Space:
    """Return the arrays of one operational space.

    Args:
        nv: number of velocities.
        n: number of actuated joints.
        c: number of contact rows.
        m: number of task rows.
    """
    return Space(
        J_star=np.zeros((m, n)), Lambda=np.zeros((m, m)), stiffness=np.zeros((m, m)),
        joint_from_base=np.zeros((nv, n)), lift=np.zeros((m, nv)), gravity=np.zeros(n),
        M_inverse=np.zeros((nv, nv)), P=np.zeros((nv, nv)), phi=np.zeros((n, n)),
        phi_inverse=np.zeros((n, n)), phi_copy=np.zeros((n, n)), scratch_n=np.zeros((5, n * n)),
        contact_mobility=np.zeros((c, c)), contact_inertia=np.zeros((c, c)),
        scratch_c=np.zeros((5, c * c)), square_m=np.zeros((5, m * m)),
        scratch_m=np.zeros((5, m * m)), moved_c=np.zeros((c, nv)), wide_c=np.zeros((c, nv)),
        wide_m=np.zeros((m, nv)), low_m=np.zeros((m, n)),
        tall_n=np.zeros((nv, n)), values=np.zeros(max(n, c, m, 1)),
    )  # fmt: skip


@inner
def _subtract_projection(P, X, lift):
    """P ← P − Xᵀ A⁺ X, symmetric, with X (k, nv) and lift = A⁺ X (k, nv)."""
    k, nv = X.shape
    for r in range(k):
        for i in range(nv):
            x = X[r, i]
            if x != 0.0:
                for j in range(i + 1):
                    P[i, j] -= x * lift[r, j]
    for i in range(nv):
        for j in range(i):
            P[j, i] = P[i, j]


@inner
def _constrain(M, J_s, tolerance, space):
    """P = N_s M⁻¹, the inverse inertia that the contacts leave; False if M is not positive."""
    if not invert_spd(M, space.M_inverse, space.P):
        return False
    P = space.P
    copy(space.M_inverse, P)
    if J_s.shape[0] == 0:
        return True
    X, scratch = space.moved_c, space.wide_c
    A, A_inverse = space.contact_mobility, space.contact_inertia
    multiply(J_s, P, X)
    multiply_transposed(X, J_s, A)
    threshold = tolerance * trace(A)
    pseudo_inverse(A, threshold, A_inverse, space.scratch_c, space.values)
    multiply(A_inverse, X, scratch)
    _subtract_projection(P, X, scratch)
    return True


@inner
def _is_scalar(K):
    """Whether K (k, k) is a multiple of the identity, exactly."""
    for i in range(K.shape[0]):
        for j in range(K.shape[1]):
            if K[i, j] != (K[0, 0] if i == j else 0.0):
                return False
    return True


@inner
def _inertia(H, threshold, needs_root, Lambda, root, scratch, space):
    """Λ = H⁺ of one level, and its root Λ^½ if that is needed; H is overwritten."""
    if needs_root:
        pseudo_inverse_psd(H, threshold, Lambda, root, space.values, scratch)
    else:
        pseudo_inverse(H, threshold, Lambda, space.scratch_m, space.values)


@inner
def _stiffness_block(form, needs_root, K, Lambda, root, scratch, out):
    """The task stiffness of one level: Λ^½ K Λ^½, which is Λ K for a scalar K; Λ K; or K."""
    if needs_root:
        multiply(K, root, scratch)
        multiply(root, scratch, out)
    elif form == FORCE:
        copy(K, out)
    else:
        multiply(Lambda, K, out)


@inner
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
    phi, phi_inverse, work = space.phi, space.phi_inverse, space.phi_copy
    scale = 0.0
    for i in range(n):
        scale += space.M_inverse[base + i, base + i]
        for j in range(n):
            phi[i, j] = P[base + i, base + j]
            work[i, j] = phi[i, j]
    pseudo_inverse(work, tolerance * scale, phi_inverse, space.scratch_n, space.values)
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


@summing
def _mobility(J, M_inverse):
    """trace(J M⁻¹ Jᵀ): the scale against which a lost direction is small."""
    total = 0.0
    for r in range(J.shape[0]):
        for i in range(J.shape[1]):
            if J[r, i] != 0.0:
                for j in range(J.shape[1]):
                    total += J[r, i] * M_inverse[i, j] * J[r, j]
    return total


@inner
def _level(J_t, K_x, first, last, form, star, tolerance, space):
    """One priority level: J*, its stiffness, and what is left for the next level."""
    size = last - first
    if size == 0:
        return
    P, phi_inverse = space.P, space.phi_inverse
    nv, n = space.joint_from_base.shape
    base = nv - n
    X, lift = space.wide_m[:size], space.lift[first:last]
    multiply(J_t[first:last], P, X)
    H = space.square_m[0][: size * size].reshape(size, size)
    Lambda = space.square_m[1][: size * size].reshape(size, size)
    root = space.square_m[2][: size * size].reshape(size, size)
    vectors = space.square_m[3][: size * size].reshape(size, size)
    block = space.square_m[4][: size * size].reshape(size, size)
    multiply_transposed(X, J_t[first:last], H)
    threshold = tolerance * _mobility(J_t[first:last], space.M_inverse)
    K = K_x[first:last, first:last]
    needs_root = form == SYMMETRIC and not _is_scalar(K)
    _inertia(H, threshold, needs_root, Lambda, root, vectors, space)
    for r in range(size):
        for j in range(n):
            total = 0.0
            for p in range(n):
                total += X[r, base + p] * phi_inverse[p, j]
            space.J_star[first + r, j] = total
    multiply(Lambda, X, lift)
    if last < space.lift.shape[0]:
        _subtract_projection(P, X, lift)
    if star:
        J_phi = space.low_m[:size]
        multiply(space.J_star[first:last], space.phi, J_phi)
        multiply_transposed(J_phi, space.J_star[first:last], H)
        _inertia(H, threshold, needs_root, Lambda, root, vectors, space)
    for i in range(size):
        for j in range(size):
            vectors[i, j] = K[i, j]
    _stiffness_block(form, needs_root, vectors, Lambda, root, H, block)
    for i in range(size):
        for j in range(size):
            space.stiffness[first + i, first + j] = block[i, j]
            space.Lambda[first + i, first + j] = Lambda[i, j]


@entry
def operational_spaces(stack):
    """`operational_space` at the instants of a kept `Stack`.

    Returns:
        The first instant at which M is not positive definite, or -1.
    """
    return _operational_spaces(stack.parts)


@inner
def _operational_spaces(stack):
    terms, out, space = stack.terms, stack.out, stack.space
    for k in range(terms.M.shape[0]):
        if not operational_space(
            terms.M[k], terms.g[k], terms.J_s[k], terms.J_t[k], stack.K_x, stack.levels,
            stack.form, stack.star, stack.tolerance, space,
        ):  # fmt: skip
            return k
        copy(space.J_star, out.J_star[k])
        copy(space.Lambda, out.Lambda[k])
        copy(space.stiffness, out.stiffness[k])
        copy(space.joint_from_base, out.along[k])
        copy(space.gravity, out.gravity[k])
        copy(space.lift, out.lift[k])
    return -1


@inner
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
