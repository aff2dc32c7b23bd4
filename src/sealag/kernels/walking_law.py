"""Kernels of the walking law: task torques, planned joint rates, command.

The robot's terms are those of one instant; feet are point contacts (3 rows each), 0 left, 1 right.
"""

import math
from typing import NamedTuple

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
from sealag.typing import Array


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


class Reference(NamedTuple):
    """What is wanted now."""

    height: Array  # (6,) quintic of the CoM's height
    height_time: float  # its time, s
    swing: Array  # (3, 3) position, velocity, acceleration of the swing foot's reference
    phase: float  # of the step, s
    transfer_time: float  # duration of the weight transfer from phase 0, s
    stance: int  # foot stood on
    still: bool  # whether J̇ v counts as zero


class Gains(NamedTuple):
    """Gains of the walking law."""

    height_stiffness: float  # 1/s²
    posture_stiffness: float  # 1/s²
    swing_stiffness: float  # 1/s²
    height_damping: float  # 1/s
    posture_damping: float  # 1/s
    swing_damping: float  # 1/s
    planned: float  # share of the planned acceleration
    position_rate: float  # at which swing errors enter the planned rates, 1/s
    damping: float  # of the solutions, see `linalg.least_squares`


class Lead(NamedTuple):
    """Means by which springs and motors carry the task torque."""

    keep: float  # share of the average that is kept from tick to tick
    time: float  # time constant of the lead, s; 0 without
    forward: float  # 1.0 if velocities are fed forward
    feedback: float  # gain of the torque feedback


@entry
def law(raw_body, v, h, raw_reference, raw_gains, tau, rates):
    """Write the task torques, and the joint rates of the planned motion.

    Six tasks: CoM height, roll, pitch, swing foot. During the weight transfer the torques of both
    single supports are blended.

    Args:
        raw_body: `Terms` and the feet's `Mounts`.
        v: (12,) velocity.
        h: (12,) Coriolis and gravity torques.
        raw_reference: what is wanted.
        raw_gains: gains.
        tau: (6,) written, Nm.
        rates: (6,) written, rad/s.

    Returns:
        Whether the torques are finite.
    """
    raw_terms, raw_mounts = raw_body
    wish, gains = Reference(*raw_reference), Gains(*raw_gains)
    stance, swing = wish.stance, wish.swing
    terms, nv = Terms(*raw_terms), v.size
    frames = Frames(np.empty((2, 6, nv)), np.empty((2, 3, 3)), np.empty((2, 3)), np.zeros((2, 6)))
    frame_terms(terms, Mounts(*raw_mounts), frames)
    J, p, bias = frames.J, frames.p, frames.drift
    bend = 0.0 if wish.still else terms.com_drift[2]
    if wish.still:
        bias[:] = 0.0
    heading, z, other = np.empty((2, 3)), np.empty(3), 1 - stance
    roll, pitch, turn = _posture(terms.rotation[1], v, heading)
    quintic_at(wish.height, wish.height_time, z)
    wanted, velocity = np.zeros(6), np.zeros(12)
    wanted[0] = gains.planned * z[2] + gains.height_stiffness * (z[0] - terms.com[2])
    wanted[0] += gains.height_damping * (z[1] - terms.com_velocity[2])
    for i in range(2):
        wanted[1 + i] = -gains.posture_stiffness * (pitch if i else roll)
        rate = heading[i, 0] * turn[0] + heading[i, 1] * turn[1]
        wanted[1 + i] -= gains.posture_damping * rate
    transfer = wish.phase < wish.transfer_time
    if not transfer:
        for a in range(3):
            error, speed = swing[0, a] - p[other, a], swing[1, a]
            for c in range(nv):
                speed -= J[other, a, c] * v[c]
            wanted[3 + a] = gains.planned * swing[2, a] + gains.swing_stiffness * error
            wanted[3 + a] += gains.swing_damping * speed
            velocity[6 + a] = swing[1, a] + gains.position_rate * error
    M_inverse, factor = np.empty((nv, nv)), np.empty((nv, nv))
    if not invert_spd(terms.M, M_inverse, factor):
        return False
    rows = np.zeros((12, nv))
    _rows(J, terms.rotation[1], heading, terms.com_jacobian, stance, rows)
    _support(M_inverse, h, J, bias, rows[3:9], bend, stance, wanted, gains.damping, tau)
    if transfer:
        back, share = np.empty(6), wish.phase / wish.transfer_time
        turned = rows[3:9].copy()
        turned[3:] = J[stance, :3]
        _support(M_inverse, h, J, bias, turned, bend, other, wanted, gains.damping, back)
        for j in range(6):
            tau[j] = share * tau[j] + (1.0 - share) * back[j]
    velocity[3], velocity[9:11], velocity[11] = z[1], terms.com_velocity[:2], turn[2]
    solution = np.empty(12)
    least_squares(rows, velocity, gains.damping, solution)
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
def carry(tau, limit, smooth, rates, tau_sea, D, D_by_K, raw_lead, command):
    """Write the command that makes springs and motors carry the task torque within its limits.

    Args:
        tau: (n,) task torque, clipped, Nm.
        limit: (n,) largest torque, Nm.
        smooth: (n,) its average over the lead's time constant, moved.
        rates: (n,) planned joint rates, rad/s.
        tau_sea: (n,) predicted spring torques, Nm.
        D: (n,) embedded damping.
        D_by_K: (n,) D_θ / K, s.
        raw_lead: by which means.
        command: (n,) written, Nm.
    """
    lead = Lead(*raw_lead)
    for j in range(tau.size):
        tau[j] = min(max(tau[j], -limit[j]), limit[j])
        command[j] = tau[j]
        if lead.time > 0.0:
            smooth[j] = tau[j] + lead.keep * (smooth[j] - tau[j])
            command[j] = smooth[j] + D_by_K[j] * ((tau[j] - smooth[j]) / lead.time)
        command[j] += lead.forward * D[j] * rates[j] + lead.feedback * (tau[j] - tau_sea[j])
