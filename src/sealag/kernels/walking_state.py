"""Kernels of the walking controller's state: leg odometry, and prediction over the delay.

The robot's terms are those of one instant; feet are point contacts (3 rows each), 0 left, 1 right.
"""

from typing import NamedTuple

import numpy as np

from sealag.kernels._jit import entry, inner
from sealag.kernels.dynamics import Frames, Mounts, Terms, Tree, frame_terms, rigid_body_terms
from sealag.kernels.linalg import invert_spd
from sealag.kernels.spatial import integrate
from sealag.kernels.walking_law import constrain
from sealag.typing import Array


class Links(NamedTuple):
    """Terms of the links at the measured instant; feet in the order left behind, stood on."""

    M: Array  # (nv, nv) mass matrix
    h: Array  # (nv,) Coriolis and gravity torques
    J: Array  # (2, 3, nv) of the feet
    drift: Array  # (2, 3) J̇ v


class Support(NamedTuple):
    """Where the feet stand."""

    stance: int  # foot stood on
    foot: int  # which one the odometry stands on, or −1
    anchor: Array  # (2, 3) where the feet stand, m


class Springs(NamedTuple):
    """Springs and motors."""

    stiffness: Array  # (n,) Nm/rad
    table: Array  # (n, 2, 4) exact motor step: of θ, θ̇, force and force rate


class Timing(NamedTuple):
    """From when to when the state is predicted."""

    measured: float  # instant of the measurement, s
    period: float  # s
    ticks: int  # periods to predict; if negative, v is extrapolated as many periods
    touchdown: float  # instant at which the new foot touches down, s
    lift_off: float  # instant at which the old foot lifts off, s


class Flight(NamedTuple):
    """Ring of the commands that were sent."""

    arrival: Array  # (k,) expected, s
    command: Array  # (k, n) Nm
    newest: int  # place of the newest


@inner
def predict(links, q_joint, v, motor, springs, timing, flight):
    """Predict links, springs and motors under the commands still in flight.

    The links' terms are frozen at the measured instant; the motors move exactly between ticks
    with the link angle linear over a tick.

    Args:
        links: their terms.
        q_joint: (n,) link-side joint positions.
        v: (nv,) velocity; moved.
        motor: (n, 2) motor angles and speeds; moved.
        springs: springs and motors.
        timing: from when to when.
        flight: the commands.

    Returns:
        (nv,) displacement in the tangent space of the measured configuration.
    """
    K, table, period = springs.stiffness, springs.table, timing.period
    nv, n = v.size, K.size
    base = nv - n
    M_inverse, factor = np.empty((nv, nv)), np.empty((nv, nv))
    moved, before, a = np.zeros(nv), np.empty(n), np.empty(nv)
    a_0, P, P_t = np.empty(nv), np.empty((nv, n)), np.empty((n, nv))
    if not invert_spd(links.M, M_inverse, factor):
        moved[:] = np.nan
        return moved
    mode = -1
    for i in range(timing.ticks):
        t = timing.measured + (i + 0.5) * period
        now = 0 if t < timing.touchdown else (1 if t < timing.lift_off else 2)
        if now != mode:
            mode = now
            first, last = (1, 2) if mode == 2 else ((0, 1) if mode == 0 else (0, 2))
            rows = links.J[first:last].copy().reshape(3 * (last - first), nv)
            drift = links.drift[first:last].copy().reshape(rows.shape[0])
            constrain(M_inverse, links.h, rows, drift, a_0, P)
            P_t[:] = P.T
        k = flight.newest
        for _ in range(flight.arrival.size):
            if flight.arrival[k] <= t:
                break
            k = k - 1 if k > 0 else flight.arrival.size - 1
        a[:] = a_0
        for j in range(n):
            before[j] = q_joint[j] + moved[base + j]
            spring = K[j] * (motor[j, 0] - before[j])
            for c in range(nv):
                a[c] += P_t[j, c] * spring
        for c in range(nv):
            v[c] += period * a[c]
            moved[c] += period * v[c]
        for j in range(n):
            force, rate = flight.command[k, j] + K[j] * before[j], K[j] * v[base + j]
            theta, speed = motor[j, 0], motor[j, 1]
            for r in range(2):
                motor[j, r] = (
                    table[j, r, 0] * theta
                    + table[j, r, 1] * speed
                    + table[j, r, 2] * force
                    + table[j, r, 3] * rate
                )
    return moved


@inner
def boost(v, M, J, h, b, change):
    """Add a constant velocity to the base, and to h and J̇ v what the rotating base makes of it.

    In the base's axes a constant velocity Δ turns by −ω × Δ, so h += M_b(ω × Δ) and
    J̇v += J_b(ω × Δ), with the columns of the base's linear velocity; nothing else depends on it.

    Args:
        v: (nv,) velocity, moved.
        M: (nv, nv).
        J: (F, 6, nv), rows 0 to 2 are used.
        h: (nv,) moved.
        b: (F, 3) moved.
        change: (3,) Δ in the base's axes, m/s.
    """
    turn = np.empty(3)
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        turn[i] = v[3 + k] * change[m] - v[3 + m] * change[k]
    for i in range(3):
        v[i] += change[i]
        for c in range(v.size):
            h[c] += M[c, i] * turn[i]
        for f in range(b.shape[0]):
            for a in range(3):
                b[f, a] += J[f, a, i] * turn[i]


@inner
def stand(terms, mounts, q, v, h, foot, anchor, J, b):
    """Write the feet's terms; if ``foot`` stands (not −1), take base place and velocity from it.

    Args:
        terms: of the robot at ``q``, ``v``.
        mounts: of both feet.
        q: (13,) the base's position is moved so that the foot is at its anchor.
        v: (12,) the base's velocity is changed so that the foot is at rest.
        h: (12,) Coriolis and gravity torques, changed with v.
        foot: which one stands at its anchor, or −1.
        anchor: (2, 3) m.
        J: (2, 6, nv), written.
        b: (2, 3) J̇ v, written.
    """
    frames = Frames(J, np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 6)))
    frame_terms(terms, mounts, frames)
    b[:] = frames.drift[:, :3]
    h[:] = terms.nle
    if foot < 0:
        return
    rate, change = np.zeros(3), np.zeros(3)
    for a in range(3):
        q[a] += anchor[foot, a] - frames.p[foot, a]
        for c in range(v.size):
            rate[a] += J[foot, a, c] * v[c]
    for i in range(3):
        for a in range(3):
            change[i] -= terms.rotation[1, a, i] * rate[a]
    boost(v, terms.M, J, h, b, change)


@entry
def foresee(
    raw_body, raw_support, raw_springs, raw_timing, raw_flight, q, v, motor, tau_sea
):  # fmt: skip
    """Estimate the measured state by the standing foot, and predict it; q, v and motor are moved.

    Args:
        raw_body: `Tree`, `Terms` and the feet's `Mounts`; the terms are evaluated at the end.
        raw_support: where the feet stand.
        raw_springs: springs and motors.
        raw_timing: from when to when.
        raw_flight: the commands.
        q: (13,) configuration.
        v: (12,) velocity.
        motor: (6, 2) angles and speeds.
        tau_sea: (6,) spring torques then, written.
    """
    raw_tree, raw_terms, raw_mounts = raw_body
    tree, terms, mounts = Tree(*raw_tree), Terms(*raw_terms), Mounts(*raw_mounts)
    support, springs, timing = Support(*raw_support), Springs(*raw_springs), Timing(*raw_timing)
    nv, n = v.size, springs.stiffness.size
    base, stance = nv - n, support.stance
    J, b, h = np.empty((2, 6, nv)), np.empty((2, 3)), np.empty(nv)
    rigid_body_terms(tree, q, v, terms)
    stand(terms, mounts, q, v, h, support.foot, support.anchor, J, b)
    moved = np.zeros(nv)
    if timing.ticks > 0:
        rows, drift = np.empty((2, 3, nv)), np.empty((2, 3))
        for f, foot in enumerate((1 - stance, stance)):
            for a in range(3):
                drift[f, a] = b[foot, a]
                for c in range(nv):
                    rows[f, a, c] = J[foot, a, c]
        links = Links(terms.M, h, rows, drift)
        moved = predict(links, q[q.size - n :], v, motor, springs, timing, Flight(*raw_flight))
    elif timing.ticks < 0:
        for c in range(nv):
            moved[c] = -timing.ticks * timing.period * v[c]
    for j in range(n):
        stretch = motor[j, 0] - q[q.size - n + j] - moved[base + j]
        tau_sea[j] = springs.stiffness[j] * stretch
    integrate(q.copy(), moved, base, q)
    rigid_body_terms(tree, q, v, terms)
