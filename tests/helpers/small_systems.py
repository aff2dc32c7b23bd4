"""Small systems built in Python: arms of one and two joints whose matrices can be written out."""

from pathlib import Path

import numpy as np

from sealag.actuation import Actuators
from sealag.delay import Constant, Delays, Link, RoundTrip
from sealag.design import System
from sealag.robot import load_robot
from sealag.whole_body import Law, Task

_LINK = (
    '<link name="link{i}"><inertial><origin xyz="{com} 0 0"/><mass value="{mass}"/><inertia '
    'ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="joint{i}" type="revolute"><parent link="{parent}"/><child link="link{i}"/>'
    '<origin xyz="{place} 0 0"/><axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="1000" '
    'velocity="1000"/><dynamics damping="{damping}" friction="0"/></joint>'
)


def arm(folder: Path, *, count=2, damping=(0.0, 0.0), length=0.5):
    """An arm in a vertical plane, its links along x at 0, of 2 kg and 1.3 kg."""
    parts = ['<robot name="arm"><link name="base"/>']
    for i in range(count):
        parent, place = ("base", 0.0) if i == 0 else (f"link{i - 1}", length)
        parts.append(_LINK.format(i=i, com=0.6 * length, mass=(2.0, 1.3)[i]))
        parts.append(_JOINT.format(i=i, parent=parent, place=place, damping=damping[i]))
    path = folder / "arm.urdf"
    path.write_text("".join(parts) + "</robot>")
    return load_robot(path, floating_base=False)


def joint_task(robot, stiffness):
    """A posture task of all joints."""
    return Task(name="joints", kind="posture", stiffness=stiffness, joints=robot.joints)


def constant_delays(up: float, down: float, embedded: float = 0.0, **more) -> Delays:
    """Constant delays of the central connection's ways, and of the embedded round trip, s."""
    way = lambda d: Link(delay=Constant(value=d))  # noqa: E731
    return Delays(
        central=RoundTrip(up=way(up), down=way(down)), embedded=Constant(value=embedded), **more
    )


def arm_system(folder: Path, *, law=None, posture=None, springs=None, count=2, **changes) -> System:
    """The arm with unequal springs and dampers; joint-space stiffness in Nm/rad by default."""
    robot = changes.pop("robot", None) or arm(folder, count=count)
    n = robot.n
    motors = {
        "spring_stiffness": np.array([300.0, 120.0])[:n],
        "rotor_inertia": np.array([0.1, 0.06])[:n],
        "motor_damping": np.array([12.0, 5.0])[:n],
        "inertia_shaping": 0.5,
        **(springs or {}),
    }
    law = law or Law(tasks=(joint_task(robot, 30.0),), stiffness_form="force")
    return System(
        robot=robot,
        actuators=Actuators.of(robot.joints, **motors),
        law=law,
        posture=np.array([0.3, -0.5])[:n] if posture is None else posture,
        delays=changes.pop("delays", constant_delays(0.002, 0.002)),
        **changes,
    )
