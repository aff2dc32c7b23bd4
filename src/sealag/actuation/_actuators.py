"""Series elastic actuators: springs, shaped motors, limits (Eqs. 5-8)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Required, Self, TypedDict, Unpack, cast

import numpy as np

from sealag.actuation._transparency import Transparency, locked_joints, most_damping
from sealag.errors import InputError, near
from sealag.robot import Robot
from sealag.typing import Array, ArrayLike

if TYPE_CHECKING:
    from sealag.kernels.motor import Motors


class DriveValues(TypedDict, total=False):
    """What describes drives: one number for all joints, or one for each.

    Attributes:
        spring_stiffness: K, Nm/rad, positive.
        rotor_inertia: B, kg m², positive.
        motor_damping: D_θ, Nms/rad, positive.
        inertia_shaping: β = B_s / B, positive; 1 if not given.
        spring_damping: D_s, Nms/rad; 0 if not given.
        coulomb_friction: Nm; 0 if not given.
        viscous_friction: Nms/rad; 0 if not given.
        torque_limit: Nm, none if not given; a motor with 0 gives nothing.
        velocity_limit: rad/s, positive; none if not given.
        torque_bandwidth: rad/s, positive; ideal if not given.
    """

    spring_stiffness: Required[ArrayLike]
    rotor_inertia: Required[ArrayLike]
    motor_damping: Required[ArrayLike]
    inertia_shaping: ArrayLike
    spring_damping: ArrayLike
    coulomb_friction: ArrayLike
    viscous_friction: ArrayLike
    torque_limit: ArrayLike
    velocity_limit: ArrayLike
    torque_bandwidth: ArrayLike


class _Range(NamedTuple):
    """Which values a quantity may take, and the one that it has if it is not given."""

    default: float | None
    positive: bool
    finite: bool


_RANGES: dict[str, _Range] = {
    "spring_stiffness": _Range(None, positive=True, finite=True),
    "rotor_inertia": _Range(None, positive=True, finite=True),
    "motor_damping": _Range(None, positive=True, finite=True),
    "inertia_shaping": _Range(1.0, positive=True, finite=True),
    "spring_damping": _Range(0.0, positive=False, finite=True),
    "coulomb_friction": _Range(0.0, positive=False, finite=True),
    "viscous_friction": _Range(0.0, positive=False, finite=True),
    "torque_limit": _Range(np.inf, positive=False, finite=False),
    "velocity_limit": _Range(np.inf, positive=True, finite=False),
    "torque_bandwidth": _Range(np.inf, positive=True, finite=False),
}


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

    @classmethod
    def of(cls, joints: Sequence[str], **values: Unpack[DriveValues]) -> Self:
        """Build actuators from numbers that are the same for all joints, or one for each.

        Args:
            joints: names, in the robot's order.
            values: spring_stiffness, rotor_inertia, motor_damping and what else `DriveValues`
                names.

        Raises:
            InputError: a length is wrong, one of these three is missing, or a value is NaN,
                negative, or 0 where it must not be.
            UnknownNameError: there is no such quantity.
        """
        names = tuple(joints)
        for name in values:
            if name not in _RANGES:
                raise near(name, _RANGES, what="quantity of a drive")
        taken = {}
        for name, allowed in _RANGES.items():
            given = values.get(name, allowed.default)
            if given is None:
                raise InputError(f"{name} is missing; give one number, or one for each joint.")
            taken[name] = _joint_values(names, given, name=name, allowed=allowed)
        shaping = taken.pop("inertia_shaping")
        return cls(joints=names, shaped_inertia=shaping * taken["rotor_inertia"], **taken)

    @classmethod
    def of_robot(cls, robot: Robot, **values: Unpack[DriveValues]) -> Self:
        """Build a robot's actuators; limits and friction that are not given are those of its URDF.

        A speed limit of 0 in a URDF forbids every motion: it stands for one that is not known.

        Args:
            robot: the robot.
            values: as `of` takes them. A NaN among torque_limit, velocity_limit or
                coulomb_friction stands for the URDF's value.

        Raises:
            InputError: as `of` raises it.
            UnknownNameError: there is no such quantity.
        """
        moving = np.where(robot.velocity_limit > 0.0, robot.velocity_limit, np.inf)
        filled = dict(values)
        for name, own in (
            ("torque_limit", robot.effort_limit),
            ("velocity_limit", moving),
            ("coulomb_friction", robot.friction),
        ):
            given = np.asarray(values.get(name, np.nan))
            if given.dtype.kind in "fiu" and given.shape in ((), own.shape):
                filled[name] = np.where(np.isnan(given), own, given)
        return cls.of(robot.joints, **cast(DriveValues, filled))

    def motors(self, joint_damping: ArrayLike = 0.0) -> "Motors":
        """Return springs, motors and drives as the motor kernels take them.

        Args:
            joint_damping: (n,) or one number, of the links' side, Nms/rad.
        """
        from sealag.kernels.motor import Motors

        def own(values: ArrayLike) -> Array:
            return np.ascontiguousarray(np.broadcast_to(values, self.n), dtype=float).copy()

        return Motors(
            stiffness=own(self.spring_stiffness),
            spring_damping=own(self.spring_damping),
            inertia=own(self.rotor_inertia),
            ratio=own(self.rotor_inertia / self.shaped_inertia),
            damping=own(self.motor_damping),
            viscous=own(self.viscous_friction),
            coulomb=own(self.coulomb_friction),
            torque_limit=own(self.torque_limit),
            velocity_limit=own(self.velocity_limit),
            bandwidth=own(self.torque_bandwidth),
            bearing=own(joint_damping),
        )

    def fastest_link(self, robot: Robot, q: Array) -> tuple[float, str]:
        """Return how fast the fastest link follows its spring and dampers, and its joint.

        The largest |λ| of M v̇ = -K δ - (D_s + joint damping) v with locked motors and feet in the
        air, 1/s: what decides how long a step may be.

        Args:
            robot: the robot.
            q: (nq,) configuration.
        """
        n = robot.n
        mobility = np.linalg.inv(robot.mass_matrix(q))[-n:, -n:]
        damping = self.spring_damping + robot.damping
        root = np.sqrt(self.spring_stiffness)
        O = np.zeros((n, n))
        # State (√K δ, v): without damping the matrix is as well scaled as its eigenvalues.
        A = np.block([[O, np.diag(root)], [-mobility * root, -mobility * damping]])
        values, modes = np.linalg.eig(A)
        fastest = int(np.abs(values).argmax())
        rate, mode = float(np.abs(values[fastest])), np.abs(modes[:, fastest]) ** 2
        taken = mode[:n] + damping * mode[n:] / rate  # energy that spring and dampers take
        return rate, robot.joints[int(taken.argmax())]

    def transparency(self, *, delay: float = 0.0) -> Transparency:
        """Return bandwidth, damping ratio and phase lag of the locked joints in closed form.

        Args:
            delay: feedforward delay d_2, s.
        """
        return locked_joints(
            self.spring_stiffness, self.shaped_inertia, self.motor_damping, delay=delay
        )

    def most_damping(self, bandwidth: float) -> Array:
        """Return the largest D_θ that leaves the locked joints a bandwidth, (n,) Nms/rad.

        NaN where the undamped joint is slower (docs/theory section 9).

        Args:
            bandwidth: Hz, positive.
        """
        return most_damping(self.spring_stiffness, self.shaped_inertia, bandwidth=bandwidth)


def _joint_values(joints: Sequence[str], values: ArrayLike, *, name: str, allowed: _Range) -> Array:
    """Return one number for each joint (n,), checked; messages name the joint."""
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
    bad = np.isnan(array) | (array < 0.0) | (allowed.positive & (array == 0.0))
    if allowed.finite:
        bad |= np.isinf(array)
    if bad.any():
        at = int(bad.argmax())
        need = "positive" if allowed.positive else "0 or positive"
        raise InputError(f"{name} of joint {joints[at]} is {array[at]:g}; it must be {need}.")
    return np.array(array)
