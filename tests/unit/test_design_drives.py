"""Published drives: reflected inertias computed anew from rotors and gears, by hand."""

import tomllib

import pytest

from helpers.robots import urdf_path
from sealag.design import starter_project

G1 = "example-robot-data:g1_description/urdf/g1_29dof_rev_1_0.urdf"
HANDS = "example-robot-data:g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf"
GO1 = "example-robot-data:go1_description/urdf/go1.urdf"
GO2 = "example-robot-data:go2_description/urdf/go2.urdf"


def planetary(rotor, first, second, *, carrier, ring):
    """Two stages: the rotor turns first * second times, the first carrier second times."""
    return rotor * (first * second) ** 2 + carrier * second**2 + ring


SMALL = planetary(0.139e-4, 1 + 46 / 18, 1 + 56 / 16, carrier=0.017e-4, ring=0.169e-4)
HIP = planetary(0.489e-4, 4.5, 1 + 48 / 22, carrier=0.098e-4, ring=0.533e-4)
KNEE = planetary(0.489e-4, 4.5, 5.0, carrier=0.109e-4, ring=0.738e-4)
ROTOR = 0.000111842
KNOWN = {
    G1: {"left_elbow_joint": SMALL, "right_hip_pitch_joint": HIP, "waist_yaw_joint": HIP,
         "left_knee_joint": KNEE, "left_hip_roll_joint": KNEE, "left_ankle_roll_joint": 2 * SMALL,
         "waist_pitch_joint": 2 * SMALL, "right_wrist_yaw_joint": 0.068e-4 * 25.0**2},
    GO1: {"FL_hip_joint": ROTOR * 6.33**2, "RR_calf_joint": ROTOR * (6.33 * 35.55 / 23.7) ** 2},
    GO2: {"FL_thigh_joint": ROTOR * 6.33**2, "RR_calf_joint": ROTOR * (6.33 * 45.43 / 23.7) ** 2},
}  # fmt: skip


def starter(urdf):
    """A starter's data, and what was told."""
    told = []
    text = starter_project(urdf_path(urdf), tell=told.append)
    return text, tomllib.loads(text)["actuators"], told


@pytest.mark.parametrize("urdf", KNOWN)
def test_known_drives_are_reflected_rotors_and_gears(urdf):
    text, actuators, told = starter(urdf)
    for joint, inertia in KNOWN[urdf].items():
        assert actuators["joint"][joint]["rotor_inertia"] == pytest.approx(inertia, rel=2e-3)
    assert "FILL: B" not in text
    assert any(sentence.startswith("drives: rotor_inertia") for sentence in told)
    assert "# Published: " in text


def test_joints_that_are_not_published_are_still_asked_for():
    """Fingers of a G1."""
    text, actuators, _ = starter(HANDS)
    assert "FILL: B" in text
    assert "left_hand_thumb_0_joint" not in actuators["joint"]
    assert "left_knee_joint" in actuators["joint"]


def test_another_robot_s_drives_are_not_taken():
    _, actuators, told = starter("bundled:hume.urdf")
    assert "joint" not in actuators
    assert not any(sentence.startswith("drives") for sentence in told)
