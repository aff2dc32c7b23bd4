"""Motor damping that a limit of transparency leaves (docs/theory section 16.4)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sealag.design import System
from sealag.tune._gains import floored
from sealag.tune._question import Limit, Question
from sealag.tune._write import base_damping
from sealag.typing import Array

_AT_REST = 1e-9
"""Share of the largest mean square of a speed below which a joint rests."""
LEAST_DAMPING = 1e-6
"""Nms/rad: the smallest motor damping of a project file."""

_UNITS = {Limit.BANDWIDTH: "Hz", Limit.RMS: "Nm"}


class Room(NamedTuple):
    """Motor damping within the limits, with few digits.

    Attributes:
        least: (n,) Nms/rad; NaN where no damping meets the limits.
        most: (n,) Nms/rad, likewise; inf for all joints without a limit. A joint that rests along
            the motion of an RMS, which does not limit it, has its own.
    """

    least: Array
    most: Array

    def closed(self) -> Array:
        """Return which joints (n,) no damping leaves within the limits."""
        return ~(self.least <= self.most)

    def design(self, system: System) -> System:
        """Return a design with the most damping; the design itself without a limit.

        Args:
            system: the design.
        """
        if np.isinf(self.most).all():
            return system
        drives = replace(system.actuators, motor_damping=self.most)
        return replace(system, actuators=drives)


def least_of(system: System) -> Array:
    """Return the smallest motor damping that can be set, (n,) Nms/rad.

    Args:
        system: a design; under joint PD its motors keep their own.
    """
    return np.maximum(base_damping(system), LEAST_DAMPING)


def room_of(question: Question) -> Room:
    """Return the motor damping that the limits of a question leave.

    Args:
        question: its limits, drives and motion.
    """
    drives, limits = question.system.actuators, question.limits
    own = least_of(question.system)
    least = own
    most = np.full(drives.n, np.inf)
    if not limits:
        return Room(least, most)
    if Limit.BANDWIDTH in limits:
        most = np.minimum(most, drives.most_damping(limits[Limit.BANDWIDTH]))
    if Limit.RMS in limits:
        low, high = _quiet(question, limits[Limit.RMS])
        least, most = np.maximum(least, low), np.minimum(most, high)
    most = np.where(np.isinf(most), np.maximum(drives.motor_damping, least), most)
    # The own damping under joint PD, below which none can be set, keeps its digits.
    return Room(np.where(least == own, own, -floored(-least)), floored(most))


def _moments(question: Question) -> tuple[Array, Array, Array]:
    """Means over the motion of θ̇², θ̇ θ̈ and θ̈², (n,) each; motors follow the joints."""
    motion, base = question.motion, question.system.robot.nv_base
    assert motion is not None  # a question with this limit has one
    rate = motion.v[:, base:]
    change = np.gradient(rate, motion.time, axis=0)
    span = motion.time[-1] - motion.time[0]

    def mean(values: Array) -> Array:
        return np.trapezoid(values, motion.time, axis=0) / span

    return mean(rate**2), mean(rate * change), mean(change**2)


def _quiet(question: Question, rms: float) -> tuple[Array, Array]:
    """The interval of D with RMS(B_s θ̈ + D θ̇) ≤ rms, (n,) each; NaN where it is empty.

    The mean square is a parabola in D; a motion that brakes has its vertex above 0.
    """
    inertia = question.system.actuators.shaped_inertia
    a, cross, change = _moments(question)
    b, c = inertia * cross, inertia**2 * change - rms**2
    moving = a > _AT_REST * a.max()
    a = np.where(moving, a, 1.0)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b**2 - a * c)
    low, high = (-b - root) / a, (-b + root) / a
    return np.where(moving, low, 0.0), np.where(moving, high, np.inf)


def transparency_of(question: Question, system: System) -> dict[str, dict[str, float]]:
    """Return how well the torque of each joint follows its command, by quantity and joint.

    bandwidth_hz is that of the locked joint, rms_nm that of Γ_sea − τ_osc = −(B_s θ̈ + D_θ θ̇)
    along the motion; without one of two instants it is left out.

    Args:
        question: whose motion.
        system: the design.
    """
    drives, joints = system.actuators, system.robot.joints
    found = {"bandwidth_hz": dict(zip(joints, drives.transparency().bandwidth.tolist()))}
    if question.moves:
        a, cross, change = _moments(question)
        B_s, D = drives.shaped_inertia, drives.motor_damping
        square = D**2 * a + 2.0 * D * B_s * cross + B_s**2 * change
        found["rms_nm"] = dict(zip(joints, np.sqrt(np.maximum(square, 0.0)).tolist()))
    return found


def limits_text(limits: Mapping[Limit, float]) -> str:
    """Say limits in words.

    Args:
        limits: by quantity.
    """
    return " and ".join(f"{name} {value:g} {_UNITS[name]}" for name, value in limits.items())


def closed_text(question: Question, room: Room) -> str:
    """Say which joint has no damping within the limits.

    Args:
        question: whose limits.
        room: that is closed for a joint.
    """
    at = int(room.closed().argmax())
    joint = question.system.robot.joints[at]
    return (
        f"no motor damping of {joint} meets the limit {limits_text(question.limits)}: its shaped "
        "inertia, or the least damping that it can have, is too large for it"
    )
