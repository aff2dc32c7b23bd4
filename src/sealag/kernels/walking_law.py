"""Kernels of the walking law: task torques, planned joint rates, command.

The robot's terms are those of one instant; feet are point contacts (3 rows each), 0 left, 1 right.
"""

import math

import numpy as np

from sealag.kernels._jit import entry, inner
from sealag.kernels.dynamics import Frames, Mounts, Terms, frame_terms
from sealag.kernels.linalg import (
    cholesky,
    invert_spd,
    least_squares,
    multiply,
    multiply_transposed,
)
from sealag.kernels.walking import quintic_at


@inner
def constrain(M_inverse, h, J, b, a_0, P):
    """Write a_0 (nv,), P (nv, n) of v̇ = a_0 + P τ under the contact rows J v̇ = −b.

    Args:
        M_inverse: (nv, nv).
        h: (nv,) Coriolis and gravity torques.
        J: (c, nv) contact rows.
        b: (c,) J̇ v.
        a_0: (nv,), written; not finite if the rows depend on each other.
        P: (nv, n) of the n actuated joints, the last velocities, written.
    """
    count, nv = J.shape
    n = P.shape[1]
    X, G, L = np.empty((count, nv)), np.empty((count, count)), np.zeros((count, count))
    multiply(J, M_inverse, X)
    multiply_transposed(X, J, G)
    if not cholesky(G, L):
        a_0[:] = np.nan
        return
    push = b.copy()
    for r in range(count):
        for c in range(nv):
            push[r] -= X[r, c] * h[c]
        for k in range(r):
            push[r] -= L[r, k] * push[k]
            for c in range(nv):
                X[r, c] -= L[r, k] * X[k, c]
        push[r] /= L[r, r]
        for c in range(nv):
            X[r, c] /= L[r, r]
    for i in range(nv):
        s = 0.0
        for c in range(nv):
            s -= M_inverse[i, c] * h[c]
        for r in range(count):
            s -= X[r, i] * push[r]
        a_0[i] = s
        for j in range(n):
            s = M_inverse[i, nv - n + j]
            for r in range(count):
                s -= X[r, i] * X[r, nv - n + j]
            P[i, j] = s


@inner
def task_torques(a_0, P, J_t, b_t, wanted, damping, tau):
    """Write τ (n,) that gives the tasks the accelerations wanted.

    Args:
        a_0: (nv,) acceleration without torque.
        P: (nv, n) mobility, from `constrain`.
        J_t: (n, nv) as many task rows as joints.
        b_t: (n,) J̇_t v.
        wanted: (n,) task accelerations.
        damping: see `least_squares`.
        tau: (n,) Nm, written.
    """
    n = P.shape[1]
    A, r = np.empty((n, n)), np.empty(n)
    multiply(J_t, P, A)
    for i in range(n):
        s = wanted[i] - b_t[i]
        for c in range(a_0.size):
            s -= J_t[i, c] * a_0[c]
        r[i] = s
    least_squares(A, r, damping, tau)


@inner
def _posture(R, v, heading):
    """Write the heading (2, 3) of a base rotation; return roll, pitch and the turn rates (3,)."""
    yaw = math.atan2(R[1, 0], R[0, 0])
    heading[0, 0], heading[0, 1] = math.cos(yaw), math.sin(yaw)
    heading[1, 0], heading[1, 1] = -math.sin(yaw), math.cos(yaw)
    heading[0, 2], heading[1, 2] = 0.0, 0.0
    turn = np.zeros(3)
    for a in range(3):
        for c in range(3):
            turn[a] += R[a, c] * v[3 + c]
    pitch = math.asin(min(1.0, max(-1.0, -R[2, 0])))
    return math.atan2(R[2, 1], R[2, 2]), pitch, turn


@entry
def law(raw_terms, raw_mounts, v, h, still, height, swing, phase, clock, stance, gains, tau, rates):
    """Write the task torques, and the joint rates of the planned motion.

    Six tasks: CoM height, roll, pitch, swing foot. During the weight transfer the torques of both
    single supports are blended.

    Args:
        raw_terms: of the robot.
        raw_mounts: of both feet.
        v: (12,) velocity.
        h: (12,) Coriolis and gravity torques.
        still: whether J̇ v counts as zero.
        height: (6,) quintic of the CoM height.
        swing: (3, 3) position, velocity, acceleration of the swing foot's reference.
        phase: of the step, s.
        clock: weight transfer and time of the height's quintic, s.
        stance: foot stood on.
        gains: stiffness (3) of height, posture and swing foot, 1/s²; damping (3), 1/s; share of the
            planned acceleration; rate at which swing errors enter the planned rates, 1/s; damping
            of the solutions.
        tau: (6,) written, Nm.
        rates: (6,) written, rad/s.

    Returns:
        Whether the torques are finite.
    """
    terms, nv = Terms(*raw_terms), v.size
    frames = Frames(np.empty((2, 6, nv)), np.empty((2, 3, 3)), np.empty((2, 3)), np.zeros((2, 6)))
    frame_terms(terms, Mounts(*raw_mounts), frames)
    J, p, bias = frames.J, frames.p, frames.drift
    bend = 0.0 if still else terms.com_drift[2]
    if still:
        bias[:] = 0.0
    heading, z, other = np.empty((2, 3)), np.empty(3), 1 - stance
    roll, pitch, turn = _posture(terms.rotation[1], v, heading)
    quintic_at(height, clock[1], z)
    wanted, velocity = np.zeros(6), np.zeros(12)
    wanted[0] = gains[6] * z[2] + gains[0] * (z[0] - terms.com[2])
    wanted[0] += gains[3] * (z[1] - terms.com_velocity[2])
    for i in range(2):
        wanted[1 + i] = -gains[1] * (pitch if i else roll)
        wanted[1 + i] -= gains[4] * (heading[i, 0] * turn[0] + heading[i, 1] * turn[1])
    transfer = phase < clock[0]
    if not transfer:
        for a in range(3):
            error, speed = swing[0, a] - p[other, a], swing[1, a]
            for c in range(nv):
                speed -= J[other, a, c] * v[c]
            wanted[3 + a] = gains[6] * swing[2, a] + gains[2] * error + gains[5] * speed
            velocity[6 + a] = swing[1, a] + gains[7] * error
    M_inverse, factor = np.empty((nv, nv)), np.empty((nv, nv))
    if not invert_spd(terms.M, M_inverse, factor):
        return False
    rows = np.zeros((12, nv))
    _rows(J, terms.rotation[1], heading, terms.com_jacobian, stance, rows)
    _support(M_inverse, h, J, bias, rows[3:9], bend, stance, wanted, gains[8], tau)
    if transfer:
        back, share = np.empty(6), phase / clock[0]
        turned = rows[3:9].copy()
        turned[3:] = J[stance, :3]
        _support(M_inverse, h, J, bias, turned, bend, other, wanted, gains[8], back)
        for j in range(6):
            tau[j] = share * tau[j] + (1.0 - share) * back[j]
    velocity[3], velocity[9:11], velocity[11] = z[1], terms.com_velocity[:2], turn[2]
    solution = np.empty(12)
    least_squares(rows, velocity, gains[8], solution)
    rates[:] = solution[6:]
    return math.isfinite(tau.sum())


@inner
def _rows(J, R, heading, com_jacobian, stance, rows):
    """Write the rows of stance foot, CoM height, posture, swing foot, CoM x and y, and yaw."""
    rows[0:3], rows[3] = J[stance, :3], com_jacobian[2]
    rows[6:9], rows[9:11] = J[1 - stance, :3], com_jacobian[:2]
    for c in range(3):
        rows[11, 3 + c] = R[2, c]
        for i in range(2):
            rows[4 + i, 3 + c] = heading[i, 0] * R[0, c] + heading[i, 1] * R[1, c]


@inner
def _support(M_inverse, h, J, bias, rows, bend, stance, wanted, damping, tau):
    """Write the torque (6,) that gives the tasks ``wanted`` while standing on one foot."""
    a_0, P, b_t = np.empty(h.size), np.empty((h.size, 6)), np.zeros(6)
    b_t[0], b_t[3:] = bend, bias[1 - stance, :3]
    constrain(M_inverse, h, J[stance, :3], bias[stance, :3], a_0, P)
    task_torques(a_0, P, rows, b_t, wanted, damping, tau)


@entry
def carry(tau, limit, smooth, rates, tau_sea, D, D_by_K, gains, command):
    """Write the command that makes springs and motors carry the task torque within its limits.

    Args:
        tau: (n,) task torque, clipped, Nm.
        limit: (n,) largest torque, Nm.
        smooth: (n,) its average over the lead's time constant, moved.
        rates: (n,) planned joint rates, rad/s.
        tau_sea: (n,) predicted spring torques, Nm.
        D: (n,) embedded damping.
        D_by_K: (n,) D_θ / K, s.
        gains: share of the average that is kept, and time constant (s, 0 without lead); whether
            velocities are fed forward; gain of the torque feedback.
        command: (n,) written, Nm.
    """
    for j in range(tau.size):
        tau[j] = min(max(tau[j], -limit[j]), limit[j])
        command[j] = tau[j]
        if gains[1] > 0.0:
            smooth[j] = tau[j] + gains[0] * (smooth[j] - tau[j])
            command[j] = smooth[j] + D_by_K[j] * ((tau[j] - smooth[j]) / gains[1])
        command[j] += gains[2] * D[j] * rates[j] + gains[3] * (tau[j] - tau_sea[j])
