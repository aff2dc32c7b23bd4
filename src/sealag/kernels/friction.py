"""Friction kernels: contact forces of closed points, and which points are closed.

A point's forces and impulses are given in its contact frame, whose rows are tangent, tangent,
normal. A closed point has no normal acceleration (but for the return to where it closed) and
Coulomb friction in the form

    w = v_t + T a_t,   |f_t| <= mu f_n,   w = 0 or f_t = -mu f_n w / |w|,

so that a point sticks whenever friction can stop it within the time T, and slides against the
velocity that it is about to have. The law is continuous; T is the step, and 0 is Coulomb's law.
"""

import math

import numpy as np
from numba import njit

from sealag.kernels.rigid import backward_solve, cholesky, forward_solve

_CONE = 1e-10  # relative accuracy of the friction cone
_ITERATIONS = 200
_STALE = 1e-4  # relative width of a bracket that has lost its root to another point's change


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
        forward_solve(L, f)
        backward_solve(L, f)
        settled = True
        for r in range(2, size):
            i = owner[r, 0]
            if owner[r, 1] != 2 or mu[i] == 0.0 or mu[i] == np.inf:
                continue
            excess = math.hypot(f[r - 2], f[r - 1]) - mu[i] * f[r]
            if abs(excess) <= _CONE * abs(mu[i] * f[r]) or (excess < 0.0 and yielding[i] == 0.0):
                continue
            settled = False
            if excess > 0.0:
                low[i] = yielding[i]
            else:
                high[i] = yielding[i]
            guess = _newton(L, f, r, mu[i], yielding[i], slope)
            if low[i] == 0.0 and guess < 0.0:
                guess = 0.0
            yielding[i] = _inside(guess, low[i], high[i], G[r, r])
            if high[i] - low[i] <= _STALE * high[i]:  # moved by the other points: begin again
                low[i], high[i] = 0.0, np.inf
        if settled:
            break
    return True


@njit(cache=True)
def _newton(L, f, r, mu, yielding, slope):
    """Newton iterate for mu f_n / |f_t| = 1 of the point whose normal row is r; inf if none."""
    tangent = math.hypot(f[r - 2], f[r - 1])
    if f[r] <= 0.0 or tangent == 0.0:
        return np.inf
    slope[:] = 0.0
    slope[r - 2], slope[r - 1] = -f[r - 2], -f[r - 1]
    forward_solve(L, slope)
    backward_solve(L, slope)
    along = (f[r - 2] * slope[r - 2] + f[r - 1] * slope[r - 1]) / tangent
    ratio = mu * f[r] / tangent
    rate = (mu * slope[r] - ratio * along) / tangent
    if rate <= 0.0:
        return np.inf
    return yielding + (1.0 - ratio) / rate


@njit(cache=True)
def _inside(guess, low, high, scale):
    """Keep an iterate inside its bracket, else divide the bracket geometrically."""
    if low < guess < high or (guess == 0.0 and low == 0.0):
        return guess
    if high == np.inf:
        return 4.0 * low + scale
    return math.sqrt(max(low, 1e-12 * high) * high)


@njit(cache=True)
def twist_torque(force, closed, foot_of, torsion, spin, torque):
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
    twist_torque(force, closed, foot_of, torsion, spin, torque)
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
        if twist_torque(force, closed, foot_of, torsion, spin, torque) < 1e-10:
            break
    backward_solve(L, x)
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


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    nv, closed, one = 2, np.ones(1, np.int64), np.zeros((1, 3))
    settle(
        np.eye(nv), np.zeros((1, 3, nv)) + 0.1, np.zeros(nv), one, closed, closed, np.ones(1),
        np.ones(1), np.zeros(1), np.zeros(1, np.int64), np.zeros((1, 2)), np.zeros((1, nv)),
        np.zeros(1), 1e-9, np.zeros(nv), one.copy(),
    )  # fmt: skip
