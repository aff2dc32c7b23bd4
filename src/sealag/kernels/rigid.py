"""Rigid-body kernels: motion on SE(3) x R^n, stages of the Runge-Kutta step, contact solves.

Layout as in Pinocchio: configuration [position, quaternion x y z w, joints], velocity [linear,
angular (both in the base frame), joint rates]; ``base`` is 6 for a floating base, 0 for a fixed
one.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def integrate(q, u, base, out):
    """Write q + u, the base moved by the exponential of its twist, into ``out``."""
    if base == 0:
        out[:] = q + u
        return
    x, y, z, w = q[3], q[4], q[5], q[6]
    wx, wy, wz = u[3], u[4], u[5]
    angle2 = wx * wx + wy * wy + wz * wz
    if angle2 < 1e-6:
        half = 0.5 - angle2 / 48.0 + angle2 * angle2 / 3840.0
        cos_half = 1.0 - angle2 / 8.0 + angle2 * angle2 / 384.0
        b = 0.5 - angle2 / 24.0 + angle2 * angle2 / 720.0
        c = 1.0 / 6.0 - angle2 / 120.0 + angle2 * angle2 / 5040.0
    else:
        angle = math.sqrt(angle2)
        half = math.sin(0.5 * angle) / angle
        cos_half = math.cos(0.5 * angle)
        b = (1.0 - math.cos(angle)) / angle2
        c = (angle - math.sin(angle)) / (angle2 * angle)
    turn = np.empty(3)
    turn2 = np.empty(3)
    _cross(u[3:6], u[0:3], turn)
    _cross(u[3:6], turn, turn2)
    p = u[0:3] + b * turn + c * turn2
    axis = q[3:6]
    t = np.empty(3)
    _cross(axis, p, t)
    t *= 2.0
    t2 = np.empty(3)
    _cross(axis, t, t2)
    out[0:3] = q[0:3] + p + w * t + t2
    dx, dy, dz, dw = half * wx, half * wy, half * wz, cos_half
    out[3] = w * dx + x * dw + y * dz - z * dy
    out[4] = w * dy + y * dw + z * dx - x * dz
    out[5] = w * dz + z * dw + x * dy - y * dx
    out[6] = w * dw - x * dx - y * dy - z * dz
    out[3:7] /= math.sqrt(out[3] ** 2 + out[4] ** 2 + out[5] ** 2 + out[6] ** 2)
    out[7:] = q[7:] + u[6:]


@njit(cache=True)
def tangent_rate(u, v, base, out):
    """Write the rate of the coordinates u of q0 + u whose velocity is v (to fourth order)."""
    out[:] = v
    if base == 0:
        return
    first = np.empty(6)
    second = np.empty(6)
    _bracket(u, v, first)
    _bracket(u, first, second)
    for i in range(6):
        out[i] += 0.5 * first[i] + second[i] / 12.0


@njit(cache=True)
def _bracket(a, b, out):
    t = np.empty(3)
    _cross(a[3:6], b[0:3], out[0:3])
    _cross(a[0:3], b[3:6], t)
    out[0:3] += t
    _cross(a[3:6], b[3:6], out[3:6])


@njit(cache=True)
def stage(q0, v0, rate, acceleration, step, base, u, q, v, next_rate):
    """Move to one Runge-Kutta stage: u = step rate, v = v0 + step acceleration, q = q0 + u."""
    for i in range(v0.size):
        u[i] = step * rate[i]
        v[i] = v0[i] + step * acceleration[i]
    integrate(q0, u, base, q)
    tangent_rate(u, v, base, next_rate)


@njit(cache=True)
def combine(q0, v0, rates, accelerations, step, base, q, v):
    """Close the fourth-order Runge-Kutta step from its four stages' rates and accelerations."""
    u = np.empty(v0.size)
    for i in range(v0.size):
        u[i] = step / 6.0 * (rates[0, i] + 2.0 * (rates[1, i] + rates[2, i]) + rates[3, i])
        v[i] = v0[i] + step / 6.0 * (
            accelerations[0, i]
            + 2.0 * (accelerations[1, i] + accelerations[2, i])
            + accelerations[3, i]
        )
    integrate(q0, u, base, q)


@njit(cache=True)
def cholesky(A, L):
    """Write the lower Cholesky factor of A into L; return False if A is not positive definite."""
    n = A.shape[0]
    for j in range(n):
        for i in range(j, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if not s > 0.0:
                    return False
                L[j, j] = math.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
    return True


@njit(cache=True)
def forward_solve(L, x):
    for i in range(x.size):
        s = x[i]
        for k in range(i):
            s -= L[i, k] * x[k]
        x[i] = s / L[i, i]


@njit(cache=True)
def backward_solve(L, x):
    for i in range(x.size - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, x.size):
            s -= L[k, i] * x[k]
        x[i] = s / L[i, i]


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    q, v, rates = np.zeros(8), np.zeros(7), np.zeros((4, 7))
    q[6] = 1.0
    stage(q, v, rates[0], rates[1], 1e-3, 6, v.copy(), q.copy(), v.copy(), rates[2])
    combine(q, v, rates, rates, 1e-3, 6, q.copy(), v.copy())
