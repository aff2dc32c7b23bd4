"""A starter file names the robot's own joints and feet, each once."""

import tomllib

import pytest

from sealag.design import starter_project
from sealag.robot import load_robot, resolve_urdf

ROBOTS = {
    "bundled:hume.urdf": {"left_foot", "right_foot"},
    "example-robot-data:anymal_b_simple_description/robots/anymal.urdf": {
        "LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT",
    },
    "example-robot-data:talos_data/robots/talos_reduced.urdf": {
        "left_sole_link", "right_sole_link",
    },
}  # fmt: skip


@pytest.mark.parametrize("urdf", ROBOTS)
def test_joints_and_feet_are_the_robot_s(urdf):
    path = resolve_urdf(urdf)
    data = tomllib.loads(starter_project(str(path), floating_base=True))
    robot = load_robot(path, floating_base=True)
    assert tuple(data["robot"]["actuated"]) == robot.joints
    assert set(data["posture"]["joints"]) == set(robot.joints)
    frames = [contact["frame"] for contact in data["contacts"]]
    assert sorted(frames) == sorted(ROBOTS[urdf])
    assert set(frames) <= set(robot.link_names()) <= set(robot.frame_names())


def test_a_fixed_robot_has_no_base_and_no_feet():
    data = tomllib.loads(starter_project(str(resolve_urdf("bundled:hume.urdf"))))
    assert data["robot"]["base"] == "fixed"
    assert "contacts" not in data
    assert "base_position" not in data["posture"]
