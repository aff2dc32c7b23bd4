"""Contact kernels: kinematics of the contact points and constrained forward dynamics.

Every foot is one or several points. A point's contact frame C has rows tangent, tangent, normal.
"""

import numpy as np
from numba import njit

from sealag.kernels.friction import solve, twist_torque
from sealag.kernels.rigid import cholesky, forward_solve


@njit(cache=True)
def points(J_frame, R, p, drift_frame, v, frame_of, offset, J, position, velocity, drift):
    """Write Jacobian, position, velocity and velocity-product acceleration of every point.

    J_frame (F, 6, nv), R (F, 3, 3), p (F, 3), drift_frame (F, 6): world-aligned frames, linear
    rows first; offset (P, 3) in frame ``frame_of[i]``.
    """
    nv = v.size
    r = np.empty(3)
    omega = np.empty(3)
    for i in range(frame_of.size):
        f = frame_of[i]
        for a in range(3):
            s = 0.0
            for b in range(3):
                s += R[f, a, b] * offset[i, b]
            r[a] = s
            position[i, a] = p[f, a] + s
            w = 0.0
            for c in range(nv):
                w += J_frame[f, 3 + a, c] * v[c]
            omega[a] = w
        for c in range(nv):
            x, y, z = J_frame[f, 3, c], J_frame[f, 4, c], J_frame[f, 5, c]
            J[i, 0, c] = J_frame[f, 0, c] + y * r[2] - z * r[1]
            J[i, 1, c] = J_frame[f, 1, c] + z * r[0] - x * r[2]
            J[i, 2, c] = J_frame[f, 2, c] + x * r[1] - y * r[0]
        dot = omega[0] * r[0] + omega[1] * r[1] + omega[2] * r[2]
        square = omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            turn = drift_frame[f, 3 + b] * r[c] - drift_frame[f, 3 + c] * r[b]
            drift[i, a] = drift_frame[f, a] + turn + omega[a] * dot - r[a] * square
            s = 0.0
            for k in range(nv):
                s += J[i, a, k] * v[k]
            velocity[i, a] = s


@njit(cache=True)
def demand(C, position, anchor, velocity, drift, gain, stop_time, out):
    """Write the part of every point's contact equation that is not J x (P, 3).

    Tangent rows: J̇v + v_t / stop_time. Normal row: J̇v + 2 gain v_n + gain² (p - anchor)_n.
    """
    for i in range(C.shape[0]):
        for a in range(3):
            s = 0.0
            for b in range(3):
                if a < 2:
                    s += C[i, a, b] * (drift[i, b] + velocity[i, b] / stop_time)
                else:
                    s += C[i, a, b] * (
                        drift[i, b]
                        + 2.0 * gain * velocity[i, b]
                        + gain * gain * (position[i, b] - anchor[i, b])
                    )
            out[i, a] = s


@njit(cache=True)
def project(L, J, C, rows):
    """Write L⁻¹ (C J)ᵀ of every point, as rows (P, 3, nv)."""
    nv = L.shape[0]
    for i in range(C.shape[0]):
        for a in range(3):
            for c in range(nv):
                rows[i, a, c] = (
                    C[i, a, 0] * J[i, 0, c] + C[i, a, 1] * J[i, 1, c] + C[i, a, 2] * J[i, 2, c]
                )
            forward_solve(L, rows[i, a])


@njit(cache=True)
def twist(L, J_frame, v, C, foot_of, rows, spin):
    """Write L⁻¹ Jᵀ of every foot's turn about its normal (F, nv) and its rate (F,), rad/s."""
    spin[:] = 0.0
    last = -1
    for i in range(foot_of.size):
        f = foot_of[i]
        if f == last:
            continue
        last = f
        for c in range(v.size):
            s = 0.0
            for a in range(3):
                s += C[i, 2, a] * J_frame[f, 3 + a, c]
            rows[f, c] = s
            spin[f] += s * v[c]
        forward_solve(L, rows[f])


@njit(cache=True)
def margins(C, velocity, force, gap, closed, weight, out):
    """Write for every point how far its ending condition is from happening (P,).

    Open: the gap (m), inf if it widens. Closed: the normal force in body weights.
    """
    for i in range(closed.size):
        if closed[i]:
            out[i] = force[i, 2] / weight
            continue
        rate = 0.0
        for b in range(3):
            rate += C[i, 2, b] * velocity[i, b]
        out[i] = gap[i] if rate < 0.0 else np.inf


@njit(cache=True)
def _contact_power(C, velocity, force, closed, out):
    """Write the power of normal (out[0]) and tangential (out[1]) contact forces."""
    out[0] = 0.0
    out[1] = 0.0
    for i in range(closed.size):
        if closed[i]:
            for b in range(3):
                out[0] += force[i, 2] * C[i, 2, b] * velocity[i, b]
                tangent = force[i, 0] * C[i, 0, b] + force[i, 1] * C[i, 1, b]
                out[1] += tangent * velocity[i, b]


@njit(cache=True)
def _kinetic(M, v):
    total = 0.0
    for i in range(v.size):
        for j in range(v.size):
            total += 0.5 * v[i] * M[i, j] * v[j]
    return total


@njit(cache=True)
def _apply(nle, joint, motor, spring, v, load, J, velocity, tau, right):
    """Write spring torques and all applied generalised forces; return the power of the loads."""
    nv, n = v.size, joint.size
    for i in range(nv):
        right[i] = -nle[i]
    for i in range(n):
        tau[i] = spring[0][i] * (motor[i, 0] - joint[i])
        tau[i] += spring[1][i] * (motor[i, 1] - v[nv - n + i])
        right[nv - n + i] += tau[i]
    power = 0.0
    for k in range(load.shape[0]):
        for a in range(3):
            if load[k, a] != 0.0:
                power += load[k, a] * velocity[k, a]
                for c in range(nv):
                    right[c] += J[k, a, c] * load[k, a]
    return power


@njit(cache=True)
def evaluate(
    M, nle, frames, v, joint, motor, spring, shape, ground, rates, state, load, torsion, instant
):
    """Spring torque, applied forces, contact forces and acceleration at one instant.

    Groups of arrays, all preallocated: ``frames`` (J, R, p, drift) of the feet and loaded frames,
    ``joint`` link positions (n,), ``motor`` (n, 2 or more) angle and speed, ``spring`` (K, D_s),
    ``shape`` (frame_of, offset), ``ground`` (C, anchor, mu, ridge), ``rates`` (stabilisation
    gain, stop time), ``state`` (closed, yielding), ``load`` forces (L, 3) on the points after the
    contact points, ``torsion`` as in ``solve``. Writes ``instant``: tau, acceleration, force,
    position, velocity, target, right, L, rows, power, J, drift, twist_rows, spin; power: normal,
    tangential, torsional, load, and kinetic energy. Returns False if there is no solution.
    """
    J_frame, R, p, drift_frame = frames
    frame_of, offset = shape
    C, anchor, mu, ridge = ground
    closed, yielding = state
    tau, acceleration, force, position, velocity, target, right, L, rows = instant[:9]
    power, J, drift, twist_rows, spin = instant[9:]
    points(J_frame, R, p, drift_frame, v, frame_of, offset, J, position, velocity, drift)
    count = closed.size
    power[3] = _apply(nle, joint, motor, spring, v, load, J[count:], velocity[count:], tau, right)
    demand(C, position, anchor, velocity, drift, rates[0], rates[1], target)
    power[4] = _kinetic(M, v)
    if not cholesky(M, L):
        return False
    project(L, J, C, rows)
    twist(L, J_frame, v, C, frame_of[:count], twist_rows, spin)
    free = right.copy()
    forward_solve(L, free)
    solved = solve(
        L, rows, free, target, closed, mu, ridge, yielding, frame_of[:count], torsion, twist_rows,
        spin, acceleration, force,
    )  # fmt: skip
    _contact_power(C, velocity, force, closed, power)
    torque = np.zeros(spin.size)
    twist_torque(force, closed, frame_of[:count], torsion, spin, torque)
    power[2] = 0.0
    for f in range(spin.size):
        power[2] += torque[f] * spin[f]
    return solved


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    nv, M, none = 7, np.eye(7), np.zeros(0)
    frames = (np.zeros((1, 6, nv)), np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, 6)))
    frames[0][0, :6, :6] = np.eye(6)
    shape = (np.zeros(1, np.int64), np.zeros((1, 3)))
    ground = (np.eye(3)[None], np.zeros((1, 3)), np.ones(1), np.zeros(1))
    state, rates = (np.ones(1, np.int64), np.zeros(1)), (50.0, 1e-3)
    torsion, one = np.zeros((1, 2)), np.zeros((1, 3))
    instant = (
        np.zeros(1), np.zeros(nv), one, one.copy(), one.copy(), one.copy(), np.zeros(nv),
        np.zeros((nv, nv)), np.zeros((1, 3, nv)), np.zeros(5), np.zeros((1, 3, nv)), one.copy(),
        np.zeros((1, nv)), np.zeros(1),
    )  # fmt: skip
    v, spring = np.zeros(nv), (np.ones(1), np.zeros(1))
    load = none.reshape(0, 3)
    evaluate(
        M, v, frames, v, np.zeros(1), np.zeros((1, 2)), spring, shape, ground, rates, state, load,
        torsion, instant,
    )  # fmt: skip
    project(instant[7], instant[10], ground[0], instant[8])
    demand(ground[0], one, one, one, one, 50.0, 1e-3, one.copy())
    margins(ground[0], one, one, np.zeros(1), state[0], 1.0, np.zeros(1))
