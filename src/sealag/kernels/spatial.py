"""Vectors, rotations and motion on SE(3) x R^n.

A vector is a tuple of three numbers, a rotation a tuple of three rows: compiled code keeps both in
registers. Configurations are laid out as in Pinocchio, [position, quaternion x y z w, joints], and
velocities [linear, angular (both in the base frame), joint rates]; ``base`` is 6 for a floating
base, 0 for a fixed one.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def vector(rows, i):
    """Return row i (3,) of an array."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@njit(cache=True)
def linear(twists, i):
    """Return the linear part of the spatial vector in row i (6,) of an array."""
    return twists[i, 0], twists[i, 1], twists[i, 2]


@njit(cache=True)
def angular(twists, i):
    """Return the angular part of the spatial vector in row i (6,) of an array."""
    return twists[i, 3], twists[i, 4], twists[i, 5]


@njit(cache=True)
def rotation(matrices, i):
    """Return matrix i (3, 3) of a stack."""
    R = matrices[i]
    return (
        (R[0, 0], R[0, 1], R[0, 2]), (R[1, 0], R[1, 1], R[1, 2]), (R[2, 0], R[2, 1], R[2, 2]),
    )  # fmt: skip


@njit(cache=True)
def put_vector(rows, i, a):
    """Write a into row i (3,) of an array."""
    rows[i, 0], rows[i, 1], rows[i, 2] = a


@njit(cache=True)
def put_twist(twists, i, a, b):
    """Write linear part a and angular part b into row i (6,) of an array."""
    twists[i, 0], twists[i, 1], twists[i, 2] = a
    twists[i, 3], twists[i, 4], twists[i, 5] = b


@njit(cache=True)
def put_rotation(matrices, i, R):
    """Write R into matrix i (3, 3) of a stack."""
    a, b, c = R
    put_vector(matrices[i], 0, a)
    put_vector(matrices[i], 1, b)
    put_vector(matrices[i], 2, c)


@njit(cache=True)
def add(a, b):
    """Return a + b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ax + bx, ay + by, az + bz


@njit(cache=True)
def subtract(a, b):
    """Return a − b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ax - bx, ay - by, az - bz


@njit(cache=True)
def scale(s, a):
    """Return s a."""
    x, y, z = a
    return s * x, s * y, s * z


@njit(cache=True)
def dot(a, b):
    """Return aᵀ b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ax * bx + ay * by + az * bz


@njit(cache=True)
def cross(a, b):
    """Return a × b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True)
def rotate(R, a):
    """Return R a."""
    x, y, z = R
    return dot(x, a), dot(y, a), dot(z, a)


@njit(cache=True)
def transpose(R):
    """Return Rᵀ."""
    (a, b, c), (d, e, f), (g, h, i) = R
    return (a, d, g), (b, e, h), (c, f, i)


@njit(cache=True)
def compose(A, B):
    """Return A B."""
    Bt = transpose(B)
    x, y, z = A
    return rotate(Bt, x), rotate(Bt, y), rotate(Bt, z)


@njit(cache=True)
def rotation_of(x, y, z, w):
    """Return the rotation of a unit quaternion."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@njit(cache=True)
def integrate(q, u, base, out):
    """Write q + u, the base moved by the exponential of its twist, into ``out``."""
    if base == 0:
        out[:] = q + u
        return
    x, y, z, w = q[3], q[4], q[5], q[6]
    wx, wy, wz = u[3], u[4], u[5]
    angle2 = wx * wx + wy * wy + wz * wz
    if angle2 < 1e-6:  # series: the next terms are below 1e-18 of the sum
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
    move, spin, axis = (u[0], u[1], u[2]), (wx, wy, wz), (x, y, z)
    turn = cross(spin, move)
    p = add(add(move, scale(b, turn)), scale(c, cross(spin, turn)))
    t = scale(2.0, cross(axis, p))
    out[0], out[1], out[2] = add(
        add((q[0], q[1], q[2]), p), add(scale(w, t), cross(axis, t))
    )  # fmt: skip
    dx, dy, dz, dw = half * wx, half * wy, half * wz, cos_half
    out[3] = w * dx + x * dw + y * dz - z * dy
    out[4] = w * dy + y * dw + z * dx - x * dz
    out[5] = w * dz + z * dw + x * dy - y * dx
    out[6] = w * dw - x * dx - y * dy - z * dz
    length = math.sqrt(out[3] ** 2 + out[4] ** 2 + out[5] ** 2 + out[6] ** 2)
    for i in range(3, 7):
        out[i] /= length
    for i in range(7, q.size):
        out[i] = q[i] + u[i - 1]


@njit(cache=True)
def tangent_rate(u, v, base, out):
    """Write the rate of the coordinates u of q0 + u whose velocity is v (to fourth order)."""
    out[:] = v
    if base == 0:
        return
    move, spin = (u[0], u[1], u[2]), (u[3], u[4], u[5])
    first, turn = _bracket(move, spin, (v[0], v[1], v[2]), (v[3], v[4], v[5]))
    second, turn_2 = _bracket(move, spin, first, turn)
    dx, dy, dz = add(scale(0.5, first), scale(1.0 / 12.0, second))
    rx, ry, rz = add(scale(0.5, turn), scale(1.0 / 12.0, turn_2))
    out[0] += dx
    out[1] += dy
    out[2] += dz
    out[3] += rx
    out[4] += ry
    out[5] += rz


@njit(cache=True)
def _bracket(move, spin, v, omega):
    """Return the Lie bracket of two twists, linear and angular part."""
    return add(cross(spin, v), cross(move, omega)), cross(spin, omega)


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
