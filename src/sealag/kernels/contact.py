"""Contact kernels: contact points, constrained forward dynamics, impacts and margins.

Every foot is one or several points. A point's contact frame C has rows tangent, tangent, normal.
"""

from typing import NamedTuple

import numpy as np

from sealag.kernels import friction
from sealag.kernels._jit import entry, inner, shared
from sealag.kernels.dynamics import (
    Frames,
    Mounts,
    Terms,
    Tree,
    allocate,
    allocate_frames,
    frame_terms,
    rigid_body_terms,
)
from sealag.kernels.friction import Equations, Surfaces
from sealag.kernels.ledger import DISTURBANCE, HOLDING, SLIDING, TORSION
from sealag.kernels.linalg import cholesky, copy, forward_solve
from sealag.kernels.motor import Motors
from sealag.kernels.spatial import add, cross, dot, rotate, rotation, scale, vector
from sealag.typing import Array, IntArray

RISEN = 2e-5
"""m: an opened point this high has left the ground. Ten times larger lets it fall again unnoticed;
ten times smaller meets what stabilisation leaves below the ground."""


class Contacts(NamedTuple):
    """What surrounds the robot: P contact points of F feet, then loaded points, T together."""

    frame: IntArray  # (T,) frame that carries each point
    offset: Array  # (T, 3) m, in the frame's axes
    C: Array  # (P, 3, 3) contact frames
    anchor: Array  # (P, 3) m, where each point closed
    friction: Array  # (P,) Coulomb coefficient
    ridge: Array  # (P,) relative compliance that shares force between redundant points
    radius: Array  # (P,) height of the frame over the ground when touching, m
    torsion_damping: Array  # (F,) Nms/rad
    torsion_radius: Array  # (F,) m
    load: Array  # (T - P, 3) forces on the loaded points, N
    closed: IntArray  # (P,) 1 if closed
    yielding: Array  # (P,) how much a sliding point yields, 0 if it sticks
    floor: Array  # (P,) how far below the ground an opened point may still be, m
    ground_x: Array  # (G,) places of the ground's profile, m; empty if it has none
    ground_z: Array  # (G,) its heights there, m
    stabilisation: float  # rate at which a contact returns to its anchor, 1/s
    stop_time: float  # s, in which friction may stop a point for it to stick
    weight: float  # of the robot, N


class Plant(NamedTuple):
    """Robot, springs and surroundings."""

    tree: Tree
    mounts: Mounts  # of the feet's and the loaded frames
    motors: Motors
    contacts: Contacts


class Instant(NamedTuple):
    """State, contact forces and powers at one instant."""

    q: Array  # (nq,) configuration
    v: Array  # (nv,) velocity
    theta: Array  # (n,) motor angles, rad
    theta_dot: Array  # (n,) rad/s
    tau_motor: Array  # (n,) motor torques, Nm
    tau_sea: Array  # (n,) spring torques, Nm
    acceleration: Array  # (nv,) v̇
    force: Array  # (P, 3) in the contact frames, N
    gap: Array  # (P,) height of each point over the ground, m; inf while it is loaded
    position: Array  # (T, 3) of the points, m
    velocity: Array  # (T, 3) m/s
    power: Array  # (4,) HOLDING, SLIDING, TORSION, DISTURBANCE, W
    energy: Array  # (2,) of the links, KINETIC and POTENTIAL, J


class Work(NamedTuple):
    """Memory for one evaluation."""

    terms: Terms
    frames: Frames
    J: Array  # (T, 3, nv) Jacobians of the points
    drift: Array  # (T, 3) their accelerations at zero v̇
    equations: Equations
    velocity: Array  # (nv,) scratch of an impact, or of an acceleration
    force: Array  # (P, 3) likewise
    yielding: Array  # (P,) likewise


@inner
def surfaces_of(contacts):
    """Return the friction of the contact points."""
    return Surfaces(
        contacts.frame, contacts.friction, contacts.ridge, contacts.torsion_damping,
        contacts.torsion_radius,
    )  # fmt: skip


def allocate_work(plant: Plant) -> Work:
    """Return memory for evaluations of a plant."""
    terms, contacts = allocate(plant.tree), plant.contacts
    nv, total, points = len(terms.nle), len(contacts.frame), len(contacts.closed)
    return Work(
        terms=terms, frames=allocate_frames(len(plant.mounts.joint), nv),
        J=np.zeros((total, 3, nv)), drift=np.zeros((total, 3)),
        equations=friction.allocate_equations(nv, points, len(contacts.torsion_radius)),
        velocity=np.zeros(nv), force=np.zeros((points, 3)), yielding=np.zeros(points),
    )  # fmt: skip


@inner
def _place_points(contacts, at, work):
    """Write Jacobian, position, velocity and acceleration at zero v̇ of every point."""
    nv = at.v.size
    for i in range(contacts.frame.size):
        f = contacts.frame[i]
        J, frame_J = work.J[i], work.frames.J[f]
        arm = rotate(rotation(work.frames.R, f), vector(contacts.offset, i))
        at.position[i, 0], at.position[i, 1], at.position[i, 2] = add(
            vector(work.frames.p, f), arm
        )  # fmt: skip
        speed, spin = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for c in range(nv):
            turn = (frame_J[3, c], frame_J[4, c], frame_J[5, c])
            column = add((frame_J[0, c], frame_J[1, c], frame_J[2, c]), cross(turn, arm))
            J[0, c], J[1, c], J[2, c] = column
            speed, spin = add(speed, scale(at.v[c], column)), add(spin, scale(at.v[c], turn))
        at.velocity[i, 0], at.velocity[i, 1], at.velocity[i, 2] = speed
        drift = work.frames.drift
        bend = cross((drift[f, 3], drift[f, 4], drift[f, 5]), arm)
        work.drift[i, 0], work.drift[i, 1], work.drift[i, 2] = add(
            add(vector(drift, f), bend), cross(spin, cross(spin, arm))
        )  # fmt: skip


@inner
def _apply(plant, at, work):
    """Write spring torques, L⁻¹ times all forces but the contacts', and the loads' power."""
    motors, contacts, free = plant.motors, plant.contacts, work.equations.free
    nv, n, count = at.v.size, at.theta.size, contacts.closed.size
    for i in range(nv):
        free[i] = -work.terms.nle[i]
    for i in range(n):
        speed = at.v[nv - n + i]
        at.tau_sea[i] = motors.stiffness[i] * (at.theta[i] - at.q[at.q.size - n + i])
        at.tau_sea[i] += motors.spring_damping[i] * (at.theta_dot[i] - speed)
        free[nv - n + i] += at.tau_sea[i] - motors.bearing[i] * speed
    at.power[DISTURBANCE] = 0.0
    for k in range(contacts.load.shape[0]):
        for a in range(3):
            force = contacts.load[k, a]
            if force != 0.0:
                at.power[DISTURBANCE] += force * at.velocity[count + k, a]
                for c in range(nv):
                    free[c] += work.J[count + k, a, c] * force
    forward_solve(work.equations.L, free)


@inner
def _demand(contacts, at, work):
    """Write the part of every point's contact equation that is not J v̇ (P, 3).

    Tangent rows: J̇v + v_t / stop_time. Normal row: J̇v + 2 rate v_n + rate² (p - anchor)_n.
    """
    rate = contacts.stabilisation
    for i in range(contacts.closed.size):
        first, second, normal = rotation(contacts.C, i)
        drift, speed = vector(work.drift, i), vector(at.velocity, i)
        sliding = add(drift, scale(1.0 / contacts.stop_time, speed))
        sunk = add(vector(at.position, i), scale(-1.0, vector(contacts.anchor, i)))
        back = add(scale(2.0 * rate, speed), scale(rate * rate, sunk))
        target = work.equations.target
        target[i, 0], target[i, 1] = dot(first, sliding), dot(second, sliding)
        target[i, 2] = dot(normal, add(drift, back))


@inner
def project(L, J, C, wanted, rows):
    """Write L⁻¹ (C J)ᵀ of every wanted (P,) point, as rows (P, 3, nv)."""
    nv = L.shape[0]
    for i in range(C.shape[0]):
        if wanted[i] == 0:
            continue
        for a in range(3):
            for c in range(nv):
                rows[i, a, c] = (
                    C[i, a, 0] * J[i, 0, c] + C[i, a, 1] * J[i, 1, c] + C[i, a, 2] * J[i, 2, c]
                )
            forward_solve(L, rows[i, a])


@inner
def _twist(contacts, v, work):
    """Write L⁻¹ Jᵀ of the turn about the normal of feet with torsional damping, and its rate."""
    eq = work.equations
    eq.spin[:] = 0.0
    last = -1
    for i in range(contacts.closed.size):
        f = contacts.frame[i]
        if f == last or contacts.torsion_damping[f] == 0.0:
            continue
        last = f
        for c in range(v.size):
            s = 0.0
            for a in range(3):
                s += contacts.C[i, 2, a] * work.frames.J[f, 3 + a, c]
            eq.twist_rows[f, c] = s
            eq.spin[f] += s * v[c]
        forward_solve(eq.L, eq.twist_rows[f])


@inner
def _write_powers(contacts, at, work):
    """Write the powers of the contacts' forces and the energy of the links."""
    power, eq = at.power, work.equations
    power[HOLDING] = power[SLIDING] = power[TORSION] = 0.0
    for i in range(contacts.closed.size):
        if contacts.closed[i]:
            first, second, normal = rotation(contacts.C, i)
            speed, (along, across, load) = vector(at.velocity, i), vector(at.force, i)
            power[HOLDING] += load * dot(normal, speed)
            power[SLIDING] += along * dot(first, speed) + across * dot(second, speed)
    for f in range(eq.spin.size):
        power[TORSION] += eq.torque[f] * eq.spin[f]
    copy(work.terms.energy, at.energy)


@inner
def _prepare(plant, at, work):
    """Write what the contact forces of an instant follow from; False if M is singular."""
    rigid_body_terms(plant.tree, at.q, at.v, work.terms)
    frame_terms(work.terms, plant.mounts, work.frames)
    _place_points(plant.contacts, at, work)
    if not cholesky(work.terms.M, work.equations.L):
        return False
    _apply(plant, at, work)
    _demand(plant.contacts, at, work)
    _twist(plant.contacts, at.v, work)
    return True


@shared
def accelerate(plant, at, work):
    """Write spring torques, contact forces and acceleration at an instant, from its state.

    Returns:
        False if there is no solution.
    """
    if not _prepare(plant, at, work):
        return False
    contacts, eq = plant.contacts, work.equations
    project(eq.L, work.J, contacts.C, contacts.closed, eq.rows)
    solved = friction.solve(
        eq, surfaces_of(contacts), contacts.closed, contacts.yielding, at.acceleration, at.force
    )
    _write_powers(contacts, at, work)
    return solved


@inner
def resolve(plant, now, work, touching, impact, impulse):
    """Find which touching points stay closed, by an impact or under the forces of an instant.

    Args:
        plant: the plant; closed and yielding of its contacts are changed.
        now: the instant; an impact changes its velocity.
        work: scratch.
        touching: (P,) which points may be closed.
        impact: whether the points' velocities end in a plastic impact, else forces are sought.
        impulse: (P, 3) of the impact, Ns, written.

    Returns:
        As `friction.settle`, and the energy that an impact takes, J.
    """
    contacts, eq = plant.contacts, work.equations
    surfaces, tolerance = surfaces_of(contacts), 1e-9 * contacts.weight
    if not _prepare(plant, now, work):
        return friction.UNSOLVABLE, 0.0
    project(eq.L, work.J, contacts.C, touching, eq.rows)
    x, yielding, force = work.velocity, contacts.yielding, work.force
    copy(now.force, force)
    if impact:
        eq.target[:], eq.spin[:], force[:] = 0.0, 0.0, 0.0
        yielding = work.yielding
        yielding[:] = 0.0
        for c in range(now.v.size):
            eq.free[c] = 0.0
            for k in range(c, now.v.size):
                eq.free[c] += eq.L[k, c] * now.v[k]
    status = friction.settle(eq, surfaces, touching, contacts.closed, yielding, tolerance, x, force)
    if not impact:
        return status, 0.0
    copy(force, impulse)
    lost = 0.0
    for i in range(touching.size):
        mean = (0.0, 0.0, 0.0)
        for c in range(now.v.size):
            half, J = 0.5 * (now.v[c] + x[c]), work.J[i]
            mean = add(mean, scale(half, (J[0, c], J[1, c], J[2, c])))
        lost -= dot(rotate(rotation(contacts.C, i), mean), vector(force, i))
    copy(x, now.v)
    return status, lost


@inner
def ground_height(contacts, x):
    """Return the height of the ground's profile at x, m: linear between places, level beyond."""
    places, heights = contacts.ground_x, contacts.ground_z
    k = np.searchsorted(places, x, side="right")
    if k == 0:
        return heights[0]
    if k == places.size:
        return heights[k - 1]
    slope = (heights[k] - heights[k - 1]) / (places[k] - places[k - 1])
    return heights[k - 1] + slope * (x - places[k - 1])


@inner
def measure_gaps(contacts, at):
    """Write the gaps of all points over the ground's profile."""
    for i in range(contacts.closed.size):
        if contacts.closed[i]:
            at.gap[i] = np.inf
            continue
        x, _, z = vector(at.position, i)
        height = z - contacts.radius[i] - ground_height(contacts, x)
        if height > RISEN:
            contacts.floor[i] = 0.0
        at.gap[i] = height - contacts.floor[i]


@entry
def smallest_margin(C, closed, weight, force, gap, velocity):
    """Return the smallest margin and its point: how far it is from ending its condition.

    Open: the gap (m), inf if it widens. Closed: the normal force in body weights.

    Args:
        C: (P, 3, 3) contact frames.
        closed: (P,) whether each point is closed.
        weight: of the robot, N.
        force: (P, 3) in the contact frames, N.
        gap: (P,) m.
        velocity: (T, 3) m/s.
    """
    smallest, point = np.inf, -1
    for i in range(closed.size):
        if closed[i]:
            margin = force[i, 2] / weight
        else:
            _, _, normal = rotation(C, i)
            margin = gap[i] if dot(normal, vector(velocity, i)) < 0.0 else np.inf
        if point < 0 or not margin >= smallest:
            smallest, point = margin, i
    return smallest, point


@inner
def write_measurement(at, contacts, t, row):
    """Write what the sensors measure at an instant.

    Args:
        at: the instant, evaluated.
        contacts: which points are closed, and their feet.
        t: the time that the measurement says, s.
        row: of a `sealag.whole_body.Measurement`: time, q, v, theta, theta_dot, tau_sea and one
            flag for each foot; written.
    """
    row[0], place = t, 1
    for part in (at.q, at.v, at.theta, at.theta_dot, at.tau_sea):
        copy(part, row[place : place + part.size])
        place += part.size
    row[place:] = 0.0
    for i in range(contacts.closed.size):
        if contacts.closed[i]:
            row[place + contacts.frame[i]] = 1.0
