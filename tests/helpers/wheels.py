"""A base with four equal wheels, as a Pioneer has them: slow joints that do not feel each other."""

from pathlib import Path

import numpy as np

import sealag
from sealag.design import System

_PLACES = ((0.13, 0.2), (-0.13, 0.2), (0.13, -0.2), (-0.13, -0.2))


def four_wheels(
    folder: Path, *, stiffness: float, damping: float, inertia: float = 1e-4, shaping: float = 0.5
) -> System:
    """Held by its base; each motor is pulled back by its own stiffness, Nm/rad."""
    body = '<inertial><mass value="{m}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501
    parts = [f'<robot name="wheels"><link name="base">{body.format(m=12, i=0.3)}</link>']
    for k, (x, y) in enumerate(_PLACES):
        parts.append(
            f'<link name="wheel{k}">{body.format(m=0.5, i=inertia)}</link>'
            f'<joint name="w{k}" type="continuous"><parent link="base"/><child link="wheel{k}"/>'
            f'<origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>'
        )
    path = folder / "wheels.urdf"
    path.write_text("".join(parts) + "</robot>", encoding="utf-8")
    robot = sealag.load_robot(path, floating_base=False)
    drives = sealag.Actuators.of_robot(
        robot, spring_stiffness=300.0, rotor_inertia=1e-3, inertia_shaping=shaping,
        motor_damping=damping,
    )  # fmt: skip
    rest = sealag.Task(name="rest", kind="posture", stiffness=np.full(4, stiffness))
    law = sealag.Law(
        tasks=(rest,),
        signal=sealag.MotorAngles(),
        gravity="planned",
        stiffness_form="force",
    )
    delays = sealag.Delays(central=sealag.Constant(0.01), embedded=sealag.Constant(0.001))
    return sealag.System(
        robot=robot,
        actuators=drives,
        law=law,
        posture=robot.configuration({}),
        delays=delays,
    )
