"""A tick of the whole-body controller: task errors and matrices, torques, and q̄(θ)."""

import numpy as np
from numba import njit

from sealag.kernels import dynamics
from sealag.kernels.dense import multiply
from sealag.kernels.operational_space import divide, memory_size, operational_space, task_torque
from sealag.kernels.rigid import integrate

OF_FRAME, OF_MASS, OF_JOINT = 0, 1, 2


@njit(cache=True)
def law(tree, terms, seen, tasks, gains, state, results, memory, sizes):
    """Write the torque J*ᵀ S x̃ + ḡ at given joint angles, and everything that it is made of.

    The base follows the joints along the contact-consistent motions from the measured state.

    Args:
        tree: the robot, as `sealag.robot.Robot.tree`.
        terms: its terms, as `dynamics.allocate` returns them, written.
        seen: how the contacts' frames, then the tasks', are fixed (4 arrays, see
            `sealag.robot.Robot.frame_mounts`), and their J, R, p and bias as in
            `dynamics.frames`, written.
        tasks: rows of contacts (c, 2): frame and its row; rows of tasks (m, 3): OF_FRAME, OF_MASS
            or OF_JOINT, frame, row of it; the levels' first rows (k + 1,); wanted rotations
            (F, 3, 3) and positions (F, 3) of frames, and values of the other rows (m,).
        gains: K_x (m, m), planned gravity compensation (n,); form, star and tolerance as in
            `operational_space`; whether tasks leave errors to higher ones; whether gravity
            compensation is of the given joint angles instead of planned.
        state: measured configuration (nq,), joint angles (n,), contact-consistent motions (nv, n),
            offset of the references (m,).
        results: J_s (c, nv), J_t (m, nv), x̃ (m,), x_d (m,) about the posture's, torque (n,).
        memory: of the operational space, as `divide` divides it, written.
        sizes: nv, n, c, m.

    Returns:
        False if the mass matrix is not positive definite.
    """
    J, R, p, bias = seen[4:]
    contact_rows, levels = tasks[0], tasks[2]
    K_x, planned, form, star, tolerance, consistent, fed_back = gains
    q, joints, along, offset = state
    J_s, J_t, error, wanted, out = results
    nv, n, c, m = sizes
    space = divide(memory, nv, n, c, m)
    shift, there, still = np.zeros(nv), np.empty(q.size), np.zeros(nv)
    for i in range(n):
        away = joints[i] - q[q.size - n + i]
        for k in range(nv):
            shift[k] += along[k, i] * away
    integrate(q, shift, nv - n, there)
    dynamics.evaluate(tree, there, still, terms)
    dynamics.frames(terms, seen[:4], J, R, p, bias)
    for r in range(c):
        J_s[r] = J[contact_rows[r, 0], contact_rows[r, 1]]
    _read_tasks(terms, seen[4:], tasks, there[q.size - n :], J_t, error)
    if not operational_space(
        terms[0], terms[1], J_s, J_t, K_x, levels, form, star, tolerance, space
    ):
        return False
    for r in range(m):
        error[r] += offset[r]
        wanted[r] = offset[r]
    if consistent and levels.size > 2:
        leave_to_higher(J_t, space.lift, levels, error, shift)
        leave_to_higher(J_t, space.lift, levels, wanted, shift)
    task_torque(space.J_star, space.stiffness, error, space.gravity if fed_back else planned, out)
    return True


@njit(cache=True)
def _read_tasks(terms, placed, tasks, joints, J_t, error):
    """Write Jacobians and errors of all task rows."""
    J, R, p, _ = placed
    _, task_rows, _, R_wanted, p_wanted, x_wanted = tasks
    base = J_t.shape[1] - joints.size
    both, last = np.empty(6), -1
    for r in range(error.size):
        kind, frame, row = task_rows[r, 0], task_rows[r, 1], task_rows[r, 2]
        if kind == OF_FRAME:
            if frame != last:
                frame_error(R_wanted[frame], p_wanted[frame], R[frame], p[frame], both)
                last = frame
            J_t[r], error[r] = J[frame, row], both[row]
        elif kind == OF_MASS:
            J_t[r], error[r] = terms[8][row], x_wanted[r] - terms[7][0, row]
        else:
            J_t[r], error[r] = 0.0, x_wanted[r] - joints[row]
            J_t[r, base + row] = 1.0


@njit(cache=True)
def leave_to_higher(J_t, lift, levels, error, motion):
    """Take out of each task's error what the tasks above it will remove, in place.

    x̃_{k|prec} = x̃_k − J_k Σ_{i<k} P_i J_iᵀ Λ_i x̃_{i|prec}. Where J̇ = 0 its rate is
    −J*_{k|prec} q̇_j, so that J*_{k|prec}ᵀ S_k x̃_{k|prec} is the gradient of ½ x̃ᵀ S x̃.

    Args:
        J_t: (m, nv) task Jacobians.
        lift: (m, nv) of the `Space`.
        levels: (k + 1,) first row of each level, then m.
        error: (m,), overwritten.
        motion: (nv,) scratch.
    """
    nv = J_t.shape[1]
    motion[:] = 0.0
    for k in range(len(levels) - 1):
        for r in range(levels[k], levels[k + 1]):
            for i in range(nv):
                error[r] -= J_t[r, i] * motion[i]
        for r in range(levels[k], levels[k + 1]):
            for i in range(nv):
                motion[i] += lift[r, i] * error[r]


@njit(cache=True)
def frame_error(R_wanted, p_wanted, R, p, out):
    """Position and rotation that lead from a frame's placement to the wanted one, world axes.

    Args:
        R_wanted: (3, 3).
        p_wanted: (3,).
        R: (3, 3).
        p: (3,).
        out: (6,) p_wanted − p, then the rotation vector of R_wanted Rᵀ, of length 0 … π.
    """
    out[:3] = 0.0
    trace = 0.0
    for k in range(3):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            out[i] += 0.5 * (R_wanted[b, k] * R[a, k] - R_wanted[a, k] * R[b, k])
            trace += R_wanted[i, k] * R[i, k]
    sine = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    cosine = 0.5 * (trace - 1.0)
    angle = np.arctan2(sine, cosine)
    if cosine > -0.99:
        scale = angle / sine if sine > 1e-9 else 1.0
        for i in range(3):
            out[3 + i] = scale * out[i]
    else:
        _turn_about(R_wanted, R, cosine, angle, out)
    for i in range(3):
        out[i] = p_wanted[i] - p[i]


@njit(cache=True)
def _turn_about(R_wanted, R, cosine, angle, out):
    """out[3:] = angle · axis near half a turn, from E + Eᵀ = 2 cos I + 2 (1 − cos) a aᵀ.

    out[:3] holds sin · a, which tells a from −a.
    """
    best, column = -1.0, 0
    for j in range(3):
        diagonal = 0.0
        for k in range(3):
            diagonal += R_wanted[j, k] * R[j, k]
        if diagonal > best:
            best, column = diagonal, j
    length, side = 0.0, 0.0
    for i in range(3):
        entry = 0.0
        for k in range(3):
            entry += 0.5 * (R_wanted[i, k] * R[column, k] + R_wanted[column, k] * R[i, k])
        out[3 + i] = entry - cosine if i == column else entry
        length += out[3 + i] * out[3 + i]
        side += out[3 + i] * out[i]
    scale = (angle if side >= 0.0 else -angle) / np.sqrt(length)
    for i in range(3):
        out[3 + i] *= scale


@njit(cache=True)
def gravity_slope(tree, terms, along, H, work, out):
    """Write ∂ḡ/∂q_j along the contact-consistent motions, with these motions frozen: Wᵀ H W.

    Args:
        tree: as in `law`.
        terms: as `law` left them.
        along: (nv, n) W.
        H: (nv, nv) scratch.
        work: (nv, n) scratch.
        out: (n, n) Nm/rad, written.
    """
    dynamics.gravity_gradient(tree, terms, H)
    multiply(H, along, work)
    nv, n = along.shape
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(nv):
                total += along[k, i] * work[k, j]
            out[i, j] = total


@njit(cache=True)
def static_step(J_star, moved, stiffness, slope, K, torque, sag, work, step):
    """One Newton step towards K (θ − q̄) = l(q̄), Eqs. (15), (16), with sag = q̄ − θ.

    (K − J*ᵀ S J + ∂ḡ/∂q) δ = −K sag − l by elimination, −J the errors' Jacobian; then
    sag ← sag + δ. Where the fixed point is a contraction every pivot is positive.

    Args:
        J_star: (m, n).
        moved: (m, n) J: J* itself where lower tasks leave errors to higher ones.
        stiffness: (m, m) S.
        slope: (n, n) ∂ḡ/∂q of the gravity compensation, 0 if it is not fed back.
        K: (n,) spring stiffness.
        torque: (n,) l at θ + sag.
        sag: (n,), moved.
        work: (n, n) scratch.
        step: (n,) δ.

    Returns:
        False if a pivot is not positive: the task is stiffer than the springs.
    """
    m, n = J_star.shape
    work[:, :] = slope
    for r in range(m):
        for s in range(m):
            entry = stiffness[r, s]
            if entry != 0.0:
                for i in range(n):
                    factor = entry * J_star[r, i]
                    for j in range(n):
                        work[i, j] -= factor * moved[s, j]
    for i in range(n):
        work[i, i] += K[i]
        step[i] = -K[i] * sag[i] - torque[i]
    for p in range(n):
        if not work[p, p] > 1e-12 * K[p]:
            return False
        for i in range(p + 1, n):
            factor = work[i, p] / work[p, p]
            step[i] -= factor * step[p]
            for j in range(p + 1, n):
                work[i, j] -= factor * work[p, j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            step[i] -= work[i, j] * step[j]
        step[i] /= work[i, i]
        sag[i] += step[i]
    return True


def warm() -> None:
    """Compile every kernel of this module."""
    leave_to_higher(np.zeros((1, 2)), np.zeros((1, 2)), np.array([0, 1]), np.zeros(1), np.zeros(2))
    J, S, K = np.zeros((1, 1)), np.zeros((1, 1)), np.ones(1)
    static_step(J, J, S, J, K, np.zeros(1), np.zeros(1), np.zeros((1, 1)), np.zeros(1))
    nv, c, m = 7, 3, 1
    (tree, terms), one, row = dynamics.example(nv), np.zeros(1), np.zeros((1, 3), np.int64)
    mounts = np.ones(1, np.int64), np.eye(3)[None], np.zeros((1, 3)), np.ones((1, nv), np.int64)
    placed = np.zeros((1, 6, nv)), np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, 6))
    rows = np.zeros((c, 2), np.int64)
    rows[:, 1] = np.arange(c)
    q = np.zeros(8)
    q[6] = 1.0
    wide = np.zeros((nv, 1))
    gravity_slope(tree, terms, wide, np.zeros((nv, nv)), wide.copy(), np.zeros((1, 1)))
    law(
        tree, terms, (*mounts, *placed), (rows, row, np.arange(2), placed[1], placed[2], one),
        (np.eye(m), one, 0, False, 1e-9, True, False), (q, one, np.zeros((nv, 1)), one),
        (np.zeros((c, nv)), np.zeros((m, nv)), one.copy(), one.copy(), one.copy()),
        np.zeros(memory_size(nv, 1, c, m)), (nv, 1, c, m),
    )  # fmt: skip
