"""Steps of a motor: its drive's command, limits and friction over a step, and the works."""

import math
from typing import NamedTuple

import numpy as np

from sealag.kernels._jit import inner
from sealag.kernels.ledger import (
    COMMAND,
    COULOMB,
    DAMPING,
    JOINT_DAMPING,
    MOTOR_WORK,
    PORT,
    SHAFT,
    SPRING_DAMPING,
    VISCOUS,
)
from sealag.kernels.motor import (
    Drive,
    Rotor,
    areas,
    expand,
    link_at,
    link_work,
    pieces_of,
    spring_torque,
    travel,
)
from sealag.typing import Array

_TURNS = 8  # changes of a rotor's direction in one step
_STOPPED = 1e-13  # of a time, and rad/s: where a reversal is located


class Held(NamedTuple):
    """What the drives hold over a step."""

    command: Array  # (n,) tau_osc, Nm
    later: Array  # (n,) tau_osc from the change on, Nm
    change: Array  # (1,) when it changes, s after the step's beginning; inf if it does not
    look: Array  # (1,) when sensors measure inside the step, likewise
    known_torque: Array  # (n,) spring torque of the torque feedback, Nm, if it is delayed
    instant: bool  # whether torque feedback is not delayed


@inner
def choose(motors, j, held, command, rotor, link):
    """Return what drive j does from now on under a command, the direction of Coulomb friction (0
    for none), and the rotor with the torque that it then has."""
    ratio, limit, coulomb = motors.ratio[j], motors.torque_limit[j], motors.coulomb[j]
    spring = spring_torque(motors, j, rotor, link.angle, link.speed)
    u = command
    if not held.instant:
        u += (1.0 - ratio) / ratio * held.known_torque[j]
    wanted = ratio * (u - motors.damping[j] * rotor.speed)
    if held.instant:
        wanted += (1.0 - ratio) * spring
    upper = limit if rotor.speed < motors.velocity_limit[j] else 0.0
    lower = -limit if rotor.speed > -motors.velocity_limit[j] else 0.0
    limited = wanted > upper or wanted < lower
    if limited:
        u = wanted = min(max(wanted, lower), upper)
    torque = wanted if motors.bandwidth[j] == np.inf else rotor.torque
    locked, direction = False, 0.0
    if coulomb > 0.0:
        net = torque - spring
        locked = rotor.speed == 0.0 and abs(net) <= coulomb
        if not locked:
            direction = math.copysign(1.0, rotor.speed if rotor.speed != 0.0 else net)
    drive = Drive(limited, locked, u, -direction * coulomb)
    return drive, direction, Rotor(rotor.angle, rotor.speed, torque)


@inner
def _reversal(motors, j, instant, drive, rotor, link, time, series):
    """Return the instant in (0, time) at which the speed passes through zero (Illinois)."""
    direction = math.copysign(1.0, rotor.speed)
    low, high, f_low = 0.0, time, direction * rotor.speed
    after, _ = travel(motors, j, instant, drive, rotor, link, time, series, False)
    f_high = direction * after.speed
    for _ in range(30):
        middle = (low * f_high - high * f_low) / (f_high - f_low)
        after, _ = travel(motors, j, instant, drive, rotor, link, middle, series, False)
        f = direction * after.speed
        if abs(f) < _STOPPED or high - low < _STOPPED * time:
            return middle
        if f < 0.0:
            high, f_high = middle, f
            f_low *= 0.5
        else:
            low, f_low = middle, f
            f_high *= 0.5
    return 0.5 * (low + high)


@inner
def predict(motors, j, held, rotor, link, step, series):
    """Return angle and speed of rotor j for the stages of a Runge-Kutta step, twice in its middle
    and once at its end.

    A forcing f enters velocities with ∫f and positions with ∫(h − s) f, which the step takes for
    h (f_0 + 4 f_½ + f_1) / 6 and h² (f_0 + 2 f_½) / 6. The f_½ and f_1 that make both exact are
    f(½h) and f(h) up to h³; they carry a command that changes inside the step. See docs/theory
    section 2.

    Args:
        motors: all joints.
        j: the joint.
        held: what the drives hold.
        rotor: at the beginning.
        link: its motion.
        step: h, s.
        series: scratch.
    """
    start, begin, once, twice = rotor, 0.0, 0.0, 0.0  # ∫δ and ∫(h − s) δ of the way δ = θ − θ_0
    for late in range(2):
        end = step if late else min(held.change[0], step)
        if end <= begin:
            continue
        command = held.later[j] if late else held.command[j]
        drive, _, rotor = choose(motors, j, held, command, rotor, link_at(link, begin))
        pieces, t, order = pieces_of(motors, j, held.instant, drive, end - begin)
        for k in range(pieces):
            at, way = begin + k * t, rotor.angle - start.angle
            here, left = link_at(link, at), step - at - t
            rotor = expand(motors, j, held.instant, drive, rotor, here, t, order, series)
            area, moment = areas(series, order, t)
            once += t * way + area
            twice += t * way * (left + 0.5 * t) + left * area + moment
        begin = end
    middle, turn = 3.0 * twice / step**2, 3.0 * once / step**2 - 0.5 * start.speed
    return (
        Rotor(start.angle + middle, turn, 0.0),
        Rotor(
            start.angle + 6.0 * once / step - 4.0 * middle,
            6.0 * (rotor.angle - start.angle) / step - start.speed - 4.0 * turn,
            0.0,
        ),
    )


@inner
def _stop(held, k, step):
    """Return the end of the k-th of three parts of a step, s: it ends at a look and a change."""
    look, change = held.look[0], held.change[0]
    if k == 2:
        return step
    return min(step, min(look, change) if k == 0 else max(look, change))


@inner
def move(motors, j, held, rotor, link, step, series, flows, seen):
    """Move rotor j over a step along its link's cubic, and write its works.

    A look of sensors, a changing command and friction that reverses end a piece of the step; limits
    act from a piece's beginning.

    Args:
        motors: all joints.
        j: the joint.
        held: what the drives hold.
        rotor: at the beginning.
        link: its cubic.
        step: s.
        series: scratch.
        flows: (9, n) as in ``ledger.JOINT_FLOWS``, J; column j is written.
        seen: (2, n) angles and speeds at the look, rad, rad/s; column j is written if there is one.

    Returns:
        The rotor at the end.
    """
    flows[:, j] = 0.0
    flows[JOINT_DAMPING, j] = motors.bearing[j] * link_work(link, step)
    begin, command = 0.0, held.command[j]
    for k in range(3):
        end = _stop(held, k, step)
        if end <= begin:
            continue
        command = held.command[j] if begin < held.change[0] else held.later[j]
        for _ in range(_TURNS):
            here, left = link_at(link, begin), end - begin
            drive, direction, rotor = choose(motors, j, held, command, rotor, here)
            after, works = travel(
                motors, j, held.instant, drive, rotor, here, left, series, True
            )  # fmt: skip
            span, reversing = left, direction != 0.0 and after.speed * direction < 0.0
            if reversing and rotor.speed == 0.0:  # friction would push it back: it stays
                drive, reversing = Drive(drive.limited, True, drive.held, 0.0), False
                after, works = travel(
                    motors, j, held.instant, drive, rotor, here, left, series, True
                )  # fmt: skip
            elif reversing:
                span = _reversal(motors, j, held.instant, drive, rotor, here, left, series)
                after, works = travel(
                    motors, j, held.instant, drive, rotor, here, span, series, True
                )  # fmt: skip
            _book(motors, j, works, after.angle - rotor.angle, command, flows)
            rotor = Rotor(after.angle, 0.0 if reversing else after.speed, after.torque)
            begin += span
            if not reversing or end - begin <= 1e-12 * step:
                break
        begin = end
        if end == held.look[0]:
            seen[0, j], seen[1, j] = rotor.angle, rotor.speed
    _, _, rotor = choose(motors, j, held, command, rotor, link_at(link, step))
    return rotor


@inner
def _book(motors, j, works, way, command, flows):
    """Add the works of a piece of rotor j's motion, each with its own coefficient."""
    flows[PORT, j] += works.port
    flows[SHAFT, j] += works.shaft
    flows[MOTOR_WORK, j] += works.motor
    flows[COMMAND, j] += command * way
    flows[DAMPING, j] += motors.damping[j] * works.speed_squared
    flows[VISCOUS, j] += motors.viscous[j] * works.speed_squared
    flows[COULOMB, j] += motors.coulomb[j] * abs(way)
    flows[SPRING_DAMPING, j] += motors.spring_damping[j] * works.slip_squared
