"""Terms of a tree of rigid bodies at one configuration and velocity.

A joint may follow another one's coordinate: its rate is then a constant multiple of that one's.
Everything is in world axes about one point that is at rest in the world and where the first joint
is now, so that no body needs axes of its own and no precision is lost far from the world's origin.
Spatial vectors are linear first. Configurations and velocities are laid out as in ``spatial``.
"""

import math
from typing import NamedTuple

import numpy as np

from sealag.constants import GRAVITY
from sealag.kernels._jit import entry, inner
from sealag.kernels.spatial import (
    add,
    angular,
    compose,
    cross,
    dot,
    linear,
    put_rotation,
    put_twist,
    put_vector,
    rotate,
    rotation,
    rotation_of,
    scale,
    subtract,
    transpose,
    vector,
)
from sealag.typing import Array, IntArray

REVOLUTE, PRISMATIC, FREE = 0, 1, 2
KINETIC, POTENTIAL = 0, 1  # places in Terms.energy


class Tree(NamedTuple):
    """What a robot is made of: N joints, each with the body behind it.

    Row 0 is the world; parents come before their children. The tree has D degrees of freedom,
    followers' included; the robot has nv.
    """

    kind: IntArray  # (N,) REVOLUTE, PRISMATIC or FREE
    parent: IntArray  # (N,) joint
    column: IntArray  # (N,) its first degree of freedom of the tree
    coordinate: IntArray  # (N,) its first velocity; another than column if the joint follows
    rotation: Array  # (N, 3, 3) in the parent joint's axes
    position: Array  # (N, 3) m, in the parent joint's axes
    axis: Array  # (N, 3) unit vector in the joint's axes
    mass: Array  # (N,) kg, of the body
    lever: Array  # (N, 3) m, its centre of mass in the joint's axes
    inertia: Array  # (N, 3, 3) kg m², about the centre of mass, in the joint's axes
    ratio: Array  # (N,) its rate per rate of its coordinate
    offset: Array  # (N,) its position where its coordinate is 0
    extra: int  # entries of a configuration less those of a velocity


class Bodies(NamedTuple):
    """What is summed from the leaves inwards, about the common point; row 0 is the whole robot."""

    mass: Array  # (N,) kg
    moment: Array  # (N, 3) mass times place, kg m
    inertia: Array  # (N, 3, 3) kg m²
    force: Array  # (N, 6) that moves it at zero v̇ against gravity
    momentum: Array  # (N, 6)


class Terms(NamedTuple):
    """Rigid-body terms at one configuration and velocity, world axes."""

    M: Array  # (nv, nv) mass matrix
    nle: Array  # (nv,) Coriolis, centrifugal and gravity torques
    columns: Array  # (D, 6) twist per rate of each degree of freedom of the tree
    rotation: Array  # (N, 3, 3) of the joints
    position: Array  # (N, 3) m, of the joints
    twist: Array  # (N, 6) velocities of the joints
    drift: Array  # (N, 6) their accelerations at zero v̇, less gravity's
    com: Array  # (3,) centre of mass, m
    com_velocity: Array  # (3,) m/s
    com_drift: Array  # (3,) its acceleration at zero v̇, m/s²
    com_jacobian: Array  # (3, nv)
    momentum: Array  # (6,) linear, then angular about the centre of mass
    energy: Array  # (2,) KINETIC, POTENTIAL, J
    bodies: Bodies  # each with all that moves behind its joint


class Mounts(NamedTuple):
    """How F frames are fixed to their joints."""

    joint: IntArray  # (F,)
    rotation: Array  # (F, 3, 3) in the joint's axes
    position: Array  # (F, 3) m, in the joint's axes
    support: IntArray  # (F, D) coordinate that moves it through each degree, plus 1; 0 for none


class Frames(NamedTuple):
    """World-aligned terms of F frames, linear rows first."""

    J: Array  # (F, 6, nv) Jacobians
    R: Array  # (F, 3, 3) rotations
    p: Array  # (F, 3) positions, m
    drift: Array  # (F, 6) classical accelerations at zero v̇, J̇ v


class Model(NamedTuple):
    """A robot and its terms."""

    tree: Tree
    terms: Terms


class Placed(NamedTuple):
    """Frames of a robot and their terms."""

    terms: Terms
    mounts: Mounts
    frames: Frames


def allocate(tree: Tree) -> Terms:
    """Return zeroed terms of a robot."""
    count, columns = len(tree.kind), sum(6 if kind == FREE else 1 for kind in tree.kind[1:])
    nv = columns - int((tree.column != tree.coordinate).sum())
    bodies = Bodies(
        mass=np.zeros(count), moment=np.zeros((count, 3)), inertia=np.zeros((count, 3, 3)),
        force=np.zeros((count, 6)), momentum=np.zeros((count, 6)),
    )  # fmt: skip
    return Terms(
        M=np.zeros((nv, nv)), nle=np.zeros(nv), columns=np.zeros((columns, 6)),
        rotation=np.tile(np.eye(3), (count, 1, 1)), position=np.zeros((count, 3)),
        twist=np.zeros((count, 6)), drift=np.zeros((count, 6)), com=np.zeros(3),
        com_velocity=np.zeros(3), com_drift=np.zeros(3), com_jacobian=np.zeros((3, nv)),
        momentum=np.zeros(6), energy=np.zeros(2), bodies=bodies,
    )  # fmt: skip


def allocate_frames(count: int, nv: int) -> Frames:
    """Return zeroed terms of frames."""
    return Frames(
        J=np.zeros((count, 6, nv)), R=np.zeros((count, 3, 3)), p=np.zeros((count, 3)),
        drift=np.zeros((count, 6)),
    )  # fmt: skip


@entry
def evaluate(model, q, v):
    """Write the terms of a kept `Model` at q (nq,), v (nv,)."""
    rigid_body_terms(model.parts.tree, q, v, model.parts.terms)


@inner
def rigid_body_terms(tree, q, v, terms):
    """Write the terms of a robot.

    Args:
        tree: the robot.
        q: (nq,) configuration.
        v: (nv,) velocity.
        terms: written.
    """
    count, bodies = tree.kind.size, terms.bodies
    bodies.mass[0], bodies.moment[0], bodies.inertia[0] = 0.0, 0.0, 0.0
    bodies.force[0], bodies.momentum[0] = 0.0, 0.0
    terms.drift[0, 2] = GRAVITY
    terms.columns[:] = 0.0
    for j in range(1, count):
        _place(tree, q, j, terms)
        _write_columns(tree, j, terms)
        _move(tree, v, j, terms)
        _weigh(tree, terms, j, bodies)
    _gather(tree, bodies, terms)
    _sum_up(bodies, v, terms)


@inner
def _place(tree, q, j, terms):
    """Write rotation and position of joint j."""
    kind, parent = tree.kind[j], tree.parent[j]
    R = rotation(terms.rotation, parent)
    p = add(vector(terms.position, parent), rotate(R, vector(tree.position, j)))
    R = compose(R, rotation(tree.rotation, j))
    if kind == FREE:
        p = add(p, rotate(R, (q[0], q[1], q[2])))
        R = compose(R, rotation_of(q[3], q[4], q[5], q[6]))
    else:
        turned = tree.ratio[j] * q[tree.coordinate[j] + tree.extra] + tree.offset[j]
        axis = vector(tree.axis, j)
        if kind == PRISMATIC:
            p = add(p, rotate(R, scale(turned, axis)))
        else:
            x, y, z = scale(math.sin(0.5 * turned), axis)
            R = compose(R, rotation_of(x, y, z, math.cos(0.5 * turned)))
    put_rotation(terms.rotation, j, R)
    put_vector(terms.position, j, p)


@inner
def _write_columns(tree, j, terms):
    """Write the columns of joint j's Jacobian, world axes, per rate of its coordinate."""
    kind, first, R = tree.kind[j], tree.column[j], rotation(terms.rotation, j)
    arm = subtract(vector(terms.position, j), vector(terms.position, 1))
    none = (0.0, 0.0, 0.0)
    if kind == FREE:
        x, y, z = transpose(R)
        put_twist(terms.columns, first, x, none)
        put_twist(terms.columns, first + 1, y, none)
        put_twist(terms.columns, first + 2, z, none)
        put_twist(terms.columns, first + 3, cross(arm, x), x)
        put_twist(terms.columns, first + 4, cross(arm, y), y)
        put_twist(terms.columns, first + 5, cross(arm, z), z)
        return
    along = scale(tree.ratio[j], rotate(R, vector(tree.axis, j)))
    if kind == PRISMATIC:
        put_twist(terms.columns, first, along, none)
    else:
        put_twist(terms.columns, first, cross(arm, along), along)


@inner
def _move(tree, v, j, terms):
    """Write velocity and acceleration at zero v̇ of joint j."""
    first, at, parent = tree.column[j], tree.coordinate[j], tree.parent[j]
    own, own_turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for c in range(6 if tree.kind[j] == FREE else 1):
        rate = v[at + c]
        own = add(own, scale(rate, linear(terms.columns, first + c)))
        own_turn = add(own_turn, scale(rate, angular(terms.columns, first + c)))
    move = add(linear(terms.twist, parent), own)
    turn = add(angular(terms.twist, parent), own_turn)
    bend = add(cross(turn, own), cross(move, own_turn))
    put_twist(terms.twist, j, move, turn)
    put_twist(
        terms.drift, j, add(linear(terms.drift, parent), bend),
        add(angular(terms.drift, parent), cross(turn, own_turn)),
    )  # fmt: skip


@inner
def _weigh(tree, terms, j, bodies):
    """Write body j's mass, moment, inertia, force and momentum about the common point."""
    mass, R = tree.mass[j], rotation(terms.rotation, j)
    arm = subtract(vector(terms.position, j), vector(terms.position, 1))
    c = add(arm, rotate(R, vector(tree.lever, j)))
    square = mass * dot(c, c)
    x, y, z = compose(compose(R, rotation(tree.inertia, j)), transpose(R))
    cx, cy, cz = c
    ex, ey, ez = (square, 0.0, 0.0), (0.0, square, 0.0), (0.0, 0.0, square)
    inertia = (
        add(add(x, ex), scale(-mass * cx, c)), add(add(y, ey), scale(-mass * cy, c)),
        add(add(z, ez), scale(-mass * cz, c)),
    )  # fmt: skip
    bodies.mass[j] = mass
    put_vector(bodies.moment, j, scale(mass, c))
    put_rotation(bodies.inertia, j, inertia)
    move, turn = linear(terms.twist, j), angular(terms.twist, j)
    push, spin = _momentum(bodies, j, move, turn)
    force, torque = _momentum(bodies, j, linear(terms.drift, j), angular(terms.drift, j))
    put_twist(bodies.momentum, j, push, spin)
    put_twist(
        bodies.force, j, add(force, cross(turn, push)),
        add(torque, add(cross(turn, spin), cross(move, push))),
    )  # fmt: skip


@inner
def _momentum(bodies, j, move, turn):
    """Return linear and angular momentum of what moves behind joint j with a twist."""
    moment = vector(bodies.moment, j)
    push = add(scale(bodies.mass[j], move), cross(turn, moment))
    return push, add(rotate(rotation(bodies.inertia, j), turn), cross(moment, move))


@inner
def _gather(tree, bodies, terms):
    """Write M, nle and the centre of mass's Jacobian times the mass, from the leaves inwards."""
    M, nle, columns, mass_jacobian = terms.M, terms.nle, terms.columns, terms.com_jacobian
    M[:], nle[:], mass_jacobian[:] = 0.0, 0.0, 0.0
    for j in range(tree.kind.size - 1, 0, -1):
        first, parent = tree.column[j], tree.parent[j]
        shift = tree.coordinate[j] - first
        force, torque = linear(bodies.force, j), angular(bodies.force, j)
        for c in range(first, first + 6 if tree.kind[j] == FREE else first + 1):
            move, turn = linear(columns, c), angular(columns, c)
            push, spin = _momentum(bodies, j, move, turn)
            px, py, pz = push
            mass_jacobian[0, c + shift] += px
            mass_jacobian[1, c + shift] += py
            mass_jacobian[2, c + shift] += pz
            nle[c + shift] += dot(move, force) + dot(turn, torque)
            i, start, end = j, first, c + 1
            while i > 0:
                for d in range(start, end):
                    s = dot(linear(columns, d), push) + dot(angular(columns, d), spin)
                    of = d + tree.coordinate[i] - tree.column[i]
                    M[c + shift, of] += s
                    if d != c:
                        M[of, c + shift] += s
                i = tree.parent[i]
                start = tree.column[i]
                end = start + 6 if tree.kind[i] == FREE else start + 1
        bodies.mass[parent] += bodies.mass[j]
        for a in range(3):
            bodies.moment[parent, a] += bodies.moment[j, a]
            for b in range(3):
                bodies.inertia[parent, a, b] += bodies.inertia[j, a, b]
        for k in range(6):
            bodies.force[parent, k] += bodies.force[j, k]
            bodies.momentum[parent, k] += bodies.momentum[j, k]


@inner
def _sum_up(bodies, v, terms):
    """Write centre of mass, its Jacobian, momentum and energy of the whole robot."""
    mass = bodies.mass[0]
    for a in range(3):
        for c in range(v.size):
            terms.com_jacobian[a, c] /= mass
    away = scale(1.0 / mass, vector(bodies.moment, 0))
    push, force = linear(bodies.momentum, 0), linear(bodies.force, 0)
    terms.com[0], terms.com[1], terms.com[2] = add(vector(terms.position, 1), away)
    spin = subtract(angular(bodies.momentum, 0), cross(away, push))
    terms.momentum[0], terms.momentum[1], terms.momentum[2] = push
    terms.momentum[3], terms.momentum[4], terms.momentum[5] = spin
    fx, fy, fz = scale(1.0 / mass, force)
    terms.com_velocity[0], terms.com_velocity[1], terms.com_velocity[2] = scale(1.0 / mass, push)
    terms.com_drift[0], terms.com_drift[1], terms.com_drift[2] = fx, fy, fz - GRAVITY
    terms.energy[KINETIC], terms.energy[POTENTIAL] = 0.0, mass * GRAVITY * terms.com[2]
    for i in range(v.size):
        row = 0.0
        for k in range(v.size):
            row += terms.M[i, k] * v[k]
        terms.energy[KINETIC] += 0.5 * v[i] * row


@entry
def frames(placed):
    """Write Jacobian, rotation, position and J̇ v of frames that are kept as `Placed`."""
    frame_terms(placed.parts.terms, placed.parts.mounts, placed.parts.frames)


@inner
def frame_terms(terms, mounts, frames):
    """Write Jacobian, rotation, position and J̇ v of frames.

    Args:
        terms: of the robot.
        mounts: how the frames are fixed.
        frames: written.
    """
    origin = vector(terms.position, 1)
    for f in range(mounts.joint.size):
        j = mounts.joint[f]
        R = rotation(terms.rotation, j)
        p = add(vector(terms.position, j), rotate(R, vector(mounts.position, f)))
        put_vector(frames.p, f, p)
        put_rotation(frames.R, f, compose(R, rotation(mounts.rotation, f)))
        arm, turn = subtract(p, origin), angular(terms.twist, j)
        bend, spin = linear(terms.drift, j), angular(terms.drift, j)
        speed = add(linear(terms.twist, j), cross(turn, arm))
        bend = add(add(bend, cross(spin, arm)), cross(turn, speed))
        put_twist(frames.drift, f, subtract(bend, (0.0, 0.0, GRAVITY)), spin)
        J = frames.J[f]
        J[:] = 0.0
        for k in range(terms.columns.shape[0]):
            if mounts.support[f, k] == 0:
                continue
            c = mounts.support[f, k] - 1
            wx, wy, wz = angular(terms.columns, k)
            x, y, z = add(linear(terms.columns, k), cross((wx, wy, wz), arm))
            J[0, c] += x
            J[1, c] += y
            J[2, c] += z
            J[3, c] += wx
            J[4, c] += wy
            J[5, c] += wz


@entry
def gravity_gradient(model, H):
    """Write ∂²V/∂q² (nv, nv) of a kept `Model`, see `gravity_hessian`."""
    gravity_hessian(model.parts.tree, model.parts.terms, H)


@inner
def gravity_hessian(tree, terms, H):
    """Write how the gravity torque changes with the configuration, ∂²V/∂q².

    Moving joint d turns everything behind it, as if gravity turned the other way: for c behind d,
    H_cd = m g (ω_d × e_z) · (-v), ω_d the rate of joint d and m v the momentum of what moves behind
    c at its rate. Among the base's own directions H is the symmetric part of that.

    Args:
        tree: the robot.
        terms: of it, evaluated.
        H: (nv, nv) Nm/rad, written.
    """
    columns, bodies = terms.columns, terms.bodies
    H[:] = 0.0
    for j in range(tree.kind.size - 1, 0, -1):
        first = tree.column[j]
        shift, moment = tree.coordinate[j] - first, vector(bodies.moment, j)
        for c in range(first, first + (6 if tree.kind[j] == FREE else 1)):
            push = scale(bodies.mass[j], linear(columns, c))
            x, y, _ = scale(GRAVITY, add(push, cross(angular(columns, c), moment)))
            i = j
            while i > 0:
                start, part = tree.column[i], 0.5 if i == j else 1.0
                for d in range(start, start + 6 if tree.kind[i] == FREE else start + 1):
                    of = d + tree.coordinate[i] - start
                    value = part * (columns[d, 3] * y - columns[d, 4] * x)
                    H[c + shift, of] += value
                    H[of, c + shift] += value
                i = tree.parent[i]
