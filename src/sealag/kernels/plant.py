"""Plant kernels: steps of links, motors and contacts.

Link side: fourth-order Runge-Kutta in exponential coordinates about the step's start. Motor side:
exact along the link's cubic.
"""

from typing import NamedTuple

import numpy as np

from sealag.kernels import motor, motor_step, spatial
from sealag.kernels._jit import entry, inner
from sealag.kernels.contact import (
    Instant,
    Plant,
    Work,
    accelerate,
    allocate_work,
    resolve,
    write_measurement,
)
from sealag.kernels.dynamics import KINETIC, POTENTIAL
from sealag.kernels.friction import SETTLED, UNSOLVABLE
from sealag.kernels.ledger import (
    GRAVITY_STORE,
    IMPACT,
    JOINT_FLOWS,
    KINETIC_STORE,
    MOTOR_STORE,
    SCALAR_FLOWS,
    SPRING_STORE,
    STORES,
    Ledger,
)
from sealag.kernels.linalg import copy
from sealag.kernels.motor import Rotor, Series
from sealag.kernels.motor_step import Held
from sealag.typing import Array

MARGIN = 1e-9
"""m and body weights: a contact this close to changing is at its change. Ten times larger shows in
the energy that an impact takes; ten times smaller asks more of the bisection than a step has."""
SAME = 1e-9  # of a step: instants this close are one
EVALUATE, SETTLE, STRIKE, STORE, STEP, GLIDE = range(6)
"""What can be done with a plant: `act` does the first four, `run.move` the last two."""


class Memory(NamedTuple):
    """Memory for one step."""

    rates: Array  # (4, nv) of the coordinates about the step's start, at the stages
    accelerations: Array  # (4, nv)
    powers: Array  # (4, 4)
    displacement: Array  # (nv,)
    angle: Array  # (2, n) motor angles at the stages in the middle and at the end
    speed: Array  # (2, n)
    gained: Ledger  # works of the step; its stores are scratch
    series: Series
    seen: Array  # (2, n) motor angles and speeds where sensors look
    yielding: Array  # (P,) at the step's beginning


class Physics(NamedTuple):
    """A plant, its state and its books, and memory to move it."""

    plant: Plant
    work: Work
    now: Instant
    following: Instant  # the end of a step that is tried
    between: Instant  # what is measured inside it; only what sensors measure is written
    held: Held  # what the drives hold now
    ledger: Ledger
    memory: Memory


def allocate_ledger(n: int) -> Ledger:
    """Return empty books of n joints."""
    return Ledger(
        joint=np.zeros((len(JOINT_FLOWS), n)), scalar=np.zeros(len(SCALAR_FLOWS)),
        stores=np.zeros(len(STORES)), moved=np.zeros(1),
    )  # fmt: skip


def allocate_instant(nq: int, nv: int, n: int, *, points: int, total: int) -> Instant:
    """Return an instant at zero, of P contact points and T points in all."""
    return Instant(
        q=np.zeros(nq), v=np.zeros(nv), theta=np.zeros(n), theta_dot=np.zeros(n),
        tau_motor=np.zeros(n), tau_sea=np.zeros(n), acceleration=np.zeros(nv),
        force=np.zeros((points, 3)), gap=np.full(points, np.inf), position=np.zeros((total, 3)),
        velocity=np.zeros((total, 3)), power=np.zeros(4), energy=np.zeros(2),
    )  # fmt: skip


def allocate_physics(plant: Plant, *, instant: bool) -> Physics:
    """Return a plant at zero with memory to move it.

    Args:
        plant: the plant.
        instant: whether torque feedback is not delayed.
    """
    work, n, points = allocate_work(plant), len(plant.motors.stiffness), len(plant.contacts.closed)
    nv, total = len(work.terms.nle), len(plant.contacts.frame)
    now, following, between = (
        allocate_instant(nv + plant.tree.extra, nv, n, points=points, total=total) for _ in range(3)
    )
    memory = Memory(
        rates=np.zeros((4, nv)), accelerations=np.zeros((4, nv)), powers=np.zeros((4, 4)),
        displacement=np.zeros(nv), angle=np.zeros((2, n)), speed=np.zeros((2, n)),
        gained=allocate_ledger(n), series=motor.allocate_series(),
        seen=np.zeros((2, n)), yielding=np.zeros(points),
    )  # fmt: skip
    return Physics(
        plant=plant, work=work, now=now, following=following, between=between,
        held=Held(
            command=np.zeros(n), later=np.zeros(n), change=np.full(1, np.inf),
            look=np.full(1, np.inf), known_torque=np.zeros(n), instant=instant,
        ),
        ledger=allocate_ledger(n), memory=memory,
    )  # fmt: skip


@inner
def _predict_motors(plant, now, held, step, memory):
    """Write motor angles and speeds at the stages of a step, the links accelerating evenly."""
    n, motors = now.theta.size, plant.motors
    first_q, first_v = now.q.size - n, now.v.size - n
    for j in range(n):
        link = motor.Link(
            now.q[first_q + j], now.v[first_v + j], now.acceleration[first_v + j], 0.0
        )
        rotor = Rotor(now.theta[j], now.theta_dot[j], now.tau_motor[j])
        half, whole = motor_step.predict(motors, j, held, rotor, link, step, memory.series)
        memory.angle[0, j], memory.speed[0, j] = half.angle, half.speed
        memory.angle[1, j], memory.speed[1, j] = whole.angle, whole.speed


@inner
def _close(plant, now, held, step, memory, following):
    """Move the links to the step's end, and the motors along the links' cubic."""
    n = now.theta.size
    first_q, first_v = now.q.size - n, now.v.size - n
    spatial.combine(
        now.q, now.v, memory.rates, memory.accelerations, step, first_v, memory.displacement,
        following.q, following.v,
    )  # fmt: skip
    for j in range(n):
        q, v = first_q + j, first_v + j
        link = motor.link_through(now.q[q], now.v[v], following.q[q], following.v[v], step)
        rotor = Rotor(now.theta[j], now.theta_dot[j], now.tau_motor[j])
        rotor = motor_step.move(
            plant.motors,
            j,
            held,
            rotor,
            link,
            step,
            memory.series,
            memory.gained.joint,
            memory.seen,
        )
        following.theta[j], following.theta_dot[j] = rotor.angle, rotor.speed
        following.tau_motor[j] = rotor.torque


@inner
def interpolate(physics, step):
    """Write state and spring torques at the look inside the step that was tried.

    Links move along the cubic through angles and speeds at both ends, as motors are moved; their
    speeds are the cubic through speeds and accelerations.
    """
    now, following, memory, t = (
        physics.now, physics.following, physics.memory, physics.held.look[0],
    )  # fmt: skip
    at, n, nv = physics.between, now.theta.size, now.v.size
    base, rate, u = nv - n, memory.rates[1], memory.rates[2]
    spatial.tangent_rate(memory.displacement, following.v, base, rate)
    x = t / step
    ahead, early, late = x * x * (3.0 - 2.0 * x), t * (1.0 - x) ** 2, t * x * (x - 1.0)
    for i in range(nv):
        turn = following.v[i] - now.v[i]
        bend = early * now.acceleration[i] + late * following.acceleration[i]
        at.v[i] = now.v[i] + ahead * turn + bend
        u[i] = ahead * memory.displacement[i] + early * now.v[i] + late * rate[i]
    spatial.integrate(now.q, u, base, at.q)
    for j in range(n):
        q, v = now.q.size - n + j, base + j
        rotor = Rotor(memory.seen[0, j], memory.seen[1, j], 0.0)
        at.theta[j], at.theta_dot[j] = rotor.angle, rotor.speed
        at.tau_sea[j] = motor.spring_torque(physics.plant.motors, j, rotor, at.q[q], at.v[v])


@inner
def take_step(physics, step):
    """Do a step in the present contact modes; return whether every instant has a solution."""
    plant, work, now, following = physics.plant, physics.work, physics.now, physics.following
    held, memory = physics.held, physics.memory
    rates, accelerations, powers = memory.rates, memory.accelerations, memory.powers
    base = now.v.size - now.theta.size
    _predict_motors(plant, now, held, step, memory)
    copy(now.tau_motor, following.tau_motor)
    copy(now.force, following.force)
    copy(now.v, rates[0])
    copy(now.acceleration, accelerations[0])
    copy(now.power, powers[0])
    for k in range(1, 5):
        if k == 4:
            _close(plant, now, held, step, memory, following)
        else:
            spatial.stage(
                now.q, now.v, rates[k - 1], accelerations[k - 1], step if k == 3 else 0.5 * step,
                base, memory.displacement, following.q, following.v, rates[k],
            )  # fmt: skip
            copy(memory.angle[k // 3], following.theta)
            copy(memory.speed[k // 3], following.theta_dot)
        if not accelerate(plant, following, work):
            return False
        if k < 4:
            copy(following.acceleration, accelerations[k])
            copy(following.power, powers[k])
    for k in range(powers.shape[1]):
        mean = powers[0, k] + 2.0 * (powers[1, k] + powers[2, k]) + powers[3, k]
        memory.gained.scalar[k] = step / 6.0 * mean
    return True


@inner
def _stores(motors, at, out):
    """Write kinetic, gravity, spring and motor energy (4,)."""
    n = at.theta.size
    out[KINETIC_STORE], out[GRAVITY_STORE] = at.energy[KINETIC], at.energy[POTENTIAL]
    out[SPRING_STORE] = out[MOTOR_STORE] = 0.0
    for j in range(n):
        stretch = at.theta[j] - at.q[at.q.size - n + j]
        out[SPRING_STORE] += 0.5 * motors.stiffness[j] * stretch * stretch
        out[MOTOR_STORE] += 0.5 * motors.inertia[j] * at.theta_dot[j] * at.theta_dot[j]


@inner
def _update_stores(physics):
    """Write the present stores, and add how much has moved between them."""
    ledger, now = physics.ledger, physics.memory.gained.stores
    _stores(physics.plant.motors, physics.now, now)
    for k in range(now.size):
        ledger.moved[0] += abs(now[k] - ledger.stores[k])
        ledger.stores[k] = now[k]


@inner
def accept(physics):
    """Take the step's end for the present instant, and book the step."""
    ledger, gained = physics.ledger, physics.memory.gained
    for k in range(gained.joint.shape[0]):
        for j in range(gained.joint.shape[1]):
            ledger.joint[k, j] += gained.joint[k, j]
    for k in range(IMPACT):
        ledger.scalar[k] += gained.scalar[k]
    _copy(physics.following, physics.now)
    _update_stores(physics)


@inner
def _copy(source, target):
    """Write everything about one instant into another."""
    copy(source.q, target.q)
    copy(source.v, target.v)
    copy(source.theta, target.theta)
    copy(source.theta_dot, target.theta_dot)
    copy(source.tau_motor, target.tau_motor)
    copy(source.tau_sea, target.tau_sea)
    copy(source.acceleration, target.acceleration)
    copy(source.force, target.force)
    copy(source.gap, target.gap)
    copy(source.position, target.position)
    copy(source.velocity, target.velocity)
    copy(source.power, target.power)
    copy(source.energy, target.energy)


@inner
def act(physics, what, touching, impulse):
    """Do one thing with a plant.

    Args:
        physics: the plant.
        what: EVALUATE the present instant's dynamics and contact forces; SETTLE which touching
            points are closed under its forces, or STRIKE them on the ground; or STORE the present
            energies in the books.
        touching: (P,) points that may be closed.
        impulse: (P, 3) of an impact, Ns, written.

    Returns:
        How contacts have settled, as `friction.settle`, and what an impact took, J.
    """
    plant, work, now = physics.plant, physics.work, physics.now
    if what in (SETTLE, STRIKE):
        return resolve(plant, now, work, touching, what == STRIKE, impulse)
    solved = True
    if what == EVALUATE:
        solved = accelerate(plant, now, work)
    else:
        _update_stores(physics)
    return SETTLED if solved else UNSOLVABLE, 0.0


@entry
def sense(kept, t, row):
    """Write what the sensors measure now of `Physics`, see `contact.write_measurement`."""
    write_measurement(kept.parts.now, kept.parts.plant.contacts, t, row)


@entry
def fastest_motors(kept, out):
    """Write bounds of the rates at which the rotors of `Physics` move within limits (n,), 1/s."""
    physics = kept.parts
    for j in range(len(out)):
        out[j] = motor.fastest(physics.plant.motors, j, physics.held.instant, False)
