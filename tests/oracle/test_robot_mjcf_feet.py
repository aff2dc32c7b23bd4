"""Legs of MJCF files that end in a geom, not in a body, stand there and not on their knees."""

import mujoco
import numpy as np
import pytest

from sealag.robot import load_robot

INERTIA = '<inertial pos="0 0 -0.1" mass="1" diaginertia="0.02 0.03 0.01"/>'
PLACES = {"FL": (0.3, 0.1), "FR": (0.3, -0.1), "RL": (-0.3, 0.1), "RR": (-0.3, -0.1)}


def dog(tip, *, default=""):
    """Four legs of a thigh and a calf of 0.3 m each; `tip` is in every calf, {} is its leg."""
    legs = "".join(
        f'<body name="{leg}_thigh" pos="{x} {y} 0"><joint name="{leg}_hip" axis="0 1 0" '
        f'range="-2 2"/>{INERTIA}<body name="{leg}_calf" pos="0 0 -0.3"><joint name="{leg}_knee" '
        f'axis="0 1 0" range="-2.5 -0.3"/>{INERTIA}{tip.replace("{}", leg)}</body></body>'
        for leg, (x, y) in PLACES.items()
    )
    return (
        f'<mujoco model="dog"><compiler angle="radian"/><default>{default}</default><worldbody>'
        '<body name="trunk" pos="0 0 1"><freejoint/>'
        '<inertial pos="0 0 0" mass="8" diaginertia="0.1 0.3 0.3"/>'
        f'<geom type="box" size="0.35 0.1 0.05" mass="0"/>{legs}</body></worldbody></mujoco>'
    )


def read(text, folder):
    path = folder / "dog.xml"
    path.write_text(text)
    return load_robot(path, floating_base=True)


FOOT = '<geom name="{}" class="foot" pos="0.01 0 -0.28"/>'
CLASS = '<default class="foot"><geom size="0.02" mass="0"/></default>'
SEEN = (
    '<geom name="{}_seen" type="sphere" size="0.01" mass="0" pos="0 0 -0.1" contype="0" '
    'conaffinity="0"/>'
)


def test_the_only_sphere_of_a_calf_is_its_foot(tmp_path):
    text = dog(SEEN + FOOT, default=CLASS)
    robot = read(text, tmp_path)
    feet = robot.feet()
    assert sorted(feet.frames) == sorted(PLACES)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    joints = dict(zip(robot.joints, np.linspace(-0.6, 0.5, robot.n), strict=True))
    for name, value in joints.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    for name in PLACES:
        _, position = robot.frame_placement(name, robot.configuration(joints))
        np.testing.assert_allclose(position, data.geom(name).xpos - data.qpos[:3], atol=1e-12)
    stance = robot.stance(feet.contacts)
    assert stance is not None
    assert 0.4 < stance.height < 0.57


def test_a_sphere_without_a_name_is_called_after_its_body(tmp_path):
    feet = read(dog('<geom size="0.02" mass="0" pos="0 0 -0.28"/>'), tmp_path).feet()
    assert sorted(feet.frames) == sorted(f"{leg}_calf_sphere" for leg in PLACES)


def test_a_sphere_takes_no_body_s_name(tmp_path):
    tip = '<geom name="{}_thigh" size="0.02" mass="0" pos="0 0 -0.28"/>'
    robot = read(dog(tip), tmp_path)
    assert {f"{leg}_thigh" for leg in PLACES} <= set(robot.link_names())
    assert sorted(robot.feet().frames) == sorted(f"{leg}_thigh_2" for leg in PLACES)


@pytest.mark.parametrize("geom", [
    'type="capsule" size="0.02" fromto="0 0 0 0 0 -0.28"',
    'type="capsule" size="0.02 0.14" pos="0 0 -0.14"',
    'type="cylinder" size="0.02 0.15" pos="0 0 -0.15"',
    'type="box" size="0.15 0.02 0.02" pos="0 0 -0.15" euler="0 1.5707963 0"',
    'size="0.02" pos="0 0 -0.28"/><geom mass="0" size="0.02" pos="0.05 0 -0.28"',
])  # fmt: skip
def test_legs_whose_tips_are_other_geoms_are_asked_for(geom, tmp_path):
    feet = read(dog(f'<geom mass="0" {geom}/>'), tmp_path).feet()
    assert feet.legs == 4
    assert feet.contacts == ()
    assert "at the tip of" in feet.reason
    assert "FL_calf" in feet.reason


def test_a_knee_that_no_shape_tells_from_a_foot_is_told(tmp_path):
    feet = read(dog(""), tmp_path).feet()
    assert "no shape says where" in feet.reason
    named = read(dog('<site name="{}_foot" pos="0 0 -0.3"/>'), tmp_path).feet()
    assert "no shape" not in named.reason
