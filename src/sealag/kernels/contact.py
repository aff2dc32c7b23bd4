"""Contact kernels: point kinematics, friction, constrained dynamics, which contacts hold.

Every foot is one or several points. A point's contact frame C has rows tangent, tangent, normal;
forces and impulses are given in it. A closed point has no normal acceleration (but for the return
to where it closed) and Coulomb friction in the form

    w = v_t + T a_t,   |f_t| <= mu f_n,   w = 0 or f_t = -mu f_n w / |w|,

so that a point sticks whenever friction can stop it within the time T, and slides against the
velocity that it is about to have. The law is continuous; T is the step, and 0 is Coulomb's law.
"""

import math

import numpy as np
from numba import njit

from sealag.kernels.rigid import _backward, _forward, cholesky

_CONE = 1e-10  # relative accuracy of the friction cone
_ITERATIONS = 60


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
            _forward(L, rows[i, a])


@njit(cache=True)
def _assemble(rows, free, target, closed, mu, ridge, owner, G, b):
    """Write the contact equations G f = b of all closed points; return their number of rows."""
    size = 0
    for i in range(closed.size):
        if closed[i]:
            for a in range(0 if mu[i] > 0.0 else 2, 3):
                owner[size, 0], owner[size, 1] = i, a
                size += 1
    largest = 0.0
    nv = free.size
    for r in range(size):
        i, a = owner[r]
        s = target[i, a]
        for c in range(nv):
            s += rows[i, a, c] * free[c]
        b[r] = -s
        for k in range(r + 1):
            s = 0.0
            j, d = owner[k]
            for c in range(nv):
                s += rows[i, a, c] * rows[j, d, c]
            G[r, k] = s
            G[k, r] = s
        largest = max(largest, G[r, r])
    for r in range(size):
        G[r, r] += ridge[owner[r, 0]] * largest
    return size


@njit(cache=True)
def _friction(G, b, owner, size, mu, yielding, f):
    """Solve (G + diag(yielding)) f = b with yielding >= 0 such that every cone holds.

    ``yielding`` (P,) is -w / f_t of a sliding point over T, 0 of a sticking one. Newton on
    mu f_n / |f_t| = 1, which is nearly affine in it (as in trust regions).
    """
    H = np.empty((size, size))
    L = np.zeros((size, size))
    slope = np.empty(size)
    low = np.zeros(mu.size)
    high = np.full(mu.size, np.inf)
    for _ in range(_ITERATIONS):
        for r in range(size):
            for k in range(size):
                H[r, k] = G[r, k]
            if owner[r, 1] < 2:
                H[r, r] += yielding[owner[r, 0]]
            f[r] = b[r]
        if not cholesky(H, L):
            return False
        _forward(L, f)
        _backward(L, f)
        settled = True
        for r in range(2, size):
            i = owner[r, 0]
            if owner[r, 1] != 2 or mu[i] == 0.0 or mu[i] == np.inf:
                continue
            normal = f[r]
            tangent = math.hypot(f[r - 2], f[r - 1])
            excess = tangent - mu[i] * normal
            if abs(excess) <= _CONE * abs(mu[i] * normal) or (excess < 0.0 and yielding[i] == 0.0):
                continue
            settled = False
            if excess > 0.0:
                low[i] = yielding[i]
            else:
                high[i] = yielding[i]
            guess = np.inf
            if normal > 0.0 and tangent > 0.0:
                slope[:] = 0.0
                slope[r - 2], slope[r - 1] = -f[r - 2], -f[r - 1]
                _forward(L, slope)
                _backward(L, slope)
                along = (f[r - 2] * slope[r - 2] + f[r - 1] * slope[r - 1]) / tangent
                ratio = mu[i] * normal / tangent
                rate = (mu[i] * slope[r] - ratio * along) / tangent
                if rate > 0.0:
                    guess = yielding[i] + (1.0 - ratio) / rate
                    if low[i] == 0.0 and guess < 0.0:
                        guess = 0.0
            yielding[i] = _inside(guess, low[i], high[i], G[r, r])
            if high[i] - low[i] <= 1e-14 * high[i]:  # moved by the other points: begin again
                low[i], high[i] = 0.0, np.inf
        if settled:
            break
    return True


@njit(cache=True)
def _inside(guess, low, high, scale):
    """Keep an iterate inside its bracket, else divide the bracket geometrically."""
    if low < guess < high or (guess == 0.0 and low == 0.0):
        return guess
    if high == np.inf:
        return 4.0 * low + scale
    return math.sqrt(max(low, 1e-12 * high) * high)


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
        _forward(L, rows[f])


@njit(cache=True)
def _twist_torque(force, closed, foot_of, torsion, spin, torque):
    """Write -clip(c spin) within the radius times the normal load; return the largest change."""
    change = 0.0
    for f in range(spin.size):
        load = 0.0
        for i in range(closed.size):
            if foot_of[i] == f and closed[i] and force[i, 2] > 0.0:
                load += force[i, 2]
        limit = torsion[f, 1] * load if load > 0.0 else 0.0
        new = -min(max(torsion[f, 0] * spin[f], -limit), limit)
        change = max(change, abs(new - torque[f]))
        torque[f] = new
    return change


@njit(cache=True)
def solve(
    L, rows, free, target, closed, mu, ridge, yielding, foot_of, torsion, twist_rows, spin,
    x, force,
):  # fmt: skip
    """Meet the contact conditions of the closed points.

    ``free`` (nv,) is L⁻¹ times the unconstrained right side, ``ridge`` (P,) the relative compliance
    that shares force between redundant points, ``yielding`` (P,) a first guess that is improved,
    ``torsion`` (F, 2) friction torque about the normal: per rate, and per normal
    force. Writes x (nv,) and force (P, 3); returns False if there is no solution.
    """
    count = 3 * closed.size
    G = np.empty((count, count))
    b = np.empty(count)
    f = np.empty(count)
    owner = np.empty((count, 2), np.int64)
    torque = np.zeros(spin.size)
    _twist_torque(force, closed, foot_of, torsion, spin, torque)
    for _ in range(_ITERATIONS):
        x[:] = free
        for k in range(spin.size):
            if torque[k] != 0.0:
                for c in range(x.size):
                    x[c] += twist_rows[k, c] * torque[k]
        size = _assemble(rows, x, target, closed, mu, ridge, owner, G, b)
        force[:] = 0.0
        if size > 0 and not _friction(G, b, owner, size, mu, yielding, f[:size]):
            return False
        for r in range(size):
            i, a = owner[r]
            force[i, a] = f[r]
            for c in range(x.size):
                x[c] += rows[i, a, c] * f[r]
        if _twist_torque(force, closed, foot_of, torsion, spin, torque) < 1e-10:
            break
    _backward(L, x)
    return True


@njit(cache=True)
def settle(
    L, rows, free, target, touching, closed, mu, ridge, yielding, foot_of, torsion, twist_rows,
    spin, tolerance, x, force,
):  # fmt: skip
    """Find which touching points are closed, so that none pulls and none sinks in.

    Works on accelerations and forces, or on velocities and impulses (plastic impact, without
    torsion). Starts from ``closed`` and changes the worst point until nothing is violated. Returns
    0 when settled, 1 if no consistent set was found, 2 if the equations have no solution.
    """
    count = closed.size
    for _ in range(8 * count + 8):
        if not solve(
            L, rows, free, target, closed, mu, ridge, yielding, foot_of, torsion, twist_rows, spin,
            x, force,
        ):  # fmt: skip
            return 2
        worst, which = tolerance, -1
        for i in range(count):
            if touching[i] == 0:
                continue
            if closed[i]:
                bad = -force[i, 2]
            else:  # points of one sole may sink as little as they yield
                bad = -target[i, 2] - _along(L, rows, i, x) - 1e3 * ridge[i]
            if bad > worst:
                worst, which = bad, i
        if which < 0:
            return 0
        closed[which] = 1 - closed[which]
        yielding[which] = 0.0
    return 1


@njit(cache=True)
def _along(L, rows, i, x):
    """Normal component of J x, from rows = L⁻¹ (C J)ᵀ: (Lᵀ x) · rows."""
    s = 0.0
    for c in range(x.size):
        lx = 0.0
        for k in range(c, x.size):
            lx += L[k, c] * x[k]
        s += lx * rows[i, 2, c]
    return s


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
def evaluate(
    M, nle, frames, v, joint, motor, spring, shape, ground, rates, state, load, torsion, instant
):
    """Spring torque, applied forces, contact forces and acceleration at one instant.

    Groups of arrays, all preallocated: ``frames`` (J, R, p, drift) of the feet and loaded frames,
    ``joint`` link positions (n,), ``motor`` (n, 2) angle and speed, ``spring`` (K, D_s),
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
    nv, n, count = v.size, joint.size, closed.size
    for i in range(nv):
        right[i] = -nle[i]
    for i in range(n):
        tau[i] = spring[0][i] * (motor[i, 0] - joint[i])
        tau[i] += spring[1][i] * (motor[i, 1] - v[nv - n + i])
        right[nv - n + i] += tau[i]
    power[3] = 0.0
    for k in range(load.shape[0]):
        for a in range(3):
            if load[k, a] != 0.0:
                power[3] += load[k, a] * velocity[count + k, a]
                for c in range(nv):
                    right[c] += J[count + k, a, c] * load[k, a]
    demand(C, position, anchor, velocity, drift, rates[0], rates[1], target)
    power[4] = 0.0
    for i in range(nv):
        for j in range(nv):
            power[4] += 0.5 * v[i] * M[i, j] * v[j]
    if not cholesky(M, L):
        return False
    project(L, J, C, rows)
    twist(L, J_frame, v, C, frame_of[:count], twist_rows, spin)
    free = right.copy()
    _forward(L, free)
    solved = solve(
        L, rows, free, target, closed, mu, ridge, yielding, frame_of[:count], torsion, twist_rows,
        spin, acceleration, force,
    )  # fmt: skip
    _contact_power(C, velocity, force, closed, power)
    torque = np.zeros(spin.size)
    _twist_torque(force, closed, frame_of[:count], torsion, spin, torque)
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
    L, rows, closed = instant[7], instant[8], state[0]
    project(L, instant[10], ground[0], rows)
    demand(ground[0], one, one, one, one, 50.0, 1e-3, one.copy())
    settle(
        L, rows, v, one, closed, closed, ground[2], ground[3], state[1], shape[0], torsion,
        instant[12], instant[13], 1e-9, v.copy(), one.copy(),
    )  # fmt: skip
    margins(ground[0], one, one, np.zeros(1), closed, 1.0, np.zeros(1))
