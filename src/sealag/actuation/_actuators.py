"""Series elastic actuators: springs, shaped motors, limits (Eqs. 5-8)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sealag.errors import InputError
from sealag.robot import Robot
from sealag.typing import Array, ArrayLike

if TYPE_CHECKING:
    from sealag.kernels.motor import Motors


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuators:
    """The series elastic actuators of a robot, reflected to the joint side.

    Under torque feedback the motors obey B_s θ̈ + D_θ θ̇ + K(θ − q) = τ_osc, Eqs. (5)-(8).

    Attributes:
        joints: (n) names, in the robot's order.
        spring_stiffness: (n,) K, Nm/rad.
        rotor_inertia: (n,) B, kg m².
        shaped_inertia: (n,) B_s = β B, kg m².
        motor_damping: (n,) D_θ, embedded and not delayed, Nms/rad.
        spring_damping: (n,) D_s beside the spring (the paper's Remark 1), Nms/rad.
        coulomb_friction: (n,) at the motor, Nm.
        viscous_friction: (n,) at the motor, Nms/rad.
        torque_limit: (n,) of the motor, Nm; inf for none.
        velocity_limit: (n,) of the motor, rad/s; inf for none.
        torque_bandwidth: (n,) of the motor's current loop, rad/s; inf for an ideal one.
    """

    joints: tuple[str, ...]
    spring_stiffness: Array
    rotor_inertia: Array
    shaped_inertia: Array
    motor_damping: Array
    spring_damping: Array
    coulomb_friction: Array
    viscous_friction: Array
    torque_limit: Array
    velocity_limit: Array
    torque_bandwidth: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def inertia_shaping(self) -> Array:
        """β = B_s / B, (n,)."""
        return self.shaped_inertia / self.rotor_inertia


def actuators(
    joints: Sequence[str],
    *,
    spring_stiffness: ArrayLike,
    rotor_inertia: ArrayLike,
    motor_damping: ArrayLike,
    inertia_shaping: ArrayLike = 1.0,
    spring_damping: ArrayLike = 0.0,
    coulomb_friction: ArrayLike = 0.0,
    viscous_friction: ArrayLike = 0.0,
    torque_limit: ArrayLike = np.inf,
    velocity_limit: ArrayLike = np.inf,
    torque_bandwidth: ArrayLike = np.inf,
) -> Actuators:
    """Build actuators from numbers that are the same for all joints, or one for each.

    Args:
        joints: names, in the robot's order.
        spring_stiffness: K, Nm/rad, positive.
        rotor_inertia: B, kg m², positive.
        motor_damping: D_θ, Nms/rad, positive.
        inertia_shaping: β = B_s / B, positive.
        spring_damping: D_s, Nms/rad.
        coulomb_friction: Nm.
        viscous_friction: Nms/rad.
        torque_limit: Nm, inf for none; a motor with 0 gives nothing.
        velocity_limit: rad/s, positive, inf for none.
        torque_bandwidth: rad/s, positive, inf for an ideal torque loop.

    Raises:
        InputError: a length is wrong, or a value is NaN, negative, or 0 where it must not be.
    """
    names = tuple(joints)

    def take(name: str, values: ArrayLike, *, positive: bool, finite: bool = True) -> Array:
        return joint_values(names, values, name=name, positive=positive, finite=finite)

    B = take("rotor_inertia", rotor_inertia, positive=True)
    beta = take("inertia_shaping", inertia_shaping, positive=True)
    return Actuators(
        joints=names,
        spring_stiffness=take("spring_stiffness", spring_stiffness, positive=True),
        rotor_inertia=B,
        shaped_inertia=beta * B,
        motor_damping=take("motor_damping", motor_damping, positive=True),
        spring_damping=take("spring_damping", spring_damping, positive=False),
        coulomb_friction=take("coulomb_friction", coulomb_friction, positive=False),
        viscous_friction=take("viscous_friction", viscous_friction, positive=False),
        torque_limit=take("torque_limit", torque_limit, positive=False, finite=False),
        velocity_limit=take("velocity_limit", velocity_limit, positive=True, finite=False),
        torque_bandwidth=take("torque_bandwidth", torque_bandwidth, positive=True, finite=False),
    )


def actuators_of(robot: Robot, **values: ArrayLike) -> Actuators:
    """Build a robot's actuators; limits and friction that are not given are those of its URDF.

    A speed limit of 0 in a URDF forbids every motion: it stands for one that is not known.

    Args:
        robot: the robot.
        values: as `actuators` takes them, one number for all joints or (n,). A NaN among
            torque_limit, velocity_limit or coulomb_friction stands for the URDF's value.

    Raises:
        InputError: as `actuators` raises it.
    """
    moving = np.where(robot.velocity_limit > 0.0, robot.velocity_limit, np.inf)
    for name, own in (
        ("torque_limit", robot.effort_limit),
        ("velocity_limit", moving),
        ("coulomb_friction", robot.friction),
    ):
        given = np.asarray(values.get(name, np.nan))
        if given.dtype.kind in "fiu" and given.shape in ((), own.shape):
            values[name] = np.where(np.isnan(given), own, given)
    return actuators(robot.joints, **values)  # pyright: ignore[reportCallIssue]


def joint_values(
    joints: Sequence[str], values: ArrayLike, *, name: str, positive: bool, finite: bool = True
) -> Array:
    """Return one number for each joint, checked.

    Args:
        joints: names.
        values: () or (n,).
        name: what messages call the quantity.
        positive: whether 0 is refused too.
        finite: whether infinity is refused.

    Raises:
        InputError: the length is wrong, or a value is NaN, infinite, negative or 0; the message
            names the joint.
    """
    given = np.asarray(values)
    if given.dtype.kind not in "fiu":
        raise InputError(f"{name} is {values!r}; one number, or one for each joint, is right.")
    array = given.astype(float)
    if array.ndim == 0:
        array = np.full(len(joints), float(array))
    if array.shape != (len(joints),):
        raise InputError(
            f"{name} has {array.size} values; one, or {len(joints)} (one for each joint) is right."
        )
    bad = np.isnan(array) | (array < 0.0) | (positive & (array == 0.0))
    if finite:
        bad |= np.isinf(array)
    if bad.any():
        at = int(bad.argmax())
        need = "positive" if positive else "0 or positive"
        raise InputError(f"{name} of joint {joints[at]} is {array[at]:g}; it must be {need}.")
    return np.array(array)


def motors_of(actuators: Actuators, joint_damping: ArrayLike = 0.0) -> "Motors":
    """Return springs, motors and drives as the motor kernels take them.

    Args:
        actuators: springs, motors and drives.
        joint_damping: (n,) or one number, of the links' side, Nms/rad.
    """
    from sealag.kernels.motor import Motors

    def own(values: ArrayLike) -> Array:
        return np.ascontiguousarray(np.broadcast_to(values, actuators.n), dtype=float).copy()

    return Motors(
        stiffness=own(actuators.spring_stiffness),
        spring_damping=own(actuators.spring_damping),
        inertia=own(actuators.rotor_inertia),
        ratio=own(actuators.rotor_inertia / actuators.shaped_inertia),
        damping=own(actuators.motor_damping),
        viscous=own(actuators.viscous_friction),
        coulomb=own(actuators.coulomb_friction),
        torque_limit=own(actuators.torque_limit),
        velocity_limit=own(actuators.velocity_limit),
        bandwidth=own(actuators.torque_bandwidth),
        bearing=own(joint_damping),
    )
