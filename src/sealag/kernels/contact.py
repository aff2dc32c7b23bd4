"""Contact kernels: kinematics of the contact points and constrained forward dynamics.

Every foot is one or several points. A point's contact frame C has rows tangent, tangent, normal.
"""

import numpy as np
from numba import njit

from sealag.kernels import dynamics
from sealag.kernels.friction import solve, twist_torque
from sealag.kernels.rigid import cholesky, forward_solve


@njit(cache=True)
def memory_size(sizes):
    """Return how many numbers `parts` divides."""
    nq, nv, n, count, total, feet, mounted = sizes
    state = nq + 2 * nv + 10 * n + 4 * count + 3 * total + 6
    work = nv + nv * nv + 3 * count * (nv + 1) + total * (3 * nv + 6) + feet * (nv + 1)
    return state + work + mounted * (6 * nv + 18)


@njit(cache=True)
def motion(data, sizes):
    """Return the first `parts` of an instant's memory: q, v, z (n, 9), acceleration, power (6,)."""
    nq, nv, n = sizes[0], sizes[1], sizes[2]
    first, last = nq + nv, nq + nv + 9 * n
    return (
        data[:nq], data[nq:first], data[first:last].reshape(n, 9), data[last : last + nv],
        data[last + nv : last + nv + 6],
    )  # fmt: skip


@njit(cache=True)
def parts(data, sizes):
    """Return the named parts of one instant's memory, in the order of `memory_size`.

    Args:
        data: (memory_size,).
        sizes: nq, nv, n, contact points P, contact and loaded points T, feet, frames F.

    Returns:
        q, v, z (n, 9), acceleration (nv,), power (6,), tau (n,), force (P, 3), gap (P,),
        position (T, 3), velocity, drift (T, 3), J (T, 3, nv), target (P, 3), rows (P, 3, nv),
        right (nv,), L (nv, nv), twist_rows (feet, nv), spin (feet,), and of the frames J, R, p and
        bias as in `dynamics.frames`.
    """
    nq, nv, n, count, total, feet, mounted = sizes
    q, v, z, acceleration, power = motion(data, sizes)
    data = data[nq + 2 * nv + 9 * n + 6 :]
    tau, data = data[:n], data[n:]
    force, data = data[: 3 * count].reshape(count, 3), data[3 * count :]
    gap, data = data[:count], data[count:]
    position, data = data[: 3 * total].reshape(total, 3), data[3 * total :]
    velocity, data = data[: 3 * total].reshape(total, 3), data[3 * total :]
    drift, data = data[: 3 * total].reshape(total, 3), data[3 * total :]
    J, data = data[: 3 * total * nv].reshape(total, 3, nv), data[3 * total * nv :]
    target, data = data[: 3 * count].reshape(count, 3), data[3 * count :]
    rows, data = data[: 3 * count * nv].reshape(count, 3, nv), data[3 * count * nv :]
    right, data = data[:nv], data[nv:]
    L, data = data[: nv * nv].reshape(nv, nv), data[nv * nv :]
    twist_rows, data = data[: feet * nv].reshape(feet, nv), data[feet * nv :]
    spin, data = data[:feet], data[feet:]
    mounted_J, data = data[: 6 * mounted * nv].reshape(mounted, 6, nv), data[6 * mounted * nv :]
    R, data = data[: 9 * mounted].reshape(mounted, 3, 3), data[9 * mounted :]
    p, data = data[: 3 * mounted].reshape(mounted, 3), data[3 * mounted :]
    bias = data.reshape(mounted, 6)
    return (
        q, v, z, acceleration, power, tau, force, gap, position, velocity, drift, J, target, rows,
        right, L, twist_rows, spin, mounted_J, R, p, bias,
    )  # fmt: skip


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
def project(L, J, C, wanted, rows):
    """Write L⁻¹ (C J)ᵀ of every wanted (P,) point, as rows (P, 3, nv)."""
    nv = L.shape[0]
    for i in range(C.shape[0]):
        if wanted[i] == 0:
            continue
        for a in range(3):
            for c in range(nv):
                rows[i, a, c] = (
                    C[i, a, 0] * J[i, 0, c] + C[i, a, 1] * J[i, 1, c] + C[i, a, 2] * J[i, 2, c]
                )
            forward_solve(L, rows[i, a])


@njit(cache=True)
def twist(L, J_frame, v, C, foot_of, torsion, rows, spin):
    """Write L⁻¹ Jᵀ of every foot's turn about its normal (F, nv) and its rate (F,), rad/s.

    Feet without torsional damping, the first column of ``torsion``, are left out.
    """
    spin[:] = 0.0
    last = -1
    for i in range(foot_of.size):
        f = foot_of[i]
        if f == last or torsion[f, 0] == 0.0:
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
def smallest_margin(C, velocity, force, gap, closed, weight):
    """Return the smallest margin and its point: how far it is from ending its condition.

    Open: the gap (m), inf if it widens. Closed: the normal force in body weights.
    """
    smallest, point = np.inf, 0
    for i in range(closed.size):
        if closed[i]:
            margin = force[i, 2] / weight
        else:
            rate = 0.0
            for b in range(3):
                rate += C[i, 2, b] * velocity[i, b]
            margin = gap[i] if rate < 0.0 else np.inf
        if not margin >= smallest:
            smallest, point = margin, i
    return smallest, point


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
def _apply(nle, joint, parameters, z, v, load, J, velocity, tau, right):
    """Write spring torques and all applied generalised forces, the damping of the joints among
    them; return the power of the loads."""
    nv, n = v.size, joint.size
    for i in range(nv):
        right[i] = -nle[i]
    for i in range(n):
        tau[i] = parameters[i, 0] * (z[i, 0] - joint[i])
        tau[i] += parameters[i, 1] * (z[i, 1] - v[nv - n + i])
        right[nv - n + i] += tau[i] - parameters[i, 10] * v[nv - n + i]
    power = 0.0
    for k in range(load.shape[0]):
        for a in range(3):
            if load[k, a] != 0.0:
                power += load[k, a] * velocity[k, a]
                for c in range(nv):
                    right[c] += J[k, a, c] * load[k, a]
    return power


@njit(cache=True)
def evaluate(tree, terms, around, state, rates, parameters, data, sizes):
    """Spring torque, applied forces, contact forces and acceleration at one instant.

    Args:
        tree: the robot, as `sealag.robot.Robot.tree`.
        terms: its terms, as `dynamics.allocate` returns them, written.
        around: what surrounds the robot: mounts of the feet's and loaded frames as
            `sealag.robot.Robot.frame_mounts` gives them (4 arrays), frame (T,) and offset (T, 3)
            of every point, C (P, 3, 3), anchor (P, 3), mu and ridge (P,), torsion (feet, 2) as in
            ``friction.solve``, load (T - P, 3) N.
        state: closed and yielding (P,).
        rates: stabilisation rate 1/s, time in which friction may stop a point s.
        parameters: of the actuators, as in ``motor``.
        data: the instant's memory; q, v and the first two columns of z are read, the rest is
            written. Powers: normal, tangential, torsional, load; then kinetic energy
            and gravity potential.
        sizes: as in `parts`.

    Returns:
        False if there is no solution.
    """
    (
        q, v, z, acceleration, power, tau, force, _, position, velocity, drift, J, target, rows,
        right, L, twist_rows, spin, mounted_J, R, p, bias,
    ) = parts(data, sizes)  # fmt: skip
    frame_of, offset, C, anchor, mu, ridge, torsion, load = around[4:]
    closed, yielding = state
    M, count = terms[0], closed.size
    foot_of, joint = frame_of[:count], q[q.size - tau.size :]
    dynamics.evaluate(tree, q, v, terms)
    dynamics.frames(terms, around[:4], mounted_J, R, p, bias)
    points(mounted_J, R, p, bias, v, frame_of, offset, J, position, velocity, drift)
    power[3] = _apply(
        terms[1], joint, parameters, z, v, load, J[count:], velocity[count:], tau, right
    )
    power[4:] = terms[10]
    demand(C, position, anchor, velocity, drift, rates[0], rates[1], target)
    if not cholesky(M, L):
        return False
    project(L, J, C, closed, rows)
    twist(L, mounted_J, v, C, foot_of, torsion, twist_rows, spin)
    free = right.copy()
    forward_solve(L, free)
    solved = solve(
        L, rows, free, target, closed, mu, ridge, yielding, foot_of, torsion, twist_rows, spin,
        acceleration, force,
    )  # fmt: skip
    _contact_power(C, velocity, force, closed, power)
    power[2] = _torsion_power(force, closed, foot_of, torsion, spin)
    return solved


@njit(cache=True)
def sense(data, sizes, closed, foot_of, t, out):
    """Write what the sensors measure at an instant.

    Args:
        data: the instant's memory, evaluated.
        sizes: as in `parts`.
        closed: (P,) whether each contact point is closed.
        foot_of: (P,) its foot.
        t: the time that the measurement says, s.
        out: the row of a `sealag.whole_body.Measurement`, written.
    """
    nq, nv, n = sizes[0], sizes[1], sizes[2]
    q, v, z = motion(data, sizes)[:3]
    tau = data[nq + 2 * nv + 9 * n + 6 :]
    first = 1 + nq + nv
    out[0], out[1 : 1 + nq], out[1 + nq : first] = t, q, v
    for i in range(n):
        out[first + i], out[first + n + i], out[first + 2 * n + i] = z[i, 0], z[i, 1], tau[i]
    out[first + 3 * n :] = 0.0
    for i in range(closed.size):
        if closed[i]:
            out[first + 3 * n + foot_of[i]] = 1.0


@njit(cache=True)
def _torsion_power(force, closed, foot_of, torsion, spin):
    torque = np.zeros(spin.size)
    twist_torque(force, closed, foot_of, torsion, spin, torque)
    power = 0.0
    for f in range(spin.size):
        power += torque[f] * spin[f]
    return power


def example():
    """Return arguments of `evaluate` with the types used in practice: one foot, one joint."""
    nv, count = 7, 1
    sizes = (8, nv, 1, count, count, 1, 1)
    mounts = (np.ones(1, np.int64), np.eye(3)[None], np.zeros((1, 3)), np.ones((1, nv), np.int64))
    ground = (np.eye(3)[None], np.zeros((1, 3)), np.ones(1), np.zeros(1))
    around = (
        *mounts, np.zeros(1, np.int64), np.zeros((1, 3)), *ground, np.zeros((1, 2)),
        np.zeros((0, 3)),
    )  # fmt: skip
    tree, terms = dynamics.example(nv)
    parameters = np.array([[350.0, 0.0, 0.1, 2.0, 10.0, 0.0, 0.1, np.inf, np.inf, np.inf, 0.0]])
    state, data = (np.ones(1, np.int64), np.zeros(1)), np.zeros(memory_size(sizes))
    data[6] = 1.0
    return tree, terms, around, state, (50.0, 1e-3), parameters, data, sizes


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    arguments = example()
    evaluate(*arguments)
    C, state, data, sizes = arguments[2][6], arguments[3], arguments[6], arguments[7]
    one, instant = np.zeros((1, 3)), parts(data, sizes)
    sense(data, sizes, state[0], arguments[2][4], 0.0, np.zeros(1 + 8 + 7 + 3 + 1))
    project(instant[15], instant[11], C, state[0], instant[13])
    demand(C, one, one, one, one, 50.0, 1e-3, one.copy())
    smallest_margin(C, one, one, np.zeros(1), state[0], 1.0)
