"""Kernels of the walking controller's state: leg odometry, and prediction over the delay.

The robot's terms are those of one instant; feet are point contacts (3 rows each), 0 left, 1 right.
"""

from typing import NamedTuple

import numpy as np

from sealag.kernels._jit import entry, inner
from sealag.kernels.dynamics import frame_terms, rigid_body_terms
from sealag.kernels.linalg import copy, invert_spd
from sealag.kernels.spatial import (
    add,
    cross,
    dot,
    integrate,
    rotate,
    rotation,
    scale,
    subtract,
    transpose,
    vector,
)
from sealag.kernels.walking_law import constrain
from sealag.typing import Array

SAME = 1e-6
"""Of a period: instants this close are one. Without it rounding decides whether a command has
arrived where delays end halfway between ticks, and no walk becomes periodic."""


class Links(NamedTuple):
    """Terms of the links at the measured instant; feet in the order left behind, stood on."""

    M: Array  # (nv, nv) mass matrix
    h: Array  # (nv,) Coriolis and gravity torques
    J: Array  # (2, 3, nv) of the feet
    drift: Array  # (2, 3) J̇ v


class Timing(NamedTuple):
    """From when to when the state is predicted, and on which feet."""

    measured: float  # instant of the measurement, s
    period: float  # s
    ticks: int  # periods to predict; if negative, v is extrapolated as many periods
    touchdown: float  # instant at which the new foot touches down, s
    lift_off: float  # instant at which the old foot lifts off, s
    stance: int  # foot stood on
    foot: int  # which one the odometry stands on, or −1
    newest: int  # place of the newest command in flight


@inner
def predict(links, biped, timing):
    """Predict links, springs and motors under the commands still in flight.

    The links' terms are frozen at the measured instant; the motors move exactly between ticks
    with the link angle linear over a tick.

    Args:
        links: their terms.
        biped: v and motor are moved; moved (nv,) of its scratch, the displacement in the tangent
            space of the measured configuration, is written.
        timing: from when to when.
    """
    q, v, motor, scratch = biped.q, biped.v, biped.motor, biped.scratch
    K, table, period = biped.springs.stiffness, biped.springs.table, timing.period
    flight, moved, before, a = biped.flight, scratch.moved, scratch.before, scratch.a
    nv, n = v.size, K.size
    base, first_q = nv - n, q.size - n
    moved[:] = 0.0
    if not invert_spd(links.M, scratch.M_inverse, scratch.factor):
        moved[:] = np.nan
        return
    mode = -1
    for i in range(timing.ticks):
        t = timing.measured + (i + 0.5 + SAME) * period
        now = 0 if t < timing.touchdown else (1 if t < timing.lift_off else 2)
        if now != mode:
            mode = now
            first, last = (1, 2) if mode == 2 else ((0, 1) if mode == 0 else (0, 2))
            count = 3 * (last - first)
            rows, drift = links.J[first:last], links.drift[first:last]
            constrain(
                scratch.M_inverse, links.h, rows.reshape(count, nv), drift.reshape(count), scratch
            )
            for c in range(nv):
                for j in range(n):
                    scratch.P_t[j, c] = scratch.P[c, j]
        k = timing.newest
        for _ in range(flight.arrival.size):
            if flight.arrival[k] <= t:
                break
            k = k - 1 if k > 0 else flight.arrival.size - 1
        copy(scratch.a_0, a)
        for j in range(n):
            before[j] = q[first_q + j] + moved[base + j]
            spring = K[j] * (motor[j, 0] - before[j])
            for c in range(nv):
                a[c] += scratch.P_t[j, c] * spring
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
        b: (F, 6) rows 0 to 2 are moved.
        change: Δ in the base's axes, m/s.
    """
    turn = cross((v[3], v[4], v[5]), change)
    v[0], v[1], v[2] = add((v[0], v[1], v[2]), change)
    for c in range(v.size):
        h[c] += dot((M[c, 0], M[c, 1], M[c, 2]), turn)
    for f in range(b.shape[0]):
        for a in range(3):
            b[f, a] += dot((J[f, a, 0], J[f, a, 1], J[f, a, 2]), turn)


@inner
def stand(biped, foot):
    """Write the feet's terms; if a foot stands, take place and velocity of the base from it.

    Args:
        biped: evaluated at q, v. The base's position is moved so that the foot is at its anchor,
            the base's velocity is changed so that the foot is at rest, and with it h (nv,) of the
            scratch and J̇ v of the feet.
        foot: which one stands at its anchor, or −1.
    """
    q, v, terms, feet, h = biped.q, biped.v, biped.terms, biped.feet, biped.scratch.h
    frame_terms(terms, biped.mounts, feet)
    copy(terms.nle, h)
    if foot < 0:
        return
    away = subtract(vector(biped.anchor, foot), vector(feet.p, foot))
    q[0], q[1], q[2] = add((q[0], q[1], q[2]), away)
    rate, J = (0.0, 0.0, 0.0), feet.J[foot]
    for c in range(v.size):
        rate = add(rate, scale(v[c], (J[0, c], J[1, c], J[2, c])))
    change = rotate(transpose(rotation(terms.rotation, 1)), scale(-1.0, rate))
    boost(v, terms.M, feet.J, h, feet.drift, change)


@entry
def foresee(kept, raw_timing):
    """Estimate the measured state by the standing foot, and predict it.

    Args:
        kept: `Biped`; q, v and motor are moved, tau_sea is written, and the terms are evaluated at
            the end.
        raw_timing: from when to when.
    """
    _foresee(kept.parts, Timing(*raw_timing))


@inner
def _foresee(biped, timing):
    q, v, motor, scratch, terms = biped.q, biped.v, biped.motor, biped.scratch, biped.terms
    nv, n, moved = v.size, biped.tau_sea.size, scratch.moved
    base, stance = nv - n, timing.stance
    for again in range(2):  # measured, then predicted: compiled once
        rigid_body_terms(biped.tree, q, v, terms)
        if again == 1:
            break
        stand(biped, timing.foot)
        moved[:] = 0.0
        if timing.ticks > 0:
            for f in range(2):
                foot = 1 - stance if f == 0 else stance
                copy(biped.feet.J[foot, :3], scratch.contact[f])
                for a in range(3):
                    scratch.drift[f, a] = biped.feet.drift[foot, a]
            predict(Links(terms.M, scratch.h, scratch.contact, scratch.drift), biped, timing)
        elif timing.ticks < 0:
            for c in range(nv):
                moved[c] = -timing.ticks * timing.period * v[c]
        for j in range(n):
            stretch = motor[j, 0] - q[q.size - n + j] - moved[base + j]
            biped.tau_sea[j] = biped.springs.stiffness[j] * stretch
        integrate(q, moved, base, q)
