"""What passes between two ticks of the controller, in one call.

`move` does step after step, with samples, commands, torque feedback and the log, until something
needs Python: a tick, another load, a change of contact.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sealag.kernels import spatial
from sealag.kernels._jit import entry, inner
from sealag.kernels.contact import (
    ground_height,
    measure_gaps,
    smallest_margin,
    write_measurement,
)
from sealag.kernels.dynamics import KINETIC
from sealag.kernels.friction import SETTLED, UNSOLVABLE
from sealag.kernels.ledger import JOINT_FLOWS, SCALAR_FLOWS, STORES
from sealag.kernels.linalg import copy
from sealag.kernels.plant import (
    GLIDE,
    MARGIN,
    SAME,
    STEP,
    STORE,
    accept,
    act,
    interpolate,
    take_step,
)
from sealag.typing import Array, IntArray

LOAD, SAMPLE, TICK, TAKE = range(4)  # kinds of events, in their order at one instant
WATCH, EVENTS, CLOSE, MOVE, INSIDE = range(5)
"""What comes next in a run: at a step's beginning watch, let events happen, close the instant
(torque feedback and log), move; inside a step only events."""
END, FALLEN, EVENT, STATE, BLOCKED = range(5)  # why `move` returns from a run


class Channels(NamedTuple):
    """What happens when in a run, and what is on its way."""

    due: Array  # (E,) instants of events, s, increasing
    kind: NDArray[np.int8]  # (E,) LOAD, SAMPLE, TICK or TAKE
    tick: NDArray[np.int32]  # (E,) whose sample, or whose command
    samples: Array  # (R, row) measurements that are on their way, at their tick modulo R
    commands: Array  # (R, n) commands that are on their way, likewise
    sent: Array  # (n,) the last command, Nm
    acting_tick: IntArray  # (1,) tick of the command that the drives hold; -1 for the first
    torque_known: Array  # (L,) instant of the spring torque that the drives know; empty if now's
    torque_history: Array  # (H, n) spring torques at the last looks, Nm
    storage: Array  # (1,) that the controller states, J
    tank: Array  # (1,) energy in its tank, J
    undelayed_work: Array  # (n,) of the command that it would give without delay, J


class Periods(NamedTuple):
    """Lengths of a run."""

    step: float  # of the physics, s
    steps: int  # how many of them
    log: int  # steps from one logged instant to the next
    watch: int  # steps from one look for a fall to the next
    torque: int  # steps from one look for spring torque to the next
    torque_period: float  # the same in s


class Log(NamedTuple):
    """Logged instants, one a row."""

    time: Array  # (N,) s
    tick: IntArray  # (N,) of the command that acts
    q: Array  # (N, nq)
    v: Array  # (N, nv)
    theta: Array  # (N, n)
    theta_dot: Array  # (N, n)
    tau_motor: Array  # (N, n)
    tau_sea: Array  # (N, n)
    tau_command: Array  # (N, n)
    tau_osc: Array  # (N, n)
    contact_force: Array  # (N, P, 3)
    contact_mode: IntArray  # (N, P) 0 open, 1 sticking, 2 slipping
    stores: Array  # (N, 4)
    joint: Array  # (N, 9, n)
    scalar: Array  # (N, 5)
    moved: Array  # (N,)
    storage: Array  # (N,)
    tank: Array  # (N,)
    undelayed_work: Array  # (N, n)


_WHOLE = ("tick", "contact_mode")  # columns of the log that are whole numbers


class Limits(NamedTuple):
    """When a run has left what it is about."""

    deflection: float  # rad: a spring deflection beyond any physical range
    speed: float  # rad/s, m/s: a velocity likewise
    height: float  # m above the ground, of the base; -inf if nothing counts as a fall
    tilt: float  # cosine of the base's largest tilt
    up: Array  # (1, 3) where its z axis points at the start


@inner
def _lost(plant, now, limits):
    """Whether the robot has fallen or left any physical range."""
    n, contacts = now.theta.size, plant.contacts
    for j in range(n):
        if not abs(now.theta[j] - now.q[now.q.size - n + j]) < limits.deflection:
            return True
    for i in range(now.v.size):
        if not abs(now.v[i]) < limits.speed:
            return True
    if limits.height == -np.inf:
        return False
    _, _, z_axis = spatial.transpose(spatial.rotation_of(now.q[3], now.q[4], now.q[5], now.q[6]))
    height = now.q[2] - ground_height(contacts, now.q[0])
    return height < limits.height or spatial.dot(z_axis, spatial.vector(limits.up, 0)) < limits.tilt


@inner
def _feed_torque(channels, periods, look, now, known):
    """Give the drives the spring torque that reaches their torque feedback now."""
    history, size = channels.torque_history, channels.torque_history.shape[0]
    copy(now.tau_sea, history[look % size])
    place = channels.torque_known[look] / periods.torque_period
    before = int(place + SAME)
    part, after = max(0.0, place - before), min(before + 1, look)
    for j in range(now.tau_sea.size):
        earlier = history[before % size, j]
        known[j] = earlier + part * (history[after % size, j] - earlier)


@inner
def _record(physics, channels, time, log, row):
    """Write a row of the log."""
    now, ledger, contacts = physics.now, physics.ledger, physics.plant.contacts
    log.time[row], log.tick[row] = time, channels.acting_tick[0]
    copy(now.q, log.q[row])
    copy(now.v, log.v[row])
    copy(now.theta, log.theta[row])
    copy(now.theta_dot, log.theta_dot[row])
    copy(now.tau_motor, log.tau_motor[row])
    copy(now.tau_sea, log.tau_sea[row])
    copy(channels.sent, log.tau_command[row])
    copy(physics.held.command, log.tau_osc[row])
    copy(channels.undelayed_work, log.undelayed_work[row])
    copy(now.force, log.contact_force[row])
    copy(ledger.stores, log.stores[row])
    copy(ledger.joint, log.joint[row])
    copy(ledger.scalar, log.scalar[row])
    log.storage[row], log.tank[row] = channels.storage[0], channels.tank[0]
    for i in range(contacts.closed.size):
        slipping = 1 if contacts.yielding[i] > 0.0 else 0
        log.contact_mode[row, i] = contacts.closed[i] * (1 + slipping)
    log.moved[row] = ledger.moved[0]


@inner
def _happen(physics, channels, event):
    """Let an event happen; False if it needs Python."""
    tick = channels.tick[event]
    if channels.kind[event] == SAMPLE:
        row = channels.samples[tick % channels.samples.shape[0]]
        write_measurement(physics.now, physics.plant.contacts, channels.due[event], row)
    elif channels.kind[event] == TAKE:
        copy(channels.commands[tick % channels.commands.shape[0]], physics.held.command)
        channels.acting_tick[0] = tick
    else:
        return False
    return True


@inner
def _passed(held, channels, event, begin, end):
    """Return the event that ends a step, and prepare drives and sensors for those before: a step
    passes one sample and one taking."""
    while event < channels.due.size and channels.due[event] < end:
        kind, after = channels.kind[event], channels.due[event] - begin
        if kind == TAKE and held.change[0] == np.inf:
            held.change[0] = after
            tick = channels.tick[event]
            copy(channels.commands[tick % channels.commands.shape[0]], held.later)
        elif kind == SAMPLE and held.look[0] == np.inf:
            held.look[0] = after
        else:
            break
        event += 1
    return event


@inner
def _pass(physics, channels, event, last, step):
    """Let the events happen that a step has passed, from one on to a last one."""
    for k in range(event, last):
        if channels.kind[k] == SAMPLE:
            interpolate(physics, step)
            row = channels.samples[channels.tick[k] % channels.samples.shape[0]]
            write_measurement(physics.between, physics.plant.contacts, channels.due[k], row)
        else:
            copy(physics.held.later, physics.held.command)
            channels.acting_tick[0] = channels.tick[k]


@inner
def _keeps_sliding(physics):
    """Whether no point begins or ends to slide in the step that was tried."""
    before, now = physics.memory.yielding, physics.plant.contacts.yielding
    same = True
    for i in range(now.size):
        same = same and (before[i] > 0.0) == (now[i] > 0.0)
    return same


@inner
def _keeps_contacts(physics):
    """Whether no contact changes in the step that was tried."""
    contacts, following = physics.plant.contacts, physics.following
    if not np.isfinite(following.energy[KINETIC]):
        return False
    measure_gaps(contacts, following)
    smallest, _ = smallest_margin(
        contacts.C, contacts.closed, contacts.weight, following.force, following.gap,
        following.velocity,
    )  # fmt: skip
    return smallest >= -MARGIN


class Undelayed(NamedTuple):
    """∫τ_now dθ of a command that is known at instants, the newest last."""

    theta: Array  # (3, n) motor angles, rad
    command: Array  # (3, n) τ_now, Nm
    work: Array  # (n,) J
    rough: Array  # (1,) J
    before: Array  # (1,) work of the last interval, J
    instants: IntArray  # (1,) how many there were


def allocate_undelayed(n: int) -> Undelayed:
    """Return the work of n joints before the first instant."""
    return Undelayed(
        theta=np.zeros((3, n)), command=np.zeros((3, n)), work=np.zeros(n), rough=np.zeros(1),
        before=np.zeros(1), instants=np.zeros(1, np.int64),
    )  # fmt: skip


@entry
def carry_work(kept, theta):
    """Carry `Undelayed` on to motor angles (n,), at which the newest command holds: trapezoids."""
    _carry_work(kept.parts, theta)


@inner
def _carry_work(done, theta):
    count, now, wide = done.instants[0], 0.0, 0.0
    for j in range(theta.size):
        done.theta[2, j], force = theta[j], done.command[2, j]
        if count > 0:
            part = 0.5 * (done.command[1, j] + force) * (theta[j] - done.theta[1, j])
            done.work[j] += part
            now += part
        if count > 1:
            wide += 0.5 * (done.command[0, j] + force) * (theta[j] - done.theta[0, j])
    if count > 1:
        done.rough[0] += 0.5 * abs(wide - done.before[0] - now)
    for k in range(2):
        copy(done.theta[k + 1], done.theta[k])
        copy(done.command[k + 1], done.command[k])
    done.before[0] = now
    done.instants[0] = count + 1


class Course(NamedTuple):
    """What a run does with a plant, and its log."""

    channels: Channels
    periods: Periods
    limits: Limits
    log: Log


def log_shapes(nq: int, nv: int, n: int, *, points: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of one row of each array of a log."""
    shapes = {
        "time": (), "tick": (), "q": (nq,), "v": (nv,), "contact_force": (points, 3),
        "contact_mode": (points,), "stores": (len(STORES),), "joint": (len(JOINT_FLOWS), n),
        "scalar": (len(SCALAR_FLOWS),), "moved": (), "storage": (), "tank": (),
    }  # fmt: skip
    return {name: shapes.get(name, (n,)) for name in Log._fields}


def allocate_log(
    rows: int, shapes: dict[str, tuple[int, ...]], zeros: Callable[..., Any] = np.zeros
) -> Log:
    """Return an empty log of rows of given shapes, its arrays made by `zeros`."""
    return Log(
        **{
            name: zeros((rows, *shape), np.int64 if name in _WHOLE else float)
            for name, shape in shapes.items()
        }
    )


def idle(n: int) -> Course:
    """Return the course of a plant of n joints that is in no run."""
    log, empty = allocate_log(0, log_shapes(0, 0, n, points=0)), np.zeros(0)
    one = np.zeros(1)
    channels = Channels(
        due=empty, kind=np.zeros(0, np.int8), tick=np.zeros(0, np.int32),
        samples=np.zeros((1, 1)), commands=np.zeros((1, n)), sent=np.zeros(n),
        acting_tick=np.zeros(1, np.int64), torque_known=empty, torque_history=np.zeros((1, n)),
        storage=one, tank=one.copy(), undelayed_work=np.zeros(n),
    )  # fmt: skip
    periods = Periods(step=1.0, steps=0, log=1, watch=1, torque=1, torque_period=1.0)
    limits = Limits(deflection=1.0, speed=1.0, height=-1.0, tilt=-1.0, up=np.zeros((1, 3)))
    return Course(channels, periods, limits, log)


class Cursor(NamedTuple):
    """Where a run is."""

    time: float  # s
    step: int  # the physics step that begins, or is under way
    event: int  # the next event
    part: int  # WATCH, EVENTS, CLOSE, MOVE or INSIDE


@entry
def drive(kept, course, what, step, touching, impulse, cursor, said):
    """Do one thing with a plant, or go on with a run: all shares one compilation.

    Args:
        kept: `Physics`.
        course: kept `Course`; idle where there is no run.
        what: what to do; try a STEP in the present contact modes, GLIDE through a run, or what
            `plant.act` does.
        step: length of the STEP, s.
        touching: (P,) points that may be closed.
        impulse: (P, 3) of an impact, Ns, written.
        cursor: raw `Cursor` of the run.
        said: instant at which the controller last stated its storage, s; inf if it states none.

    Returns:
        What `plant.act` or `move` return: a status, what an impact took (J) or the instant (s), and
        the raw `Cursor`.
    """
    if what <= STORE:
        status, lost = act(kept.parts, what, touching, impulse)
        return status, lost, Cursor(*cursor)
    return move(kept.parts, course.parts, what, step, Cursor(*cursor), said)


@inner
def move(physics, course, what, length, at, said):
    """Try one step, or go on with a run until something needs Python.

    Args:
        physics: the plant.
        course: the run.
        what: STEP or GLIDE.
        length: of the STEP, s.
        at: `Cursor`.
        said: instant at which the controller last stated its storage, s; inf if it states none.

    Returns:
        SETTLED or UNSOLVABLE of a STEP; of a run END; FALLEN if `Limits` are left; EVENT if an
        event needs Python, whose part it is to count it; STATE if the controller must state its
        storage for the log; BLOCKED if a step needs Python. The present instant, s. And the
        `Cursor`, that of BLOCKED behind the step.
    """
    plant, now = physics.plant, physics.now
    channels, periods, limits, log = course.channels, course.periods, course.limits, course.log
    same, span = SAME * periods.step, length
    time, step, event, part = at.time, at.step, at.event, at.part
    begin, whole = time, False  # only a step from one multiple of the period to the next is whole
    profiled = plant.contacts.ground_x.size > 0 or plant.contacts.closed.size == 0
    while True:
        first = event
        if what == GLIDE:
            if part == WATCH:
                part = EVENTS
                if step % periods.watch == 0 and (not profiled or _lost(plant, now, limits)):
                    return FALLEN, time, Cursor(time, step, event, part)
            if part in (EVENTS, INSIDE):
                while event < channels.due.size and channels.due[event] <= time + same:
                    if not _happen(physics, channels, event):
                        return EVENT, time, Cursor(time, step, event, part)
                    event += 1
                part = CLOSE if part == EVENTS else MOVE
            if part == CLOSE:
                logged = step % periods.log == 0 or step == periods.steps
                if logged and said != np.inf and said != time:
                    return STATE, time, Cursor(time, step, event, part)
                if channels.torque_known.size > 0 and step % periods.torque == 0:
                    look = step // periods.torque
                    _feed_torque(channels, periods, look, now, physics.held.known_torque)
                if logged:
                    row = (step + periods.log - 1) // periods.log
                    _record(physics, channels, time, log, row)
                if step == periods.steps:
                    return END, time, Cursor(time, step, event, part)
                part, whole = MOVE, profiled
            begin, end, first = time, (step + 1) * periods.step, event
            if whole:
                event = _passed(physics.held, channels, event, begin, end - same)
            time, part = end, WATCH
            if event < channels.due.size and channels.due[event] < end - same:
                time, part = channels.due[event], INSIDE
            else:
                step += 1
            span = time - begin
            if abs(span - periods.step) <= same:
                span = periods.step
            if not profiled:
                return BLOCKED, begin, Cursor(time, step, event, part)
            copy(plant.contacts.yielding, physics.memory.yielding)
        solved = take_step(physics, span)
        if what == STEP:
            return SETTLED if solved else UNSOLVABLE, 0.0, at
        done = solved and _keeps_contacts(physics)
        if not done or (event > first and not _keeps_sliding(physics)):
            copy(physics.memory.yielding, plant.contacts.yielding)
            if event == first:
                return BLOCKED, begin, Cursor(time, step, event, part)
            step -= part == WATCH  # again, in parts that end at its events
            time, event, part = begin, first, MOVE
        else:
            _pass(physics, channels, first, event, span)
            accept(physics)
        physics.held.change[0] = physics.held.look[0] = np.inf
        whole = False
