"""Contact kernels: point kinematics, constrained dynamics, and which contacts hold.

Every foot is one or several points. A point's contact frame C has rows tangent, tangent, normal;
forces and impulses are given in it. Modes are those of ``kernels.rigid``: OPEN, STICK, SLIP.
"""

import math

import numpy as np
from numba import njit

from sealag.kernels.rigid import (
    _REST,
    OPEN,
    SLIP,
    STICK,
    _backward,
    _eliminate,
    _forward,
    cholesky,
)

_RIDGE = 1e-11  # relative diagonal that shares force between redundant points


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
def demand(C, position, anchor, velocity, drift, gain, out):
    """Write J̇v + 2 gain v + gain² (p - anchor) of every point in its contact frame (P, 3)."""
    for i in range(C.shape[0]):
        for a in range(3):
            s = 0.0
            for b in range(3):
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
def solve(L, rows, free, target, mode, slide, mu, x, force):
    """Meet the contact conditions of the given modes.

    ``free`` (nv,) is L⁻¹ times the unconstrained right side; ``target`` (P, 3) the part of the
    points' acceleration (or velocity) that is not J x. Writes x (nv,) and force (P, 3); returns
    False if the contact equations have no solution.
    """
    nv = free.size
    size = 0
    for i in range(mode.size):
        size += 3 if mode[i] == STICK else (1 if mode[i] == SLIP else 0)
    Y = np.empty((size, nv))
    G = np.empty((size, size))
    b = np.empty(size)
    owner = np.empty((size, 2), np.int64)
    k = 0
    for i in range(mode.size):
        if mode[i] == STICK:
            for a in range(3):
                owner[k, 0], owner[k, 1] = i, a
                Y[k] = rows[i, a]
                k += 1
        elif mode[i] == SLIP:
            owner[k, 0], owner[k, 1] = i, 2
            for c in range(nv):
                Y[k, c] = rows[i, 2, c] - mu[i] * (
                    slide[i, 0] * rows[i, 0, c] + slide[i, 1] * rows[i, 1, c]
                )
            k += 1
    largest = 0.0
    for r in range(size):
        i, a = owner[r]
        s = target[i, a]
        for c in range(nv):
            s += rows[i, a, c] * free[c]
        b[r] = -s
        for k in range(size):
            s = 0.0
            for c in range(nv):
                s += rows[i, a, c] * Y[k, c]
            G[r, k] = s
        largest = max(largest, G[r, r])
    for r in range(size):
        G[r, r] += _RIDGE * largest
    if not _eliminate(G, b, size):
        return False
    force[:] = 0.0
    x[:] = free
    for r in range(size):
        i, a = owner[r]
        force[i, a] += b[r]
        if mode[i] == SLIP:
            force[i, 0] -= mu[i] * slide[i, 0] * b[r]
            force[i, 1] -= mu[i] * slide[i, 1] * b[r]
        for c in range(nv):
            x[c] += Y[r, c] * b[r]
    _backward(L, x)
    return True


@njit(cache=True)
def forward_dynamics(
    M, right, J, C, target, velocity, mode, slide, mu, L, rows, acceleration, force
):
    """Acceleration (nv,) and contact forces (P, 3) under M v̇ = right + Jᵀf; False if singular."""
    if not cholesky(M, L):
        return False
    project(L, J, C, rows)
    _aim(C, velocity, mode, slide)
    free = right.copy()
    _forward(L, free)
    return solve(L, rows, free, target, mode, slide, mu, acceleration, force)


@njit(cache=True)
def _aim(C, velocity, mode, slide):
    """Turn the sliding direction of every slipping point along its velocity."""
    for i in range(mode.size):
        if mode[i] == SLIP:
            a = C[i, 0, 0] * velocity[i, 0] + C[i, 0, 1] * velocity[i, 1]
            a += C[i, 0, 2] * velocity[i, 2]
            b = C[i, 1, 0] * velocity[i, 0] + C[i, 1, 1] * velocity[i, 1]
            b += C[i, 1, 2] * velocity[i, 2]
            speed = math.hypot(a, b)
            if speed > _REST:
                slide[i, 0], slide[i, 1] = a / speed, b / speed


@njit(cache=True)
def settle(L, rows, free, target, touching, rest, mode, slide, mu, tolerance, x, force):
    """Find modes in which no contact pulls, none sinks in and every friction cone holds.

    Works on accelerations and forces, or on velocities and impulses (plastic impact). ``rest`` is
    the mode that a point takes when it closes. Starts from ``mode`` and changes the worst point
    until nothing is violated. Returns 0 when settled, 1 if no consistent set was found, 2 if the
    equations have no solution.
    """
    count = mode.size
    for _ in range(8 * count + 8):
        if not solve(L, rows, free, target, mode, slide, mu, x, force):
            return 2
        worst, which, change = tolerance, -1, OPEN
        for i in range(count):
            if touching[i] == 0:
                continue
            if mode[i] == OPEN:
                rate = target[i, 2]
                sink = -rate - _along(L, rows, i, x)
                if sink > worst:
                    worst, which, change = sink, i, rest[i]
            elif -force[i, 2] > worst:
                worst, which, change = -force[i, 2], i, OPEN
            elif mode[i] == STICK:
                excess = math.hypot(force[i, 0], force[i, 1]) - mu[i] * force[i, 2]
                if excess > worst:
                    worst, which, change = excess, i, SLIP
        if which < 0:
            return 0
        if change == SLIP and mode[which] == STICK:
            pull = math.hypot(force[which, 0], force[which, 1])
            slide[which, 0] = -force[which, 0] / pull
            slide[which, 1] = -force[which, 1] / pull
        mode[which] = change
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
def margins(C, velocity, force, gap, mode, slide, mu, weight, out):
    """Write for every point how far each of its two ending conditions is from happening (P, 2).

    OPEN: the gap (m), inf if it widens. STICK: the normal force and the friction cone's margin
    (body weights). SLIP: the normal force and the speed (m/s) along the sliding direction at the
    beginning of the step.
    """
    for i in range(mode.size):
        out[i, 1] = np.inf
        if mode[i] == OPEN:
            rate = 0.0
            for b in range(3):
                rate += C[i, 2, b] * velocity[i, b]
            out[i, 0] = gap[i] if rate < 0.0 else np.inf
            continue
        out[i, 0] = force[i, 2] / weight
        if mode[i] == STICK:
            if mu[i] != np.inf:
                grip = mu[i] * force[i, 2] - math.hypot(force[i, 0], force[i, 1])
                out[i, 1] = grip / weight
        else:
            s = 0.0
            for b in range(3):
                s += (slide[i, 0] * C[i, 0, b] + slide[i, 1] * C[i, 1, b]) * velocity[i, b]
            out[i, 1] = s


@njit(cache=True)
def contact_power(C, velocity, force, mode, out):
    """Write the power of sticking (out[0]) and sliding (out[1]) contact forces."""
    out[0] = 0.0
    out[1] = 0.0
    for i in range(mode.size):
        if mode[i] == OPEN:
            continue
        tangent = 0.0
        normal = 0.0
        for b in range(3):
            tangent += (force[i, 0] * C[i, 0, b] + force[i, 1] * C[i, 1, b]) * velocity[i, b]
            normal += force[i, 2] * C[i, 2, b] * velocity[i, b]
        if mode[i] == SLIP:
            out[0] += normal
            out[1] += tangent
        else:
            out[0] += normal + tangent


@njit(cache=True)
def evaluate(
    M, nle, frames, v, joint, motor, spring, shape, ground, gain, state, load, torsion, instant
):
    """Spring torque, applied forces, contact forces and acceleration at one instant.

    Groups of arrays, all preallocated: ``frames`` (J, R, p, drift) of the feet and loaded frames,
    ``joint`` link positions (n,), ``motor`` (n, 2) angle and speed, ``spring`` (K, D_s),
    ``shape`` (frame_of, offset, count of contact points), ``ground`` (C, anchor, mu), ``state``
    (mode, slide), ``load`` (forces (L, 3) on the points after the contact points), ``torsion``
    (F, 2) coefficient and limit. Writes ``instant`` (tau, acceleration, force, position, velocity,
    target, right, L, rows, power, J, drift); power: holding, sliding, torsional, load, kinetic energy.
    """
    J_frame, R, p, drift_frame = frames
    frame_of, offset = shape
    C, anchor, mu = ground
    mode, slide = state
    tau, acceleration, force, position, velocity, target, right, L, rows, power, J, drift = instant
    points(J_frame, R, p, drift_frame, v, frame_of, offset, J, position, velocity, drift)
    nv, n, count = v.size, joint.size, mode.size
    for i in range(nv):
        right[i] = -nle[i]
    for i in range(n):
        tau[i] = spring[0][i] * (motor[i, 0] - joint[i])
        tau[i] += spring[1][i] * (motor[i, 1] - v[nv - n + i])
        right[nv - n + i] += tau[i]
    power[2] = _torsion(J_frame, v, torsion, C, mode, frame_of, right)
    power[3] = 0.0
    for k in range(load.shape[0]):
        for a in range(3):
            if load[k, a] != 0.0:
                power[3] += load[k, a] * velocity[count + k, a]
                for c in range(nv):
                    right[c] += J[count + k, a, c] * load[k, a]
    demand(C, position, anchor, velocity, drift, gain, target)
    solved = forward_dynamics(
        M, right, J, C, target, velocity, mode, slide, mu, L, rows, acceleration, force
    )
    contact_power(C, velocity, force, mode, power)
    power[4] = 0.0
    for i in range(nv):
        for j in range(nv):
            power[4] += 0.5 * v[i] * M[i, j] * v[j]
    return solved


@njit(cache=True)
def _torsion(J_frame, v, torsion, C, mode, frame_of, right):
    """Add the patch friction torque about the normal of every loaded foot; return its power."""
    total = 0.0
    done = -1
    for i in range(mode.size):
        f = frame_of[i]
        if mode[i] == OPEN or f == done or torsion[f, 0] == 0.0:
            continue
        done = f
        spin = 0.0
        for a in range(3):
            for c in range(v.size):
                spin += C[i, 2, a] * J_frame[f, 3 + a, c] * v[c]
        torque = -min(max(torsion[f, 0] * spin, -torsion[f, 1]), torsion[f, 1])
        total += torque * spin
        for a in range(3):
            for c in range(v.size):
                right[c] += C[i, 2, a] * J_frame[f, 3 + a, c] * torque
    return total
