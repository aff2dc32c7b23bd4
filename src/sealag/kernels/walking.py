"""Walking kernels: quintic references, the pendulum under a planned height, prediction, torques.

The robot's terms M, h, J and J̇v are those of one instant; feet are point contacts (3 rows each).
"""

import numpy as np
from numba import njit

GRAVITY = 9.81


@njit(cache=True)
def quintic(start, end, duration, c):
    """Write the coefficients c (6,) of the quintic between two (position, rate, acceleration).

    Args:
        start: (3,) at time 0.
        end: (3,) at ``duration``.
        duration: s, positive.
        c: (6,) coefficients of t⁰ … t⁵, written.
    """
    T = duration
    c[0], c[1], c[2] = start[0], start[1], 0.5 * start[2]
    d0 = end[0] - start[0] - start[1] * T - 0.5 * start[2] * T * T
    d1 = end[1] - start[1] - start[2] * T
    d2 = end[2] - start[2]
    c[3] = (10.0 * d0 - 4.0 * d1 * T + 0.5 * d2 * T * T) / T**3
    c[4] = (-15.0 * d0 + 7.0 * d1 * T - d2 * T * T) / T**4
    c[5] = (6.0 * d0 - 3.0 * d1 * T + 0.5 * d2 * T * T) / T**5


@njit(cache=True)
def quintic_at(c, t, out):
    """Write position, rate and acceleration (3,) of a quintic at a time.

    Args:
        c: (6,) coefficients.
        t: s.
        out: (3,), written.
    """
    out[0] = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))))
    out[1] = c[1] + t * (2 * c[2] + t * (3 * c[3] + t * (4 * c[4] + t * 5 * c[5])))
    out[2] = 2 * c[2] + t * (6 * c[3] + t * (12 * c[4] + t * 20 * c[5]))


@njit(cache=True)
def pendulum(x, v, begin, end, transfer, old, new, height, offset, steps):
    """Move the pendulum's x, v (2,) in place from one phase of a step to another.

    The centre of pressure moves from the old to the new foot during the weight transfer; the
    height follows its plan, so ẍ = (g + z̈)(x − p)/(z − p_z).

    Args:
        x: (2,) horizontal position, m; moved.
        v: (2,) horizontal velocity, m/s; moved.
        begin: phase now, s.
        end: phase at the end, s.
        transfer: duration of the weight transfer from phase 0, s.
        old: (3,) foot left.
        new: (3,) foot stood on.
        height: (6,) quintic of the height over the world's zero.
        offset: phase at which the quintic's time is 0, s.
        steps: number of midpoint steps.
    """
    if end <= begin:
        return
    z = np.empty(3)
    h = (end - begin) / steps
    for i in range(steps):
        t = begin + (i + 0.5) * h
        quintic_at(height, t - offset, z)
        s = min(t / transfer, 1.0) if transfer > 0.0 else 1.0
        arm = max(z[0] - old[2] - s * (new[2] - old[2]), 0.3)
        rate2 = max(GRAVITY + z[2], 1.0) / arm
        for k in range(2):
            p = old[k] + s * (new[k] - old[k])
            a = rate2 * (x[k] + 0.5 * h * v[k] - p)
            x[k] += h * v[k] + 0.5 * h * h * a
            v[k] += h * a


@njit(cache=True)
def constrain(M_inverse, h, J, b, n):
    """Return a_0 (nv,), P (nv, n) of v̇ = a_0 + P τ under the contact rows J v̇ = −b.

    Args:
        M_inverse: (nv, nv).
        h: (nv,) Coriolis and gravity torques.
        J: (c, nv) contact rows.
        b: (c,) J̇ v.
        n: number of actuated joints, the last velocities.
    """
    X = M_inverse @ J.T
    Y = np.linalg.solve(J @ X, X.T)
    N = M_inverse - X @ Y
    a_0 = -(N @ h) - Y.T @ b
    return a_0, np.ascontiguousarray(N[:, N.shape[0] - n :])


@njit(cache=True)
def damped_solve(A, r, damping):
    """Return the least-squares solution of A x = r, damped where A is nearly singular.

    Args:
        A: (m, m).
        r: (m,).
        damping: share of the trace of AᵀA that is added to it.
    """
    G = A.T @ A
    add = damping * np.trace(G) + 1e-300
    for i in range(G.shape[0]):
        G[i, i] += add
    return np.linalg.solve(G, A.T @ r)


@njit(cache=True)
def task_torques(a_0, P, J_t, b_t, wanted, damping):
    """Return τ (n,) and v̇ (nv,) that give the tasks the accelerations wanted.

    Args:
        a_0: (nv,) acceleration without torque.
        P: (nv, n) mobility, from `constrain`.
        J_t: (n, nv) as many task rows as joints.
        b_t: (n,) J̇_t v.
        wanted: (n,) task accelerations.
        damping: see `damped_solve`.
    """
    tau = damped_solve(J_t @ P, wanted - b_t - J_t @ a_0, damping)
    return tau, a_0 + P @ tau


@njit(cache=True)
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
    M_inverse = np.linalg.inv(M)
    moved = np.zeros(nv)
    a_0, P = np.zeros(nv), np.zeros((nv, n))
    mode = -1
    for i in range(ticks):
        t = start + (i + 0.5) * period
        now = 0 if t < begin else (1 if t < end else 2)
        if now != mode:
            mode = now
            first, last = (1, 2) if mode == 2 else ((0, 1) if mode == 0 else (0, 2))
            rows = J[first:last].copy().reshape(3 * (last - first), nv)
            bias = b[first:last].copy().reshape(3 * (last - first))
            a_0, P = constrain(M_inverse, h, rows, bias, n)
        k = newest
        for _ in range(arrival.size):
            if arrival[k] <= t:
                break
            k = (k - 1) % arrival.size
        before = q_joint + moved[base:]
        v += period * (a_0 + P @ (K * (motor[:, 0] - before)))
        moved += period * v
        for j in range(n):
            force = command[k, j] + K[j] * before[j]
            rate = K[j] * v[base + j]
            theta, speed = motor[j, 0], motor[j, 1]
            for r in range(2):
                motor[j, r] = (
                    table[j, r, 0] * theta
                    + table[j, r, 1] * speed
                    + table[j, r, 2] * force
                    + table[j, r, 3] * rate
                )
    return moved


def warm() -> None:
    """Compile every kernel of this module."""
    c, out, foot = np.zeros(6), np.zeros(3), np.zeros(3)
    quintic(np.zeros(3), np.ones(3), 1.0, c)
    quintic_at(c, 0.5, out)
    c[0] = 1.0
    pendulum(np.zeros(2), np.zeros(2), 0.0, 0.1, 0.05, foot, foot, c, 0.0, 2)
    nv, n = 7, 6
    J_t = np.ascontiguousarray(np.eye(nv)[1:])
    a_0, P = constrain(np.eye(nv), np.zeros(nv), np.eye(nv)[:1].copy(), np.zeros(1), n)
    task_torques(a_0, P, J_t, np.zeros(n), np.ones(n), 1e-8)
    predict(
        np.eye(nv), np.zeros(nv), np.ascontiguousarray(np.eye(nv)[:6].reshape(2, 3, nv)),
        np.zeros((2, 3)), np.zeros(n), np.zeros(nv), np.zeros((n, 2)), np.ones(n),
        np.zeros((n, 2, 4)), 0.0, 1e-3, 3, np.zeros(4), np.zeros((4, n)), 0, 1e-3, 2e-3,
    )  # fmt: skip
