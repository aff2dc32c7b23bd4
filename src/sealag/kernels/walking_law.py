"""Kernels of the walking law: task torques, planned joint rates, command.

The robot's terms are those of one instant; feet are point contacts (3 rows each), 0 left, 1 right.
"""

import math
from typing import NamedTuple

import numpy as np

from sealag.constants import GRAVITY
from sealag.kernels._jit import entry, inner, shared
from sealag.kernels.dynamics import Frames, Mounts, Terms, Tree, frame_terms
from sealag.kernels.linalg import (
    cholesky,
    copy,
    invert_spd,
    least_squares,
    multiply,
    multiply_transposed,
)
from sealag.kernels.spatial import rotate, rotation
from sealag.kernels.walking import quintic_values
from sealag.typing import Array

_TURN = 10.0
"""rad/s²: the yaw's acceleration in double support at most. On Hume it takes 20 N of each foot; ten
times more slides, ten times less does not hold the heading."""


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
    heading_stiffness: float  # 1/s², in double support
    heading_damping: float  # 1/s
    planned: float  # share of the planned acceleration
    position_rate: float  # at which swing errors enter the planned rates, 1/s
    damping: float  # of the solutions, see `linalg.least_squares`


class Lead(NamedTuple):
    """Means by which springs and motors carry the task torque."""

    keep: float  # share of the average that is kept from tick to tick
    time: float  # time constant of the lead, s; 0 without
    forward: float  # 1.0 if velocities are fed forward
    feedback: float  # gain of the torque feedback


class Springs(NamedTuple):
    """Springs, motors and drives."""

    stiffness: Array  # (n,) K, Nm/rad
    damping: Array  # (n,) D_θ of the drives, Nms/rad
    lag: Array  # (n,) D_θ / K, s
    limit: Array  # (n,) largest torque, Nm
    table: Array  # (n, 2, 4) exact motor step: of θ, θ̇, force and force rate


class Flight(NamedTuple):
    """Ring of the commands that were sent."""

    arrival: Array  # (k,) expected, s
    command: Array  # (k, n) Nm


class Scratch(NamedTuple):
    """Memory of the walking kernels, of at most c = 6 contact rows."""

    M_inverse: Array  # (nv, nv)
    factor: Array  # (nv, nv)
    X: Array  # (c, nv)
    G: Array  # (c, c)
    L: Array  # (c, c)
    push: Array  # (c,)
    a_0: Array  # (nv,) acceleration without torque
    P: Array  # (nv, n) mobility
    P_t: Array  # (n, nv) its transpose
    A: Array  # (n, n)
    r: Array  # (n,)
    small: Array  # (2, n, n) of least squares
    large: Array  # (2, nv, nv) likewise
    contact: Array  # (2, 3, nv) rows of the feet, the one left behind first
    drift: Array  # (2, 3) their J̇ v
    h: Array  # (nv,) Coriolis and gravity torques
    moved: Array  # (nv,) displacement
    before: Array  # (n,) joint positions
    a: Array  # (nv,) acceleration
    rows: Array  # (nv, nv) of all that is planned
    turned: Array  # (n, nv) task rows on the other foot
    b_t: Array  # (n,) J̇_t v
    wanted: Array  # (n,) task accelerations
    back: Array  # (n,) torque on the other foot
    velocity: Array  # (nv,) planned
    solution: Array  # (nv,)
    heading: Array  # (2, 3) forward and left


class Biped(NamedTuple):
    """A walking robot as its controller believes it to be, and what the controller carries on."""

    tree: Tree
    terms: Terms
    mounts: Mounts  # of both feet
    feet: Frames
    springs: Springs
    flight: Flight
    gains: Gains
    lead: Lead
    q: Array  # (13,) configuration
    v: Array  # (12,) velocity
    motor: Array  # (n, 2) angles and speeds
    anchor: Array  # (2, 3) where the feet stand, m
    tau_sea: Array  # (n,) spring torques, Nm
    tau: Array  # (n,) task torques, Nm
    rates: Array  # (n,) planned joint rates, rad/s
    smooth: Array  # (n,) average of the task torques over the lead's time constant, Nm
    scratch: Scratch


def allocate_scratch(nv: int, n: int) -> Scratch:
    """Return memory of the walking kernels."""
    c = 6
    return Scratch(
        M_inverse=np.zeros((nv, nv)), factor=np.zeros((nv, nv)), X=np.zeros((c, nv)),
        G=np.zeros((c, c)), L=np.zeros((c, c)), push=np.zeros(c), a_0=np.zeros(nv),
        P=np.zeros((nv, n)), P_t=np.zeros((n, nv)), A=np.zeros((n, n)), r=np.zeros(n),
        small=np.zeros((2, n, n)), large=np.zeros((2, nv, nv)), contact=np.zeros((2, 3, nv)),
        drift=np.zeros((2, 3)), h=np.zeros(nv), moved=np.zeros(nv), before=np.zeros(n),
        a=np.zeros(nv), rows=np.zeros((nv, nv)), turned=np.zeros((n, nv)), b_t=np.zeros(n),
        wanted=np.zeros(n), back=np.zeros(n), velocity=np.zeros(nv), solution=np.zeros(nv),
        heading=np.zeros((2, 3)),
    )  # fmt: skip


@shared
def constrain(M_inverse, h, J, b, scratch):
    """Write a_0 and P of v̇ = a_0 + P τ under the contact rows J v̇ = −b.

    Args:
        M_inverse: (nv, nv).
        h: (nv,) Coriolis and gravity torques.
        J: (c, nv) contact rows.
        b: (c,) J̇ v.
        scratch: a_0 (nv,) is written, not finite if the rows depend on each other; P (nv, n) of the
            n actuated joints, the last velocities, is written.
    """
    count, nv = J.shape
    a_0, P, L, push = scratch.a_0, scratch.P, scratch.L, scratch.push
    X, G, n = scratch.X[:count], scratch.G[:count, :count], P.shape[1]
    multiply(J, M_inverse, X)
    multiply_transposed(X, J, G)
    if not cholesky(G, L):
        a_0[:] = np.nan
        return
    for r in range(count):
        push[r] = b[r]
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
def task_torques(scratch, J_t, wanted, damping, tau):
    """Write τ (n,) that gives the tasks the accelerations wanted.

    Args:
        scratch: a_0 and P from `constrain`, and b_t = J̇_t v.
        J_t: (n, nv) as many task rows as joints.
        wanted: (n,) task accelerations.
        damping: see `least_squares`.
        tau: (n,) Nm, written.
    """
    a_0, A, r = scratch.a_0, scratch.A, scratch.r
    multiply(J_t, scratch.P, A)
    for i in range(r.size):
        s = wanted[i] - scratch.b_t[i]
        for c in range(a_0.size):
            s -= J_t[i, c] * a_0[c]
        r[i] = s
    least_squares(A, r, damping, tau, scratch.small)


@inner
def _posture(R, v, heading):
    """Write the heading (2, 3) of a base rotation; return roll, pitch, yaw and the turn rate."""
    (front, _, _), (left, _, _), (slope, tilt, up) = R
    yaw = math.atan2(left, front)
    heading[0, 0], heading[0, 1] = math.cos(yaw), math.sin(yaw)
    heading[1, 0], heading[1, 1] = -math.sin(yaw), math.cos(yaw)
    heading[0, 2], heading[1, 2] = 0.0, 0.0
    pitch = math.asin(min(1.0, max(-1.0, -slope)))
    return math.atan2(tilt, up), pitch, yaw, rotate(R, (v[3], v[4], v[5]))


@entry
def command(kept, raw_reference, first, out):
    """Write the command of one tick: task torques, carried by springs and motors.

    Args:
        kept: `Biped`, predicted.
        raw_reference: what is wanted.
        first: whether the average of the task torques begins.
        out: (6,) Nm, written.

    Returns:
        Whether the torques are finite.
    """
    return _command(kept.parts, Reference(*raw_reference), first, out)


@inner
def _command(biped, wish, first, out):
    if not law(biped, wish):
        return False
    carry(biped, first, out)
    return True


@inner
def law(biped, wish):
    """Write the task torques, and the joint rates of the planned motion.

    Six tasks: CoM height, roll, pitch, swing foot. During the weight transfer the torques of both
    single supports are blended.

    Args:
        biped: tau and rates are written.
        wish: what is wanted.

    Returns:
        Whether the torques are finite.
    """
    terms, v, gains, scratch = biped.terms, biped.v, biped.gains, biped.scratch
    stance, swing, nv = wish.stance, wish.swing, v.size
    frame_terms(terms, biped.mounts, biped.feet)
    J, p, bias, h = biped.feet.J, biped.feet.p, biped.feet.drift, scratch.h
    bend = 0.0 if wish.still else terms.com_drift[2]
    if wish.still:
        bias[:] = 0.0
    weight = terms.bodies.mass[0] * GRAVITY
    for c in range(nv):
        h[c] = weight * terms.com_jacobian[2, c] if wish.still else terms.nle[c]
    heading, other, wanted, velocity = scratch.heading, 1 - stance, scratch.wanted, scratch.velocity
    roll, pitch, yaw, (turn_x, turn_y, turn_z) = _posture(rotation(terms.rotation, 1), v, heading)
    z, z_rate, z_bend = quintic_values(wish.height, wish.height_time)
    wanted[:], velocity[:] = 0.0, 0.0
    wanted[0] = gains.planned * z_bend + gains.height_stiffness * (z - terms.com[2])
    wanted[0] += gains.height_damping * (z_rate - terms.com_velocity[2])
    for i in range(2):
        wanted[1 + i] = -gains.posture_stiffness * (pitch if i else roll)
        rate = heading[i, 0] * turn_x + heading[i, 1] * turn_y
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
    if not invert_spd(terms.M, scratch.M_inverse, scratch.factor):
        return False
    rows, turned, back = scratch.rows, scratch.turned, scratch.back
    _rows(J, terms.rotation[1], heading, terms.com_jacobian, stance, rows)
    for side in range(2 if transfer else 1):
        copy(rows[3:9], turned)
        if side == 1:
            copy(J[stance, :3], turned[3:])
        foot = stance if side == 0 else other
        _support(biped, turned, bend, foot, biped.tau if side == 0 else back)
    if transfer:
        share = wish.phase / wish.transfer_time
        for j in range(back.size):
            biped.tau[j] = share * biped.tau[j] + (1.0 - share) * back[j]
        if gains.heading_stiffness > 0.0:
            turn = -gains.heading_stiffness * yaw - gains.heading_damping * turn_z
            _turn(biped, 4.0 * share * (1.0 - share) * min(max(turn, -_TURN), _TURN))
    velocity[3], velocity[11] = z_rate, turn_z
    velocity[9], velocity[10] = terms.com_velocity[0], terms.com_velocity[1]
    least_squares(rows, velocity, gains.damping, scratch.solution, scratch.large)
    total, n = 0.0, biped.rates.size
    for j in range(n):
        biped.rates[j] = scratch.solution[nv - n + j]
        total += biped.tau[j]
    return math.isfinite(total)


@inner
def _rows(J, R, heading, com_jacobian, stance, rows):
    """Write the rows of stance foot, CoM height, posture, swing foot, CoM x and y, and yaw."""
    rows[:] = 0.0
    copy(J[stance, :3], rows[0:3])
    copy(com_jacobian[2], rows[3])
    copy(J[1 - stance, :3], rows[6:9])
    copy(com_jacobian[:2], rows[9:11])
    for c in range(3):
        rows[11, 3 + c] = R[2, c]
        for i in range(2):
            rows[4 + i, 3 + c] = heading[i, 0] * R[0, c] + heading[i, 1] * R[1, c]


@inner
def _turn(biped, wanted):
    """Add the torque that turns the base about the vertical while both feet stand.

    The feet push as a couple: CoM, roll and pitch are not accelerated.

    Args:
        biped: tau is moved.
        wanted: acceleration of the yaw, rad/s².
    """
    scratch, rows, J_t = biped.scratch, biped.scratch.rows, biped.scratch.turned
    contact, back = scratch.contact, scratch.back
    for f in range(2):
        copy(biped.feet.J[f, :3], contact[f])
        for a in range(3):
            scratch.drift[f, a] = biped.feet.drift[f, a]
    count, nv = 2 * contact.shape[1], contact.shape[2]
    constrain(
        scratch.M_inverse, scratch.h, contact.reshape(count, nv), scratch.drift.reshape(count),
        scratch,
    )  # fmt: skip
    copy(rows[3:6], J_t)
    copy(rows[9:12], J_t[3:])
    scratch.a_0[:], scratch.b_t[:], scratch.wanted[:] = 0.0, 0.0, 0.0
    scratch.wanted[5] = wanted
    task_torques(scratch, J_t, scratch.wanted, biped.gains.damping, back)
    for j in range(back.size):
        biped.tau[j] += back[j]


@inner
def _support(biped, rows, bend, stance, tau):
    """Write the torque (6,) that gives the tasks what is wanted while standing on one foot."""
    scratch, J, bias = biped.scratch, biped.feet.J, biped.feet.drift
    scratch.b_t[:] = 0.0
    scratch.b_t[0] = bend
    for a in range(3):
        scratch.b_t[3 + a] = bias[1 - stance, a]
    constrain(scratch.M_inverse, scratch.h, J[stance, :3], bias[stance, :3], scratch)
    task_torques(scratch, rows, scratch.wanted, biped.gains.damping, tau)


@inner
def carry(biped, first, command):
    """Write the command that makes springs and motors carry the task torque within its limits.

    Args:
        biped: tau is clipped, smooth is moved; planned rates and predicted spring torques are read.
        first: whether smooth begins at tau.
        command: (n,) written, Nm.
    """
    lead, springs, tau, smooth = biped.lead, biped.springs, biped.tau, biped.smooth
    for j in range(tau.size):
        tau[j] = min(max(tau[j], -springs.limit[j]), springs.limit[j])
        command[j] = tau[j]
        if first:
            smooth[j] = tau[j]
        if lead.time > 0.0:
            smooth[j] = tau[j] + lead.keep * (smooth[j] - tau[j])
            command[j] = smooth[j] + springs.lag[j] * ((tau[j] - smooth[j]) / lead.time)
        command[j] += lead.forward * springs.damping[j] * biped.rates[j]
        command[j] += lead.feedback * (tau[j] - biped.tau_sea[j])
