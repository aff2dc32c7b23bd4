"""Kernels of the walking controller's state: leg odometry, and prediction over the delay.

The robot's terms are those of one instant; feet are point contacts (3 rows each), 0 left, 1 right.
"""

import numpy as np

from sealag.kernels._jit import entry, inner
from sealag.kernels.dynamics import Frames, Mounts, Terms, Tree, frame_terms, rigid_body_terms
from sealag.kernels.linalg import invert_spd
from sealag.kernels.spatial import integrate
from sealag.kernels.walking_law import constrain


@inner
def predict(M, h, J, b, q_joint, v, motor, K, table, start, period, ticks, arrival, command,
            newest, begin, end):  # fmt: skip
    """Predict links, springs and motors under the commands still in flight.

    The links' terms are frozen at the measured instant; the motors move exactly between ticks
    with the link angle linear over a tick.

    Args:
        M: (nv, nv) mass matrix.
        h: (nv,) Coriolis and gravity torques.
        J: (2, 3, nv) rows of the foot that is left and of the foot stood on.
        b: (2, 3) their J̇ v.
        q_joint: (n,) link-side joint positions.
        v: (nv,) velocity; moved.
        motor: (n, 2) motor angles and speeds; moved.
        K: (n,) spring stiffness.
        table: (n, 2, 4) exact motor step: of θ, θ̇, force and force rate.
        start: instant of the measurement, s.
        period: s.
        ticks: number of periods to predict.
        arrival: (k,) ring of the commands' expected arrivals, s.
        command: (k, n) ring of the commands.
        newest: place of the newest command in the ring.
        begin: instant at which the new foot touches down, s.
        end: instant at which the old foot lifts off, s.

    Returns:
        (nv,) displacement in the tangent space of the measured configuration.
    """
    nv, n = v.size, K.size
    base = nv - n
    M_inverse, factor = np.empty((nv, nv)), np.empty((nv, nv))
    moved, before, a = np.zeros(nv), np.empty(n), np.empty(nv)
    a_0, P, P_t = np.empty(nv), np.empty((nv, n)), np.empty((n, nv))
    if not invert_spd(M, M_inverse, factor):
        moved[:] = np.nan
        return moved
    mode = -1
    for i in range(ticks):
        t = start + (i + 0.5) * period
        now = 0 if t < begin else (1 if t < end else 2)
        if now != mode:
            mode = now
            first, last = (1, 2) if mode == 2 else ((0, 1) if mode == 0 else (0, 2))
            rows = J[first:last].copy().reshape(3 * (last - first), nv)
            constrain(M_inverse, h, rows, b[first:last].copy().reshape(rows.shape[0]), a_0, P)
            P_t[:] = P.T
        k = newest
        for _ in range(arrival.size):
            if arrival[k] <= t:
                break
            k = k - 1 if k > 0 else arrival.size - 1
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
            force, rate = command[k, j] + K[j] * before[j], K[j] * v[base + j]
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
def foresee(raw_tree, raw_terms, raw_mounts, q, v, motor, stance, foot, anchor, K, table, clock, ticks, ring,
            newest, tau_sea):  # fmt: skip
    """Estimate the measured state by the standing foot, and predict it; q, v and motor are moved.

    Args:
        raw_tree: the robot.
        raw_terms: its terms, evaluated at the end.
        raw_mounts: of both feet.
        q: (13,) configuration.
        v: (12,) velocity.
        motor: (6, 2) angles and speeds.
        stance: foot stood on.
        foot: which one the odometry stands on, or −1.
        anchor: (2, 3) where the feet stand, m.
        K: (6,) spring stiffness.
        table: (6, 2, 4) see `predict`.
        clock: instant of the measurement, period, touchdown, lift-off; s.
        ticks: number of periods to predict; if negative, v is extrapolated as many periods.
        ring: arrivals (k,) and commands (k, 6), see `predict`.
        newest: place of the newest command.
        tau_sea: (6,) spring torques then, written.
    """
    tree, terms, mounts = Tree(*raw_tree), Terms(*raw_terms), Mounts(*raw_mounts)
    nv, n = v.size, K.size
    base = nv - n
    J, b, h = np.empty((2, 6, nv)), np.empty((2, 3)), np.empty(nv)
    rigid_body_terms(tree, q, v, terms)
    stand(terms, mounts, q, v, h, foot, anchor, J, b)
    moved = np.zeros(nv)
    if ticks > 0:
        rows, bias = np.empty((2, 3, nv)), np.empty((2, 3))
        rows[0], rows[1] = J[1 - stance, :3], J[stance, :3]
        bias[0], bias[1] = b[1 - stance], b[stance]
        moved = predict(
            terms.M, h, rows, bias, q[q.size - n :], v, motor, K, table, clock[0], clock[1],
            ticks, ring[0], ring[1], newest, clock[2], clock[3],
        )  # fmt: skip
    elif ticks < 0:
        moved[:] = -ticks * clock[1] * v
    for j in range(n):
        tau_sea[j] = K[j] * (motor[j, 0] - q[q.size - n + j] - moved[base + j])
    integrate(q.copy(), moved, base, q)
    rigid_body_terms(tree, q, v, terms)
