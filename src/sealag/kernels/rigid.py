"""Rigid-body kernels: motion on SE(3) x R^n, stages of the Runge-Kutta step, contact solves.

Layout as in Pinocchio: configuration [position, quaternion x y z w, joints], velocity [linear,
angular (both in the base frame), joint rates]; ``base`` is 6 for a floating base, 0 for a fixed
one.
"""

import math

import numpy as np
from numba import njit

GRAVITY = 9.81  # m/s², as in Pinocchio's models


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
def frames(terms, mounts, J, R, p, bias):
    """Write Jacobian, rotation, position and J̇ v of F frames, world-aligned, linear rows first.

    Args:
        terms: as `sealag.robot.Workspace.terms`.
        mounts: as `sealag.robot.Robot.frame_mounts`.
        J: (F, 6, nv), written.
        R: (F, 3, 3), written.
        p: (F, 3) m, written.
        bias: (F, 6) acceleration at zero v̇, written.
    """
    J_world, R_joint, p_joint, twist, rate = terms[2], terms[3], terms[4], terms[5], terms[6]
    joint, rotation, position, support = mounts
    u = np.empty(3)
    a = np.empty(3)
    t = np.empty(3)
    for f in range(joint.size):
        j = joint[f]
        _cross(twist[j, 3:6], position[f], u)
        _cross(rate[j, 3:6], position[f], a)
        for i in range(3):
            u[i] += twist[j, i]
            a[i] += rate[j, i]
        _cross(twist[j, 3:6], u, t)
        for i in range(3):
            x, y, z = R_joint[j, i, 0], R_joint[j, i, 1], R_joint[j, i, 2]
            p[f, i] = p_joint[j, i] + (x * position[f, 0] + y * position[f, 1] + z * position[f, 2])
            bias[f, i] = x * (a[0] + t[0]) + y * (a[1] + t[1]) + z * (a[2] + t[2])
            if i == 2:
                bias[f, i] -= GRAVITY
            bias[f, 3 + i] = x * rate[j, 3] + y * rate[j, 4] + z * rate[j, 5]
            for c in range(3):
                R[f, i, c] = x * rotation[f, 0, c] + y * rotation[f, 1, c] + z * rotation[f, 2, c]
        for c in range(J_world.shape[0]):
            if support[f, c] == 0:
                J[f, :, c] = 0.0
                continue
            x, y, z = J_world[c, 3], J_world[c, 4], J_world[c, 5]
            J[f, 0, c] = J_world[c, 0] + y * p[f, 2] - z * p[f, 1]
            J[f, 1, c] = J_world[c, 1] + z * p[f, 0] - x * p[f, 2]
            J[f, 2, c] = J_world[c, 2] + x * p[f, 1] - y * p[f, 0]
            J[f, 3, c], J[f, 4, c], J[f, 5, c] = x, y, z


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


def empty_terms(nv, joints):
    """Return zeros with the layout of `sealag.robot.Workspace.terms`, to compile kernels with."""
    placed = np.zeros((joints, 12))
    rotations = placed[:, :9].reshape(joints, 3, 3)
    return (
        np.eye(nv), np.zeros(nv), np.zeros((nv, 6)), rotations.transpose(0, 2, 1),
        placed[:, 9:], np.zeros((joints, 6)), np.zeros((joints, 6)),
    )  # fmt: skip


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    q, v, rates = np.zeros(8), np.zeros(7), np.zeros((4, 7))
    q[6] = 1.0
    stage(q, v, rates[0], rates[1], 1e-3, 6, v.copy(), q.copy(), v.copy(), rates[2])
    combine(q, v, rates, rates, 1e-3, 6, q.copy(), v.copy())
