"""Terms of a tree of rigid bodies at one configuration and velocity.

A joint may follow another one's coordinate: its rate is then a constant multiple of that one's.
Everything is in world axes about one point that is at rest in the world and where the first joint
is now, so that no body needs axes of its own and no precision is lost far from the world's origin.
Spatial vectors are linear first. Configurations and velocities are laid out as in ``rigid``.
"""

import math

import numpy as np
from numba import njit

GRAVITY = 9.81  # m/s², as in Pinocchio's models
REVOLUTE, PRISMATIC, FREE = 0, 1, 2
_INERTIA = 10  # mass, mass times place (3), inertia xx xy xz yy yz zz about the point


def allocate(joint):
    """Return zeroed terms, as `evaluate` writes them.

    Args:
        joint: as in `evaluate`.

    Returns:
        Mass matrix M (nv, nv); Coriolis, centrifugal and gravity torques (nv,); the velocity that a
        coordinate's rate gives to what moves with each of the D degrees of freedom of the tree
        (D, 6); of every joint its rotation (N, 3, 3),
        position in the world (N, 3), velocity (N, 6) and, less gravity's, acceleration at zero v̇
        (N, 6); position, velocity, and acceleration at zero v̇ of the centre of mass (3, 3) and its
        Jacobian (3, nv); momentum, linear and angular about the centre of mass (6,); kinetic
        energy and gravity potential (2,).
    """
    count = len(joint)
    columns = sum(6 if kind == FREE else 1 for kind in joint[1:, 0])
    nv = columns - int((joint[:, 2] != joint[:, 3]).sum())
    return (
        np.zeros((nv, nv)), np.zeros(nv), np.zeros((columns, 6)), np.tile(np.eye(3), (count, 1, 1)),
        np.zeros((count, 3)), np.zeros((count, 6)), np.zeros((count, 6)), np.zeros((3, 3)),
        np.zeros((3, nv)), np.zeros(6), np.zeros(2),
    )  # fmt: skip


@njit(cache=True)
def evaluate(tree, q, v, terms):
    """Write the terms of a robot.

    Args:
        tree: what the robot is made of; row 0 is the world, parents come before their children.
            joint (N, 4) kind, parent, first degree of freedom of the tree and first coordinate,
            the same unless the joint follows that coordinate; place (N, 12) rotation and position
            in the parent joint's axes; axis (N, 3) unit vector in the joint's axes; body (N, 13)
            mass, centre of mass and inertia about it in the joint's axes; gear (N, 2) multiplier
            and offset of the coordinate; and the entries of a configuration less those of a
            velocity.
        q: (nq,) configuration.
        v: (nv,) velocity.
        terms: as `allocate` returns them, written.
    """
    joint, place, axis, body, gear, shift = tree
    M, nle, J, R, p, twist, rate, com, com_jacobian, momentum, energy = terms
    count = joint.shape[0]
    inertia, force, flow = np.zeros((count, _INERTIA)), np.zeros((count, 6)), np.zeros((count, 6))
    turn, work, u = np.empty((3, 3)), np.empty((3, 3)), np.empty(6)
    rate[0, 2] = GRAVITY
    J[:] = 0.0
    for j in range(1, count):
        kind, parent, first, at = joint[j, 0], joint[j, 1], joint[j, 2], joint[j, 3]
        position = gear[j, 0] * q[at + shift] + gear[j, 1]
        _turn(kind, axis, q, j, position, turn)
        _place(kind, parent, place, axis, q, j, position, turn, work, R, p)
        _columns(kind, first, axis, gear[j, 0], R, p, j, J)
        _move(parent, first, at, 6 if kind == FREE else 1, J, v, j, u, twist, rate)
        _weigh(body, R, p, j, work, inertia)
        _times(inertia, twist, j, j, flow)
        _times(inertia, rate, j, j, force)
        _add_cross(twist, 3, flow[j], 0, j, force, 0)
        _add_cross(twist, 3, flow[j], 3, j, force, 3)
        _add_cross(twist, 0, flow[j], 0, j, force, 3)
    _gather(joint, inertia, force, flow, J, M, nle, com_jacobian)
    _whole(inertia, force, flow, p, com, com_jacobian, momentum)
    energy[0], energy[1] = 0.0, inertia[0, 0] * GRAVITY * com[0, 2]
    for i in range(v.size):
        for k in range(v.size):
            energy[0] += 0.5 * v[i] * M[i, k] * v[k]


@njit(cache=True)
def _turn(kind, axis, q, j, position, turn):
    """Write the rotation (3, 3) of joint j, whose position is an angle, or the base's q[3:7]."""
    if kind == FREE:
        x, y, z, w = q[3], q[4], q[5], q[6]
    else:
        angle = position if kind == REVOLUTE else 0.0
        s = math.sin(0.5 * angle)
        x, y, z, w = s * axis[j, 0], s * axis[j, 1], s * axis[j, 2], math.cos(0.5 * angle)
    turn[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    turn[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    turn[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    turn[0, 1], turn[1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    turn[0, 2], turn[2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    turn[1, 2], turn[2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)


@njit(cache=True)
def _place(kind, parent, place, axis, q, j, position, turn, fixed, R, p):
    """Write rotation and position of joint j."""
    for a in range(3):
        p[j, a] = p[parent, a]
        for b in range(3):
            p[j, a] += R[parent, a, b] * place[j, 9 + b]
            fixed[a, b] = 0.0
            for c in range(3):
                fixed[a, b] += R[parent, a, c] * place[j, 3 * c + b]
    for a in range(3):
        for b in range(3):
            R[j, a, b] = 0.0
            if kind == FREE:
                p[j, a] += fixed[a, b] * q[b]
            elif kind == PRISMATIC:
                p[j, a] += fixed[a, b] * axis[j, b] * position
            for c in range(3):
                R[j, a, b] += fixed[a, c] * turn[c, b]


@njit(cache=True)
def _columns(kind, first, axis, ratio, R, p, j, J):
    """Write the columns of joint j's Jacobian, ratio times those of its own rate."""
    x, y, z = p[j, 0] - p[1, 0], p[j, 1] - p[1, 1], p[j, 2] - p[1, 2]
    for k in range(3 if kind == FREE else 1):
        c = first + 3 + k if kind == FREE else first
        for a in range(3):
            if kind == FREE:
                along = R[j, a, k]
                J[first + k, a] = along
            else:
                along = R[j, a, 0] * axis[j, 0] + R[j, a, 1] * axis[j, 1] + R[j, a, 2] * axis[j, 2]
            J[c, a if kind == PRISMATIC else 3 + a] = ratio * along
        if kind != PRISMATIC:
            J[c, 0] = y * J[c, 5] - z * J[c, 4]
            J[c, 1] = z * J[c, 3] - x * J[c, 5]
            J[c, 2] = x * J[c, 4] - y * J[c, 3]


@njit(cache=True)
def _add_cross(A, at, b, of, j, out, to):
    """Add to row j of out the cross product of parts of row j of A and of b, each from a place."""
    x, y, z = A[j, at], A[j, at + 1], A[j, at + 2]
    out[j, to] += y * b[of + 2] - z * b[of + 1]
    out[j, to + 1] += z * b[of] - x * b[of + 2]
    out[j, to + 2] += x * b[of + 1] - y * b[of]


@njit(cache=True)
def _move(parent, first, at, size, J, v, j, own, twist, rate):
    """Write velocity and acceleration at zero v̇ of joint j."""
    for k in range(6):
        own[k] = 0.0
        for c in range(size):
            own[k] += J[first + c, k] * v[at + c]
        twist[j, k] = twist[parent, k] + own[k]
        rate[j, k] = rate[parent, k]
    _add_cross(twist, 3, own, 0, j, rate, 0)
    _add_cross(twist, 0, own, 3, j, rate, 0)
    _add_cross(twist, 3, own, 3, j, rate, 3)


@njit(cache=True)
def _weigh(body, R, p, j, turned, out):
    """Write the inertia (10,) about the point of body j."""
    mass = body[j, 0]
    for a in range(3):
        c = p[j, a] - p[1, a]
        for b in range(3):
            c += R[j, a, b] * body[j, 1 + b]
            turned[a, b] = 0.0
            for k in range(3):
                turned[a, b] += R[j, a, k] * body[j, 4 + 3 * k + b]
        out[j, 1 + a] = c
    x, y, z = out[j, 1], out[j, 2], out[j, 3]
    k = 4
    for a in range(3):
        for b in range(a, 3):
            out[j, k] = -mass * out[j, 1 + a] * out[j, 1 + b]
            for c in range(3):
                out[j, k] += turned[a, c] * R[j, b, c]
            if a == b:
                out[j, k] += mass * (x * x + y * y + z * z)
            k += 1
    out[j, 0], out[j, 1], out[j, 2], out[j, 3] = mass, mass * x, mass * y, mass * z


@njit(cache=True)
def _times(I, u, j, c, out):
    """Write in row j the momentum of inertia j that moves with row c of u."""
    x, y, z, a, b, g = u[c, 0], u[c, 1], u[c, 2], u[c, 3], u[c, 4], u[c, 5]
    out[j, 0] = I[j, 0] * x + b * I[j, 3] - g * I[j, 2]
    out[j, 1] = I[j, 0] * y + g * I[j, 1] - a * I[j, 3]
    out[j, 2] = I[j, 0] * z + a * I[j, 2] - b * I[j, 1]
    out[j, 3] = I[j, 4] * a + I[j, 5] * b + I[j, 6] * g + I[j, 2] * z - I[j, 3] * y
    out[j, 4] = I[j, 5] * a + I[j, 7] * b + I[j, 8] * g + I[j, 3] * x - I[j, 1] * z
    out[j, 5] = I[j, 6] * a + I[j, 8] * b + I[j, 9] * g + I[j, 1] * y - I[j, 2] * x


@njit(cache=True)
def _gather(joint, inertia, force, flow, J, M, nle, com_jacobian):
    """Write M, nle and the centre of mass's Jacobian times the mass, from the leaves inwards."""
    push = np.empty((joint.shape[0], 6))
    M[:], nle[:], com_jacobian[:] = 0.0, 0.0, 0.0
    for j in range(joint.shape[0] - 1, 0, -1):
        kind, parent, first, shift = joint[j, 0], joint[j, 1], joint[j, 2], joint[j, 3]
        shift -= first
        for c in range(first, first + 6 if kind == FREE else first + 1):
            _times(inertia, J, j, c, push)
            for a in range(3):
                com_jacobian[a, c + shift] += push[j, a]
            for k in range(6):
                nle[c + shift] += J[c, k] * force[j, k]
            i, start, end = j, first, c + 1
            while i > 0:
                for d in range(start, end):
                    s = 0.0
                    for k in range(6):
                        s += J[d, k] * push[j, k]
                    of = d + joint[i, 3] - joint[i, 2]
                    M[c + shift, of] += s
                    if d != c:
                        M[of, c + shift] += s
                i = joint[i, 1]
                start = joint[i, 2]
                end = start + 6 if joint[i, 0] == FREE else start + 1
        for k in range(_INERTIA):
            inertia[parent, k] += inertia[j, k]
        for k in range(6):
            force[parent, k] += force[j, k]
            flow[parent, k] += flow[j, k]


@njit(cache=True)
def _whole(inertia, force, flow, p, com, com_jacobian, momentum):
    """Write what is said of the whole robot, from inertia, force and momentum of the world."""
    mass = inertia[0, 0]
    com_jacobian[:] /= mass
    momentum[:] = flow[0]
    x, y, z = inertia[0, 1] / mass, inertia[0, 2] / mass, inertia[0, 3] / mass
    com[0, 0], com[0, 1], com[0, 2] = p[1, 0] + x, p[1, 1] + y, p[1, 2] + z
    momentum[3] -= y * momentum[2] - z * momentum[1]
    momentum[4] -= z * momentum[0] - x * momentum[2]
    momentum[5] -= x * momentum[1] - y * momentum[0]
    for a in range(3):
        com[1, a], com[2, a] = momentum[a] / mass, force[0, a] / mass
    com[2, 2] -= GRAVITY


@njit(cache=True)
def frames(terms, mounts, J, R, p, bias):
    """Write Jacobian, rotation, position and J̇ v of F frames, world-aligned, linear rows first.

    Args:
        terms: of the robot.
        mounts: as `sealag.robot.Robot.frame_mounts`.
        J: (F, 6, nv), written.
        R: (F, 3, 3), written.
        p: (F, 3) m, written.
        bias: (F, 6) acceleration at zero v̇, written.
    """
    columns, turned, place, twist, rate = terms[2], terms[3], terms[4], terms[5], terms[6]
    joint, rotation, position, support = mounts
    u = np.empty(3)
    for f in range(joint.size):
        j = joint[f]
        for a in range(3):
            p[f, a] = place[j, a]
            for b in range(3):
                p[f, a] += turned[j, a, b] * position[f, b]
                R[f, a, b] = 0.0
                for c in range(3):
                    R[f, a, b] += turned[j, a, c] * rotation[f, c, b]
        r, s, t = p[f, 0] - place[1, 0], p[f, 1] - place[1, 1], p[f, 2] - place[1, 2]
        bias[f] = rate[j]
        x, y, z = rate[j, 3], rate[j, 4], rate[j, 5]
        bias[f, 0] += y * t - z * s
        bias[f, 1] += z * r - x * t
        bias[f, 2] += x * s - y * r - GRAVITY
        x, y, z = twist[j, 3], twist[j, 4], twist[j, 5]
        u[0] = twist[j, 0] + y * t - z * s
        u[1] = twist[j, 1] + z * r - x * t
        u[2] = twist[j, 2] + x * s - y * r
        bias[f, 0] += y * u[2] - z * u[1]
        bias[f, 1] += z * u[0] - x * u[2]
        bias[f, 2] += x * u[1] - y * u[0]
        J[f] = 0.0
        for k in range(columns.shape[0]):
            if support[f, k] == 0:
                continue
            c = support[f, k] - 1
            x, y, z = columns[k, 3], columns[k, 4], columns[k, 5]
            J[f, 0, c] += columns[k, 0] + y * t - z * s
            J[f, 1, c] += columns[k, 1] + z * r - x * t
            J[f, 2, c] += columns[k, 2] + x * s - y * r
            J[f, 3, c] += x
            J[f, 4, c] += y
            J[f, 5, c] += z


@njit(cache=True)
def gravity_gradient(tree, terms, H):
    """Write how the gravity torque changes with the configuration, ∂²V/∂q².

    Moving joint d turns everything behind it, as if gravity turned the other way: for c behind d,
    H_cd = m g (ω_d × e_z) · (-v), ω_d the rate of joint d and m v the momentum of what moves behind
    c at its rate. Among the base's own directions H is the symmetric part of that.

    Args:
        tree: as in `evaluate`.
        terms: as `evaluate` wrote them.
        H: (nv, nv) Nm/rad, written.
    """
    joint, body = tree[0], tree[3]
    J, R, p = terms[2], terms[3], terms[4]
    weight, moment = np.zeros(joint.shape[0]), np.zeros((joint.shape[0], 3))
    H[:] = 0.0
    for j in range(joint.shape[0] - 1, 0, -1):
        kind, parent, first, shift = joint[j, 0], joint[j, 1], joint[j, 2], joint[j, 3]
        shift -= first
        weight[j] += GRAVITY * body[j, 0]
        for a in range(3):
            c = p[j, a] - p[1, a]
            for b in range(3):
                c += R[j, a, b] * body[j, 1 + b]
            moment[j, a] += GRAVITY * body[j, 0] * c
        size = 6 if kind == FREE else 1
        for c in range(first, first + size):
            x = weight[j] * J[c, 0] + J[c, 4] * moment[j, 2] - J[c, 5] * moment[j, 1]
            y = weight[j] * J[c, 1] + J[c, 5] * moment[j, 0] - J[c, 3] * moment[j, 2]
            i = j
            while i > 0:
                start, part = joint[i, 2], 0.5 if i == j else 1.0
                for d in range(start, start + 6 if joint[i, 0] == FREE else start + 1):
                    of = d + joint[i, 3] - start
                    value = part * (J[d, 3] * y - J[d, 4] * x)
                    H[c + shift, of] += value
                    H[of, c + shift] += value
                i = joint[i, 1]
        weight[parent] += weight[j]
        for a in range(3):
            moment[parent, a] += moment[j, a]


def example(nv):
    """Return a tree of a free body and nv - 6 joints, and its terms, to compile kernels with."""
    count = 2 + nv - 6
    joint, body = np.zeros((count, 4), np.int64), np.zeros((count, 13))
    joint[1, 0], joint[2:, 1], joint[2:, 2:] = FREE, 1, 6 + np.arange(nv - 6)[:, None]
    place, axis, gear = np.zeros((count, 12)), np.zeros((count, 3)), np.tile([1.0, 0.0], (count, 1))
    place[:, [0, 4, 8]], axis[:, 2], body[:, [0, 4, 8, 12]] = 1.0, 1.0, 1.0
    return (joint, place, axis, body, gear, 1), allocate(joint)


def warm() -> None:
    """Compile every kernel of this module."""
    tree, terms = example(7)
    q, v = np.zeros(8), np.zeros(7)
    q[6] = 1.0
    evaluate(tree, q, v, terms)
    gravity_gradient(tree, terms, np.zeros((7, 7)))
    mounts = (np.ones(1, np.int64), np.eye(3)[None], np.zeros((1, 3)), np.ones((1, 7), np.int64))
    J, R, p, bias = np.zeros((1, 6, 7)), np.zeros((1, 3, 3)), np.zeros((1, 3)), np.zeros((1, 6))
    frames(terms, mounts, J, R, p, bias)
