"""Motor kernels: one series elastic joint moved exactly over a step, and its works.

Over a step the link follows a cubic, the drive holds its command, and the rotor obeys a linear
differential equation with constant coefficients (`rates`). Its solution is a Taylor series: over a
time in which the equation moves the state by at most as much as itself, some twenty terms leave
nothing but rounding, and Gauss' rule with eight places integrates products of two such series as
exactly.
"""

import math
from typing import NamedTuple

import numpy as np

from sealag.kernels._jit import entry, inner, shared
from sealag.typing import Array

_REACH = 1.5
"""Rate times time of one series. A third further, Gauss' rule of eight places leaves 1e-13."""
_LEFT_OUT = 1e-18  # relative size of the first term of the exponential that is left out
_FORCED = 3  # terms that a cubic link motion appends
_TERMS = 28  # more than `_order` asks for at _REACH
_PLACES, _WEIGHTS = (part.copy() for part in np.polynomial.legendre.leggauss(8))
_PLACES, _WEIGHTS = 0.5 * (1.0 + _PLACES), 0.5 * _WEIGHTS


class Motors(NamedTuple):
    """Springs, motors and drives of n joints."""

    stiffness: Array  # (n,) K, Nm/rad
    spring_damping: Array  # (n,) D_s, Nms/rad
    inertia: Array  # (n,) B, kg m²
    ratio: Array  # (n,) B / B_s of the inertia shaping
    damping: Array  # (n,) D_theta, Nms/rad
    viscous: Array  # (n,) friction, Nms/rad
    coulomb: Array  # (n,) friction, Nm
    torque_limit: Array  # (n,) Nm
    velocity_limit: Array  # (n,) rad/s
    bandwidth: Array  # (n,) of the drive's torque, rad/s; inf if ideal
    bearing: Array  # (n,) damping on the link's side, which no motor feels, Nms/rad


class Rotor(NamedTuple):
    """State of one rotor."""

    angle: float  # rad
    speed: float  # rad/s
    torque: float  # of the motor, Nm; carried on only with a finite bandwidth


class Link(NamedTuple):
    """Cubic motion of one joint's link from an instant on."""

    angle: float  # rad
    speed: float  # rad/s
    bend: float  # rad/s²
    jerk: float  # rad/s³


class Drive(NamedTuple):
    """What one drive does from an instant on."""

    limited: bool  # its torque is at a limit
    locked: bool  # Coulomb friction holds the rotor
    held: float  # command, or the limit, Nm
    friction: float  # Coulomb torque on the rotor, Nm


class Works(NamedTuple):
    """Integrals along one rotor's motion."""

    speed_squared: float  # ∫θ̇²
    port: float  # ∫τ_sea q̇
    shaft: float  # ∫τ_sea θ̇
    slip_squared: float  # ∫(θ̇ − q̇)²
    motor: float  # ∫τ_m θ̇


class Series(NamedTuple):
    """Taylor coefficients in time per length of the piece, and values at Gauss' places."""

    speed: Array  # (_TERMS,)
    spring: Array  # (_TERMS,)
    torque: Array  # (_TERMS,)
    values: Array  # (3, places) of the three


def allocate_series() -> Series:
    """Return memory for one rotor's series."""
    return Series(
        speed=np.zeros(_TERMS), spring=np.zeros(_TERMS), torque=np.zeros(_TERMS),
        values=np.zeros((3, len(_PLACES))),
    )  # fmt: skip


@inner
def spring_torque(motors, j, rotor, angle, speed):
    """Return τ_sea = K (θ − q) + D_s (θ̇ − q̇) of joint j, Nm; linear."""
    stretch, rate = rotor.angle - angle, rotor.speed - speed
    return motors.stiffness[j] * stretch + motors.spring_damping[j] * rate


@inner
def rates(motors, j, instant, drive, rotor, angle, speed):
    """Return the rates of joint j's rotor, its spring torque and the torque on the rotor.

    Eqs. (5)-(8): B θ̈ = τ_m − τ_sea − viscous θ̇ + friction, with the drive's command
    τ_m = ratio (u − D_θ θ̇) + (1 − ratio) τ_sea; linear in rotor, link, held and friction.

    Args:
        motors: all joints.
        j: the joint.
        instant: whether torque feedback is not delayed.
        drive: what it does.
        rotor: its state.
        angle: of the link, rad.
        speed: of the link, rad/s.
    """
    ratio, bandwidth = motors.ratio[j], motors.bandwidth[j]
    spring = spring_torque(motors, j, rotor, angle, speed)
    command = drive.held
    if not drive.limited:
        command = ratio * (drive.held - motors.damping[j] * rotor.speed)
        if instant:
            command += (1.0 - ratio) * spring
    torque, torque_rate = command, 0.0
    if bandwidth != np.inf:
        torque, torque_rate = rotor.torque, bandwidth * (command - rotor.torque)
    if drive.locked:
        return Rotor(0.0, 0.0, torque_rate), spring, torque
    net = torque - spring - motors.viscous[j] * rotor.speed + drive.friction
    return Rotor(rotor.speed, net / motors.inertia[j], torque_rate), spring, torque


@entry
def rate_rows(raw_motors, instant, speed, torque):
    """Write what each of six causes does to the rates of speed and drive torque within limits.

    Args:
        raw_motors: all joints.
        instant: whether torque feedback is not delayed.
        speed: (6, n) of the motor's angle, speed and drive torque, the link's angle and speed, and
            the command; written.
        torque: (6, n), likewise.
    """
    motors = Motors(*raw_motors)
    for j in range(speed.shape[1]):
        for cause in range(6):
            angle, turn, drives, link, link_speed, command = [
                1.0 if cause == k else 0.0 for k in range(6)
            ]
            rotor, drive = Rotor(angle, turn, drives), Drive(False, False, command, 0.0)
            moved, _, _ = rates(motors, j, instant, drive, rotor, link, link_speed)
            speed[cause, j], torque[cause, j] = moved.speed, moved.torque


@inner
def fastest(motors, j, instant, limited):
    """Return a bound of the rate at which joint j's equation moves the rotor's state, 1/s.

    A norm of its matrix with angles scaled by the rotor's own frequency.
    """
    K, B, D_s, ratio = (
        motors.stiffness[j], motors.inertia[j], motors.spring_damping[j], motors.ratio[j],
    )  # fmt: skip
    fed = abs(1.0 - ratio) if instant and not limited else 0.0
    damping = D_s + motors.viscous[j]
    drag = fed * D_s + (0.0 if limited else ratio * motors.damping[j])
    swing = math.sqrt((1.0 + fed) * K / B)
    if motors.bandwidth[j] == np.inf:
        return swing + (damping + drag) / B
    lag = 1.0 + (drag / swing + fed * K / swing**2) / B
    return 2.0 * swing + damping / B + motors.bandwidth[j] * lag


@inner
def _order(reach):
    """Return how many terms of a series over rate times time ``reach`` are more than rounding."""
    term, order = 1.0, 0
    while term > _LEFT_OUT and order < _TERMS - 1 - _FORCED:
        order += 1
        term *= reach / order
    return order + _FORCED


@inner
def link_at(link, t):
    """Return a link's motion from t on."""
    return Link(
        link.angle + t * (link.speed + 0.5 * t * (link.bend + t * link.jerk / 3.0)),
        link.speed + t * (link.bend + 0.5 * t * link.jerk),
        link.bend + t * link.jerk,
        link.jerk,
    )


@inner
def link_through(q_0, v_0, q_1, v_1, step):
    """Return the cubic through angles and speeds at both ends of a step."""
    rise, turn = q_1 - q_0 - step * v_0, v_1 - v_0
    return Link(
        q_0, v_0, 6.0 * rise / step**2 - 2.0 * turn / step,
        6.0 * turn / step**2 - 12.0 * rise / step**3,
    )  # fmt: skip


@inner
def link_work(link, step):
    """Return ∫q̇² over a step."""
    a, b, c = link.speed, link.bend * step, 0.5 * link.jerk * step**2
    return step * (a * a + a * b + (b * b + 2.0 * a * c) / 3.0 + 0.5 * b * c + 0.2 * c * c)


@inner
def expand(motors, j, instant, drive, rotor, link, t, order, series):
    """Write the series of speed, spring and motor torque over a time t; return the rotor then."""
    angle = speed = torque = 0.0
    for k in range(_FORCED + 1):
        rate, spring, motor = rates(motors, j, instant, drive, rotor, link.angle, link.speed)
        series.speed[k], series.spring[k], series.torque[k] = rotor.speed, spring, motor
        angle += rotor.angle
        speed += rotor.speed
        torque += rotor.torque
        by = t / (k + 1.0)  # the next term is the present one's rate times this
        rotor = Rotor(by * rate.angle, by * rate.speed, by * rate.torque)
        link = Link(by * link.speed, by * link.bend, by * link.jerk, 0.0)
        drive = Drive(drive.limited, drive.locked, 0.0, 0.0)
    # Nothing is left of link and command: what follows is the rotor's own, with the rates of a unit
    # of its angle, speed and torque.
    a, spring_a, motor_a = rates(motors, j, instant, drive, Rotor(1.0, 0.0, 0.0), 0.0, 0.0)
    s, spring_s, motor_s = rates(motors, j, instant, drive, Rotor(0.0, 1.0, 0.0), 0.0, 0.0)
    u, spring_u, motor_u = rates(motors, j, instant, drive, Rotor(0.0, 0.0, 1.0), 0.0, 0.0)
    for k in range(_FORCED + 1, order + 1):
        x, y, z = rotor
        series.speed[k] = y
        series.spring[k] = spring_a * x + spring_s * y + spring_u * z
        series.torque[k] = motor_a * x + motor_s * y + motor_u * z
        angle += x
        speed += y
        torque += z
        by = t / (k + 1.0)
        rotor = Rotor(
            by * (a.angle * x + s.angle * y + u.angle * z),
            by * (a.speed * x + s.speed * y + u.speed * z),
            by * (a.torque * x + s.torque * y + u.torque * z),
        )
    return Rotor(angle, speed, torque)


@inner
def areas(series, order, t):
    """Return ∫δ and ∫(t − s) δ over a series' time t, δ the way since its beginning."""
    once = twice = 0.0
    for k in range(order + 1):
        part = series.speed[k] / ((k + 1.0) * (k + 2.0))
        once += part
        twice += part / (k + 3.0)
    return t**2 * once, t**3 * twice


@inner
def _integrate(series, order, link, t, works):
    """Add the works of one piece of a motion by Gauss' rule."""
    values = series.values
    values[:] = 0.0
    for k in range(order, -1, -1):
        for i in range(8):
            values[0, i] = values[0, i] * _PLACES[i] + series.speed[k]
            values[1, i] = values[1, i] * _PLACES[i] + series.spring[k]
            values[2, i] = values[2, i] * _PLACES[i] + series.torque[k]
    squared, port, shaft, slip, motor = works
    for i in range(8):
        speed, spring, torque = values[0, i], values[1, i], values[2, i]
        s, weight = t * _PLACES[i], t * _WEIGHTS[i]
        link_speed = link.speed + s * (link.bend + 0.5 * s * link.jerk)
        squared += weight * speed * speed
        port += weight * spring * link_speed
        shaft += weight * spring * speed
        slip += weight * (speed - link_speed) ** 2
        motor += weight * torque * speed
    return Works(squared, port, shaft, slip, motor)


@inner
def pieces_of(motors, j, instant, drive, span):
    """Return into how many series a time is divided, their length, and their order."""
    reach = fastest(motors, j, instant, drive.limited) * span
    pieces = max(1, math.ceil(reach / _REACH))
    return pieces, span / pieces, _order(reach / pieces)


@shared
def travel(motors, j, instant, drive, rotor, link, span, series, booked):
    """Move rotor j along its link's cubic while its drive does one thing.

    Args:
        motors: all joints.
        j: the joint.
        instant: whether torque feedback is not delayed.
        drive: what it does.
        rotor: at the beginning.
        link: its cubic from then on.
        span: s.
        series: scratch.
        booked: whether works are asked for.

    Returns:
        The rotor at the end, and its works.
    """
    pieces, t, order = pieces_of(motors, j, instant, drive, span)
    works = Works(0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(pieces):
        here = link_at(link, k * t)
        rotor = expand(motors, j, instant, drive, rotor, here, t, order, series)
        if booked:
            works = _integrate(series, order, here, t, works)
    return rotor, works
