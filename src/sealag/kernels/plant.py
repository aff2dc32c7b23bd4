"""Plant kernels: steps of links, motors and contacts, and what passes between two ticks.

Link side: fourth-order Runge-Kutta in exponential coordinates about the step's start. Motor side:
exact along the link's cubic. `glide` does step after step, with samples, commands, torque feedback
and the log, until something needs Python: a tick, another load, a change of contact.
"""

from typing import NamedTuple

import numpy as np

from sealag.kernels import motor, spatial
from sealag.kernels._jit import entry, inner
from sealag.kernels.contact import (
    Instant,
    accelerate,
    allocate_work,
    plant_of,
    resolve,
)
from sealag.kernels.dynamics import KINETIC, POTENTIAL, Terms
from sealag.kernels.friction import SETTLED, UNSOLVABLE
from sealag.kernels.ledger import (
    GRAVITY_STORE,
    IMPACT,
    KINETIC_STORE,
    MOTOR_STORE,
    SPRING_STORE,
    Ledger,
)
from sealag.kernels.linalg import copy
from sealag.kernels.motor import Held, Rotor, Series
from sealag.typing import Array

MARGIN = 1e-9
"""m and body weights: a contact this close to changing is at its change. Ten times larger shows in
the energy that an impact takes; ten times smaller asks more of the bisection than a step has."""
SAME = 1e-9  # of a step: instants this close are one
EVALUATE, SETTLE, STRIKE, STEP = range(4)  # what `act` does


class Step(NamedTuple):
    """Memory for one step."""

    rates: Array  # (4, nv) of the coordinates about the step's start, at the stages
    accelerations: Array  # (4, nv)
    powers: Array  # (4, 4)
    displacement: Array  # (nv,)
    angle: Array  # (2, n) motor angles half a step and a step ahead
    speed: Array  # (2, n)
    gained: Ledger  # works of the step; its stores are not used
    series: Series


@inner
def allocate_step(nv, gained):
    n = gained.joint.shape[1]
    return Step(
        np.empty((4, nv)), np.empty((4, nv)), np.empty((4, 4)), np.empty(nv), np.empty((2, n)),
        np.empty((2, n)), gained, motor.allocate_series(),
    )  # fmt: skip


@inner
def _predict_motors(plant, now, held, step, memory):
    """Write motor angles and speeds half a step and a step ahead, the links accelerating evenly."""
    n, motors = now.theta.size, plant.motors
    first_q, first_v = now.q.size - n, now.v.size - n
    for j in range(n):
        link = motor.Link(
            now.q[first_q + j], now.v[first_v + j], now.acceleration[first_v + j], 0.0
        )
        rotor = Rotor(now.theta[j], now.theta_dot[j], now.tau_motor[j])
        half, whole = motor.predict(motors, j, held, rotor, link, step, memory.series)
        memory.angle[0, j], memory.speed[0, j] = half.angle, half.speed
        memory.angle[1, j], memory.speed[1, j] = whole.angle, whole.speed


@inner
def _close(plant, now, held, step, memory, following):
    """Move the links to the step's end, and the motors along the links' cubic."""
    n = now.theta.size
    first_q, first_v = now.q.size - n, now.v.size - n
    spatial.combine(
        now.q, now.v, memory.rates, memory.accelerations, step, first_v, following.q, following.v
    )
    for j in range(n):
        q, v = first_q + j, first_v + j
        link = motor.link_through(now.q[q], now.v[v], following.q[q], following.v[v], step)
        rotor = Rotor(now.theta[j], now.theta_dot[j], now.tau_motor[j])
        rotor = motor.move(
            plant.motors, j, held, rotor, link, step, memory.series, memory.gained.joint
        )
        following.theta[j], following.theta_dot[j] = rotor.angle, rotor.speed
        following.tau_motor[j] = rotor.torque


@inner
def take_step(plant, work, now, held, step, memory, following):
    """Do a step in the present contact modes; return whether every instant has a solution."""
    rates, accelerations, powers = memory.rates, memory.accelerations, memory.powers
    base = now.v.size - now.theta.size
    _predict_motors(plant, now, held, step, memory)
    copy(now.tau_motor, following.tau_motor)
    copy(now.force, following.force)
    copy(now.v, rates[0])
    copy(now.acceleration, accelerations[0])
    copy(now.power, powers[0])
    for k in range(1, 4):
        spatial.stage(
            now.q, now.v, rates[k - 1], accelerations[k - 1], step if k == 3 else 0.5 * step, base,
            memory.displacement, following.q, following.v, rates[k],
        )  # fmt: skip
        copy(memory.angle[k // 3], following.theta)
        copy(memory.speed[k // 3], following.theta_dot)
        if not accelerate(plant, following, work):
            return False
        copy(following.acceleration, accelerations[k])
        copy(following.power, powers[k])
    for k in range(powers.shape[1]):
        mean = powers[0, k] + 2.0 * (powers[1, k] + powers[2, k]) + powers[3, k]
        memory.gained.scalar[k] = step / 6.0 * mean
    _close(plant, now, held, step, memory, following)
    return accelerate(plant, following, work)


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
def _update_stores(motors, at, ledger):
    """Write the stores of an instant, and add how much has moved between them."""
    before = ledger.stores.copy()
    _stores(motors, at, ledger.stores)
    for k in range(before.size):
        ledger.moved[0] += abs(ledger.stores[k] - before[k])


@inner
def accept(motors, following, now, gained, ledger):
    """Take the step's end for the present instant, and book the step."""
    for k in range(gained.joint.shape[0]):
        for j in range(gained.joint.shape[1]):
            ledger.joint[k, j] += gained.joint[k, j]
    for k in range(IMPACT):
        ledger.scalar[k] += gained.scalar[k]
    _copy(following, now)
    _update_stores(motors, now, ledger)


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


@entry
def act(raw_plant, raw_terms, raw_instants, what, raw_held, step, raw_gained, touching, impulse):
    """Do one thing with a plant: all that Python asks of it shares one compilation.

    Args:
        raw_plant: the plant.
        raw_terms: scratch.
        raw_instants: the present instant, and the end of a step.
        what: EVALUATE the present instant's dynamics and contact forces; SETTLE which touching
            points are closed under its forces, or STRIKE them on the ground; try a STEP.
        raw_held: what the drives hold over a step.
        step: its length, s.
        raw_gained: `Ledger` of a step's works, written.
        touching: (P,) points that may be closed.
        impulse: (P, 3) of an impact, Ns, written.

    Returns:
        How contacts have settled, as `friction.settle`, and what an impact took, J.
    """
    plant, work, now, following, gained = unpack(raw_plant, raw_terms, raw_instants, raw_gained)
    if what in (SETTLE, STRIKE):
        return resolve(plant, now, work, touching, what == STRIKE, impulse)
    if what == EVALUATE:
        solved = accelerate(plant, now, work)
    else:
        memory = allocate_step(now.v.size, gained)
        solved = take_step(plant, work, now, Held(*raw_held), step, memory, following)
    return SETTLED if solved else UNSOLVABLE, 0.0


@entry
def update_stores(raw_motors, raw_now, raw_ledger):
    """Write the stores of an instant, and add how much has moved between them."""
    _update_stores(motor.Motors(*raw_motors), Instant(*raw_now), Ledger(*raw_ledger))


@inner
def unpack(raw_plant, raw_terms, raw_instants, raw_ledger):
    """Return plant, memory, the present and the following instant, and the books."""
    plant, (now, following) = plant_of(raw_plant), raw_instants
    work = allocate_work(plant, Terms(*raw_terms))
    return plant, work, Instant(*now), Instant(*following), Ledger(*raw_ledger)
