"""A starter file names the robot's own joints and feet, and a posture that it can stand in."""

import re
import tomllib

import numpy as np
import pytest
from pydantic import ValidationError

from helpers.robots import urdf_path
from sealag.design import load, starter_project
from sealag.errors import ProjectError
from sealag.robot import load_robot

ANYMAL = "example-robot-data:anymal_b_simple_description/robots/anymal.urdf"
TALOS = "example-robot-data:talos_data/robots/talos_reduced.urdf"
ROBOTS = {
    "bundled:hume.urdf": {"left_foot", "right_foot"},
    ANYMAL: {"LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"},
    TALOS: {"left_sole_link", "right_sole_link"},
}
ODD = """<robot name='a "robot"'>
<link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name='the "foot"\\&#10;'><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name='j"\\&#10;é' type="prismatic"><parent link="base"/><child link='the "foot"\\&#10;'/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""

PROJECT = type(load("bundled:hume").source.project)
"""The schema's class of a whole project."""


def filled(text):
    """The project as the schema reads it, every FILL replaced by 1."""
    parts = text.split('"FILL')
    whole = parts[0] + "".join("1.0" + part[part.index('"') + 1 :] for part in parts[1:])
    return PROJECT.model_validate(tomllib.loads(whole))


@pytest.mark.parametrize("urdf", ROBOTS)
def test_joints_and_feet_are_the_robot_s(urdf):
    path = urdf_path(urdf)
    data = tomllib.loads(starter_project(str(path), floating_base=True))
    robot = load_robot(path, floating_base=True)
    assert tuple(data["robot"]["actuated"]) == robot.joints
    assert set(data["posture"]["joints"]) == set(robot.joints)
    frames = [contact["frame"] for contact in data["contacts"]]
    assert sorted(frames) == sorted(ROBOTS[urdf])
    assert set(frames) <= set(robot.link_names()) <= set(robot.frame_names())


def test_a_fixed_robot_has_no_base_and_no_feet():
    path = str(urdf_path("bundled:hume.urdf"))
    data = tomllib.loads(starter_project(path, floating_base=False))
    assert data["robot"]["base"] == "fixed"
    assert "contacts" not in data
    assert "base_position" not in data["posture"]
    assert set(data["posture"]["joints"].values()) == {0}


@pytest.mark.parametrize(("urdf", "knee"), [(ANYMAL, "LF_KFE"), (TALOS, "leg_left_4_joint")])
def test_the_posture_is_the_maker_s_and_stands_on_the_ground(urdf, knee):
    path = urdf_path(urdf)
    posture = filled(starter_project(path, floating_base=True)).posture
    robot = load_robot(path, floating_base=True)
    assert abs(posture.joints[knee]) > 0.5
    q = robot.configuration(posture.joints, base_position=posture.base_position)
    heights = [robot.frame_placement(foot, q)[1][2] for foot in ROBOTS[urdf]]
    assert min(heights) == pytest.approx(0.0, abs=1e-4)
    assert max(heights) < 0.01
    straight = robot.configuration({}, base_position=posture.base_position)
    assert robot.frame_placement(next(iter(ROBOTS[urdf])), straight)[1][2] < -0.02


def test_without_a_named_posture_hume_stands_on_bent_knees():
    path = urdf_path("bundled:hume.urdf")
    text = starter_project(path)
    posture = filled(text).posture
    assert '"FILL: rad"' not in text
    assert text.count('"FILL') == 7
    assert posture.joints["left_knee"] > 0.5
    assert posture.joints["right_knee"] > 0.5
    robot = load_robot(path, floating_base=True)
    q = robot.configuration(posture.joints, base_position=posture.base_position)
    robot.require_within_limits(q)
    left, right = (robot.frame_placement(foot, q)[1] for foot in ("left_foot", "right_foot"))
    assert left[2] == pytest.approx(0.0, abs=2e-3)
    assert right[2] == pytest.approx(0.0, abs=2e-3)
    middle = (left + right)[:2] / 2.0
    assert robot.center_of_mass(q)[:2] == pytest.approx(middle, abs=2e-3)


@pytest.mark.parametrize("urdf", [
    "bundled:hume.urdf", ANYMAL,
    "example-robot-data:g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "example-robot-data:human_description/robots/human.urdf",
    "example-robot-data:laikago_description/urdf/laikago.urdf",
])  # fmt: skip
def test_a_filled_starter_loads_and_stands(urdf, tmp_path):
    path = tmp_path / "p.toml"
    text = starter_project(urdf)
    path.write_text(re.sub(r'"FILL[^"]*"', "1.0", text))
    system = load(path)
    assert len(system.contacts) >= 2
    assert system.warnings() == ()


def test_an_arm_is_held_and_a_flying_arm_is_asked_for():
    urdf, told = "example-robot-data:ur_description/urdf/ur5_robot.urdf", []
    data = tomllib.loads(starter_project(urdf, tell=told.append))
    assert data["robot"]["base"] == "fixed"
    assert "contacts" not in data
    assert told[0].startswith("base: fixed, because no two limbs reach the ground as legs do")
    assert "--base floating" in told[0]
    assert tomllib.loads(starter_project(urdf, floating_base=True))["robot"]["base"] == "floating"


def test_a_posture_outside_its_robot_s_limits_is_told():
    """The makers' half-sitting posture of a robot whose URDF mixes up its limits."""
    told = []
    urdf = "example-robot-data:simple_humanoid_description/urdf/simple_humanoid.urdf"
    starter_project(urdf, tell=told.append)
    assert "LLEG_HIP_P, LLEG_KNEE, LLEG_ANKLE_P, RLEG_ANKLE_P moved to the nearest limit" in told[1]


def test_a_frame_left_to_be_filled_in_is_named(tmp_path):
    path = tmp_path / "p.toml"
    text = re.sub(r'"FILL[^"]*"', "1.0", starter_project("bundled:hume.urdf"))
    path.write_text(text.replace('frame = "left_foot"', 'frame = "FILL: the link of a foot"', 1))
    with pytest.raises(ProjectError, match=r"still to be filled in: contacts.*frame"):
        load(path)


def test_soles_are_given_to_the_simulation():
    urdf = "example-robot-data:talos_data/robots/talos_full_v2_box.urdf"
    data = tomllib.loads(starter_project(urdf))
    assert {contact["kind"] for contact in data["contacts"]} == {"surface"}
    assert data["simulation"] == {"foot_half_length": 0.105, "foot_half_width": 0.065}


def test_commented_keys_are_the_schema_s_with_its_defaults():
    text = starter_project(urdf_path("bundled:hume.urdf"), floating_base=True)
    plain = filled(text)
    lines = [line.removeprefix("# ") if " = " in line or "[" in line else line
             for line in text.splitlines()]  # fmt: skip
    start = next(k for k, line in enumerate(lines) if line.startswith("# SI units"))
    given = filled("\n".join(lines[start:]))
    assert given.controller == plain.controller
    assert given.delays == plain.delays
    stated = {"physics_step_ms", "log_period_ms", "torsional_radius", "pushes"}
    assert given.simulation.model_dump(exclude=stated) == plain.simulation.model_dump(
        exclude=stated
    )
    assert set(given.simulation.model_fields_set) == set(type(given.simulation).model_fields)
    assert set(given.actuators.default.model_fields_set) == set(
        type(given.actuators.default).model_fields
    )
    assert set(given.controller.model_fields_set) == set(type(given.controller).model_fields)
    assert {"motion", "walking"} <= given.model_fields_set <= set(type(given).model_fields)
    with pytest.raises(ValidationError, match="frictoin"):
        filled("\n".join(lines[start:]).replace("\nfriction", "\nfrictoin", 1))


def test_odd_names_are_escaped(tmp_path):
    path = tmp_path / "odd.urdf"
    path.write_text(ODD, encoding="utf-8")
    data = tomllib.loads(starter_project(path, floating_base=True, named='a "b".urdf'))
    assert data["robot"]["urdf"] == 'a "b".urdf'
    assert data["robot"]["actuated"] == ['j"\\\né']
    assert list(data["posture"]["joints"]) == ['j"\\\né']
    assert [contact["frame"] for contact in data["contacts"]] == ['the "foot"\\\n']


def test_a_posture_of_another_robot_is_not_taken(tmp_path):
    anymal = urdf_path(ANYMAL)
    robot = load_robot(anymal, floating_base=True)
    found = robot.reference_posture()
    assert found is not None
    assert found.name.startswith("standing")
    assert np.isfinite(list(found.joints.values())).all()
    copy = tmp_path / "anymal.urdf"
    copy.write_bytes(anymal.read_bytes())
    (tmp_path / "other.srdf").write_bytes(found.file.read_bytes().replace(b"_KFE", b"_KNEE"))
    moved = load_robot(copy, floating_base=True).reference_posture()
    assert moved is not None
    assert moved.joints["LF_KFE"] == 0.0
    (tmp_path / "other.srdf").write_bytes(found.file.read_bytes().replace(b"LF_", b"X_").replace(
        b"RF_", b"Y_").replace(b"LH_", b"Z_"))  # fmt: skip
    assert load_robot(copy, floating_base=True).reference_posture() is None
