"""A design as a MuJoCo model: links, rotors, springs, late actuators and late sensors (MJCF)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from sealag.constants import GRAVITY
from sealag.design import System
from sealag.errors import InputError
from sealag.export._mujoco_delays import StepCounts
from sealag.robot import ContactKind
from sealag.typing import Array, ArrayLike
from sealag.whole_body import Rest

LONGEST_STEP = 1e-3
"""s; MuJoCo's integrators are of first order: a step ten times longer shows in every joint."""

STEPS_PER_RADIAN = 1.25
"""In the time 1/ω of the fastest spring. Semi-implicit integration is stable above 0.5: with a
tenth the springs diverge; ten times more costs ten times the steps."""

_NOTHING = 1e-14
"""kg, kg m²: mass and inertia of a rotor's body; the armature is the rest of its inertia. MuJoCo
refuses less than 1e-15; the smallest rotor of a project has 1e-13."""

_ABOUT = """
Written by sealag export, for MuJoCo 3.5 or newer. Each joint has a rotor and a spring; the loop
rests at the keyframe.
{delays}
Every step: mj_step1; where the steps so far are a multiple of {tick}, read sensordata, which
mj_step1 has made, and write ctrl; mj_step2. After a whole mj_step sensordata is a step older.
 - nsample is the delay in steps, not more: with more samples rounding of the time makes the delay
   jump between two steps. With fewer it is shorter.
 - Before the first command has arrived, ctrl is 0: fill the past with mj_initCtrlHistory.
 - Integrator RK4 lets part of a command act one step early; Euler and implicit ones do not.
 - ctrl is tau_osc; a rotor has the shaped inertia B_s and the embedded damping, which is not late.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MujocoModel:
    """A design in MuJoCo's words.

    Attributes:
        text: the MJCF file.
        steps: delays and control period in steps.
        left_out: what the design has and the file has not, a sentence each.
    """

    text: str
    steps: StepCounts
    left_out: tuple[str, ...]

    @classmethod
    def of(cls, system: System, *, step: float | None = None) -> Self:
        """Write a design's robot, drives and delays as a MuJoCo model.

        Rotors are joints of their own with armature B_s and damping D_θ + β b_v, springs are
        tendons K (θ − q) + D_s (θ̇ − q̇) between rotor and joint, Eqs. (6), (8); motors act on
        rotors. Motors are late by both ways down, sensors by the way up, the hold is the caller's
        (docs/theory section 15). Contacts are equalities where the posture has them, active as
        certificates assume. The keyframe is where the loop rests.

        Args:
            system: the design.
            step: MuJoCo's time step, s; the longest that divides delays and period and resolves the
                springs if None.

        Returns:
            The model. The program MuJoCo is not needed.

        Raises:
            InputError: a delay varies, packets are lost, a step divides a delay not or is too long,
                a drive has a bandwidth or late torque feedback, a joint mimics another, or a body
                has an inertia that MuJoCo refuses.
        """
        _require_representable(system)
        drives = system.actuators
        link_rate, _ = drives.fastest_link(system.robot, system.posture)
        motor_rate = np.sqrt((drives.spring_stiffness / drives.shaped_inertia).max())
        longest = min(
            LONGEST_STEP, 1.0 / (STEPS_PER_RADIAN * float(np.hypot(link_rate, motor_rate)))
        )
        steps = StepCounts.of(system.delays, longest=longest, step=step)
        rest = system.rest()
        file = Element("mujoco", model=system.name)
        file.append(ElementTree.Comment(_about(system, steps)))
        SubElement(
            file,
            "compiler",
            angle="radian",
            boundmass="0",
            boundinertia="0",
            balanceinertia="false",
        )
        SubElement(
            file, "option", timestep=repr(steps.step), integrator="implicitfast",
            gravity=_numbers([0.0, 0.0, -GRAVITY]),
        )  # fmt: skip
        world = SubElement(file, "worldbody")
        order = _links(system, world)
        _rotors(system, world)
        _springs(system, SubElement(file, "tendon"))
        if system.contacts:
            _contacts(system, world, SubElement(file, "equality"))
        late = _late(steps.command_delay, steps.command)
        motors = SubElement(file, "actuator")
        for name in drives.joints:
            SubElement(motors, "motor", {"name": name, "joint": _rotor(name), **late})
        late = _late(steps.measurement_delay, steps.measurement)
        _sensors(system, SubElement(file, "sensor"), late)
        SubElement(file, "keyframe").append(_key(system, order, rest))
        ElementTree.indent(file)
        text = ElementTree.tostring(file, encoding="unicode") + "\n"
        return cls(text=text, steps=steps, left_out=tuple(_left_out(system, rest.reason)))

    def summary(self) -> dict[str, Any]:
        """Return what the JSON answer holds, times in s."""
        steps = self.steps
        return {
            "timestep_s": steps.step,
            "measurement_delay_s": steps.measurement_delay,
            "measurement_steps": steps.measurement,
            "command_delay_s": steps.command_delay,
            "command_steps": steps.command,
            "hold_s": steps.hold,
            "hold_steps": steps.tick,
            "total_s": steps.total,
            "left_out": list(self.left_out),
        }


def _require_representable(system: System) -> None:
    """Refuse drives and joints that rotors, tendons and motors of MuJoCo are not."""
    robot, drives = system.robot, system.actuators
    slow = np.isfinite(drives.torque_bandwidth)
    if slow.any():
        raise InputError(
            f"Joint {_named(robot.joints, slow)} has a torque_bandwidth, which delays the embedded "
            "damping and torque feedback too; MuJoCo's motors have none of these inside: leave the "
            "key out."
        )
    if system.late_joints:
        raise InputError(
            f"The torque feedback of joint {system.late_joints[0]} is late "
            "(delays.delayed_torque_feedback); in MuJoCo it is part of the rotor's armature and "
            "cannot be: set inertia_shaping = 1, or the key to false."
        )
    if robot.followers:
        name, follower = next(iter(robot.followers.items()))
        raise InputError(
            f"Joint {name} mimics {follower.leader} exactly, MuJoCo couples joints by soft "
            f"constraints only; leave {follower.leader} out of robot.actuated."
        )
    for j in range(1, len(robot.tree.kind)):
        least, middle, largest = np.linalg.eigvalsh(robot.tree.inertia[j])
        if least < _NOTHING or robot.tree.mass[j] < _NOTHING or least + middle < largest:
            raise InputError(
                f"MuJoCo refuses the body behind joint {_joint_name(system, j)}: its mass is "
                f"{robot.tree.mass[j]:.3g} kg, its principal moments of inertia are {least:.3g}, "
                f"{middle:.3g} and {largest:.3g} kg m², where each must be positive and no more "
                "than the sum of the others; correct <inertial> in the URDF."
            )


def _named(names: Sequence[str], which: Array) -> str:
    return names[int(np.argmax(which))]


def _about(system: System, steps: StepCounts) -> str:
    """The comment at the head of the file, in which no name may stand: -- would end it."""
    delays = (
        f"Delays in steps: sensors {steps.measurement}, motors {steps.command}, hold "
        f"{steps.tick}; together {steps.total * 1e3:.9g} ms. The design counts d_1 = "
        f"{system.delays.d_1 * 1e3:.9g} ms."
    )
    return _ABOUT.format(delays=delays, tick=steps.tick)


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(value) for value in np.ravel(values).astype(float).tolist())


def _place(rotation: Array, position: Array) -> dict[str, str]:
    return {"pos": _numbers(position), "xyaxes": _numbers(rotation[:, :2].T)}


def _rotor(joint: str) -> str:
    return f"rotor of {joint}"


def _joint_name(system: System, j: int) -> str:
    """Name of a joint of the tree; the free one is "base", or longer if a joint has that name."""
    robot = system.robot
    if j == 1 and robot.floating_base:
        name = "base"
        while name in robot.joints:
            name = f"free {name}"
        return name
    return robot.joints[int(robot.tree.column[j]) - robot.nv_base]


def _links(system: System, world: Element) -> list[str]:
    """Write the bodies; return the joints' names in the order in which MuJoCo numbers them."""
    from sealag.kernels.dynamics import FREE, PRISMATIC

    robot, tree = system.robot, system.robot.tree
    mounts = robot.frame_mounts([contact.frame for contact in system.contacts])
    order: list[str] = []

    def write(j: int, parent: Element) -> None:
        name = _joint_name(system, j)
        at = _place(tree.rotation[j], tree.position[j])
        body = SubElement(parent, "body", {"name": name, **at})
        I = tree.inertia[j]
        SubElement(
            body, "inertial", mass=repr(float(tree.mass[j])), pos=_numbers(tree.lever[j]),
            fullinertia=_numbers([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]),
        )  # fmt: skip
        if tree.kind[j] == FREE:
            SubElement(body, "freejoint", name=name)
            SubElement(body, "site", name=name)
        else:
            order.append(name)
            SubElement(
                body, "joint", name=name, axis=_numbers(tree.axis[j]),
                type="slide" if tree.kind[j] == PRISMATIC else "hinge",
                damping=repr(float(robot.damping[robot.joint_index(name)])),
            )  # fmt: skip
        for f, contact in enumerate(system.contacts):
            if mounts.joint[f] == j:
                at = _place(mounts.rotation[f], mounts.position[f])
                SubElement(body, "site", {"name": f"contact {contact.frame}", **at})
        for child in np.flatnonzero(tree.parent == j):
            if child > j:
                write(int(child), body)

    for j in range(1, len(tree.kind)):
        if tree.parent[j] == 0:
            write(j, world)
    return order


def _rotors(system: System, world: Element) -> None:
    """Write a rotor for each joint, beside the robot; friction is the shaped motor's."""
    drives = system.actuators
    shaping = drives.inertia_shaping
    for i, name in enumerate(drives.joints):
        body = SubElement(world, "body", name=_rotor(name))
        nothing = repr(_NOTHING)
        SubElement(body, "inertial", pos="0 0 0", mass=nothing, diaginertia=" ".join([nothing] * 3))
        values = {
            "armature": drives.shaped_inertia[i] - _NOTHING,
            "damping": drives.motor_damping[i] + shaping[i] * drives.viscous_friction[i],
            "frictionloss": shaping[i] * drives.coulomb_friction[i],
        }
        text = {key: repr(float(value)) for key, value in values.items()}
        SubElement(body, "joint", {"name": _rotor(name), "axis": "0 0 1", **text})


def _springs(system: System, tendon: Element) -> None:
    drives = system.actuators
    for i, name in enumerate(drives.joints):
        spring = SubElement(
            tendon, "fixed", name=f"spring of {name}", springlength="0",
            stiffness=repr(float(drives.spring_stiffness[i])),
            damping=repr(float(drives.spring_damping[i])),
        )  # fmt: skip
        SubElement(spring, "joint", joint=_rotor(name), coef="1")
        SubElement(spring, "joint", joint=name, coef="-1")


def _contacts(system: System, world: Element, equality: Element) -> None:
    """Hold frames where the posture has them: points by connect, surfaces by weld."""
    for contact in system.contacts:
        rotation, position = system.robot.frame_placement(contact.frame, system.posture)
        anchor, site = f"ground {contact.frame}", f"contact {contact.frame}"
        SubElement(world, "site", {"name": anchor, **_place(rotation, position)})
        SubElement(
            equality, "connect" if contact.kind is ContactKind.POINT else "weld",
            name=site, site1=site, site2=anchor, solref="-2500 -100", solimp="0.9999 0.9999 0.001",
        )  # fmt: skip


def _late(delay: float, count: int) -> dict[str, str]:
    """Attributes of a delay: exactly as many samples as steps, so that reading is never between."""
    return {"delay": repr(delay), "nsample": str(count), "interp": "zoh"} if count else {}


def _sensors(system: System, sensor: Element, late: dict[str, str]) -> None:
    """Write what a central controller measures, all equally late."""
    robot = system.robot
    if robot.floating_base:
        base = _joint_name(system, 1)
        for kind in ("framepos", "framequat"):
            about = {"objtype": "xbody", "objname": base}
            SubElement(sensor, kind, {"name": f"{kind} of {base}", **about, **late})
        for kind in ("velocimeter", "gyro"):
            SubElement(sensor, kind, {"name": f"{kind} of {base}", "site": base, **late})
    for kind, named in (
        ("jointpos", robot.joints),
        ("jointvel", robot.joints),
        ("jointpos", [_rotor(name) for name in robot.joints]),
        ("jointvel", [_rotor(name) for name in robot.joints]),
    ):
        for name in named:
            SubElement(sensor, kind, {"name": f"{kind} of {name}", "joint": name, **late})


def _key(system: System, order: Sequence[str], rest: Rest) -> Element:
    """Return where the loop rests, as a keyframe; a quaternion begins with w."""
    robot, q = system.robot, rest.q
    base = [*q[:3], q[6], *q[3:6]] if robot.floating_base else []
    joints = robot.joint_positions(q)[[robot.joint_index(name) for name in order]]
    place = _numbers([*base, *joints, *rest.theta])
    return Element("key", name="rest", qpos=place, ctrl=_numbers(rest.tau_sea))


def _left_out(system: System, unbalanced: str) -> Iterable[str]:
    """What the design has and the file has not."""
    drives = system.actuators
    for what, values in (
        ("torque", drives.torque_limit),
        ("speed", drives.velocity_limit),
    ):
        if np.isfinite(values).any():
            yield f"{what} limits of the motors; certificates assume that they are not reached"
    if system.contacts:
        yield "ground and friction; contacts are held where the posture has them, both ways"
    if unbalanced:
        yield f"an equilibrium, so that the keyframe is no rest: {unbalanced}"
