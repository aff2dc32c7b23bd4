"""Vectors, rotations and motion on SE(3) x R^n.

A vector is a tuple of three numbers, a rotation a tuple of three rows: compiled code keeps both in
registers. Configurations are laid out as in Pinocchio, [position, quaternion x y z w, joints], and
velocities [linear, angular (both in the base frame), joint rates]; ``base`` is 6 for a floating
base, 0 for a fixed one.
"""

import math

from sealag.kernels._jit import inner


@inner
def vector(rows, i):
    """Return row i (3,) of an array."""
    return rows[i, 0], rows[i, 1], rows[i, 2]


@inner
def linear(twists, i):
    """Return the linear part of the spatial vector in row i (6,) of an array."""
    return twists[i, 0], twists[i, 1], twists[i, 2]


@inner
def angular(twists, i):
    """Return the angular part of the spatial vector in row i (6,) of an array."""
    return twists[i, 3], twists[i, 4], twists[i, 5]


@inner
def rotation(matrices, i):
    """Return matrix i (3, 3) of a stack."""
    return (
        (matrices[i, 0, 0], matrices[i, 0, 1], matrices[i, 0, 2]),
        (matrices[i, 1, 0], matrices[i, 1, 1], matrices[i, 1, 2]),
        (matrices[i, 2, 0], matrices[i, 2, 1], matrices[i, 2, 2]),
    )


@inner
def put_vector(rows, i, a):
    """Write a into row i (3,) of an array."""
    rows[i, 0], rows[i, 1], rows[i, 2] = a


@inner
def put_twist(twists, i, a, b):
    """Write linear part a and angular part b into row i (6,) of an array."""
    twists[i, 0], twists[i, 1], twists[i, 2] = a
    twists[i, 3], twists[i, 4], twists[i, 5] = b


@inner
def put_rotation(matrices, i, R):
    """Write R into matrix i (3, 3) of a stack."""
    (a, b, c), (d, e, f), (g, h, j) = R
    matrices[i, 0, 0], matrices[i, 0, 1], matrices[i, 0, 2] = a, b, c
    matrices[i, 1, 0], matrices[i, 1, 1], matrices[i, 1, 2] = d, e, f
    matrices[i, 2, 0], matrices[i, 2, 1], matrices[i, 2, 2] = g, h, j


@inner
def add(a, b):
    """Return a + b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ax + bx, ay + by, az + bz


@inner
def subtract(a, b):
    """Return a − b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ax - bx, ay - by, az - bz


@inner
def scale(s, a):
    """Return s a."""
    x, y, z = a
    return s * x, s * y, s * z


@inner
def dot(a, b):
    """Return aᵀ b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ax * bx + ay * by + az * bz


@inner
def cross(a, b):
    """Return a × b."""
    (ax, ay, az), (bx, by, bz) = a, b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inner
def rotate(R, v):
    """Return R v."""
    (a, b, c), (d, e, f), (g, h, i) = R
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


@inner
def transpose(R):
    """Return Rᵀ."""
    (a, b, c), (d, e, f), (g, h, i) = R
    return (a, d, g), (b, e, h), (c, f, i)


@inner
def compose(A, B):
    """Return A B."""
    (a, b, c), (d, e, f), (g, h, i) = A
    (j, k, l), (m, n, o), (p, q, r) = B
    return (
        (a * j + b * m + c * p, a * k + b * n + c * q, a * l + b * o + c * r),
        (d * j + e * m + f * p, d * k + e * n + f * q, d * l + e * o + f * r),
        (g * j + h * m + i * p, g * k + h * n + i * q, g * l + h * o + i * r),
    )


@inner
def rotation_of(x, y, z, w):
    """Return the rotation of a unit quaternion."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@inner
def integrate(q, u, base, out):
    """Write q + u, the base moved by the exponential of its twist, into ``out``."""
    if base == 0:
        for i in range(q.size):
            out[i] = q[i] + u[i]
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


@inner
def tangent_rate(u, v, base, out):
    """Write the rate of the coordinates u of q0 + u whose velocity is v (to fourth order)."""
    for i in range(v.size):
        out[i] = v[i]
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


@inner
def _bracket(move, spin, v, omega):
    """Return the Lie bracket of two twists, linear and angular part."""
    return add(cross(spin, v), cross(move, omega)), cross(spin, omega)


@inner
def stage(q0, v0, rate, acceleration, step, base, u, q, v, next_rate):
    """Move to one Runge-Kutta stage: u = step rate, v = v0 + step acceleration, q = q0 + u."""
    for i in range(v0.size):
        u[i] = step * rate[i]
        v[i] = v0[i] + step * acceleration[i]
    integrate(q0, u, base, q)
    tangent_rate(u, v, base, next_rate)


@inner
def combine(q0, v0, rates, accelerations, step, base, u, q, v):
    """Close the fourth-order Runge-Kutta step from its four stages' rates and accelerations; u is
    scratch."""
    for i in range(v0.size):
        u[i] = step / 6.0 * (rates[0, i] + 2.0 * (rates[1, i] + rates[2, i]) + rates[3, i])
        v[i] = v0[i] + step / 6.0 * (
            accelerations[0, i]
            + 2.0 * (accelerations[1, i] + accelerations[2, i])
            + accelerations[3, i]
        )
    integrate(q0, u, base, q)
