"""A robot of a Pinocchio model is the one of the URDF that the model was built from."""

import numpy as np
import pinocchio as pin
import pytest

from helpers.mimics import joint, link, robot
from helpers.robots import urdf_path
from sealag.errors import RobotError
from sealag.robot import load_robot

HUME = urdf_path("bundled:hume.urdf")
FREE = pin.JointModelFreeFlyer
ARM = robot(link("base"), link("a"), link("b"), joint("j", "base", "a", dynamics=(0.3, 0.2)),
            joint("k", "a", "b"))  # fmt: skip


@pytest.mark.parametrize("floating", [True, False])
def test_a_model_is_the_robot_of_its_urdf(floating):
    model = pin.buildModelFromUrdf(str(HUME), *([FREE()] if floating else []))
    theirs, ours = (
        load_robot(model, floating_base=floating),
        load_robot(HUME, floating_base=floating),
    )
    assert theirs.urdf_path is None
    assert theirs.reference_posture() is None
    assert theirs.joints == ours.joints
    q = ours.configuration(np.linspace(-0.4, 0.3, ours.n))
    np.testing.assert_array_equal(theirs.mass_matrix(q), ours.mass_matrix(q))
    np.testing.assert_array_equal(theirs.gravity(q), ours.gravity(q))
    for name in ("position_lower", "effort_limit", "velocity_limit", "damping", "friction"):
        np.testing.assert_array_equal(getattr(theirs, name), getattr(ours, name))


def test_the_base_is_the_free_joint_whatever_its_name():
    model = pin.buildModelFromUrdf(str(HUME), FREE(), "pelvis_free")
    floating = load_robot(model, floating_base=True)
    assert floating.nv == floating.n + 6
    assert list(model.names)[1] == "pelvis_free", "the model stays as it is"
    assert load_robot(model, floating_base=False).nv == floating.n
    with pytest.raises(RobotError, match=r"free base.*JointModelFreeFlyer"):
        load_robot(pin.buildModelFromUrdf(str(HUME)), floating_base=True)


def test_rotor_inertia_is_the_model_s_and_no_link_s():
    model = pin.buildModelFromXML(ARM)
    model.armature = np.array([0.2, 0.3])
    found = load_robot(model, floating_base=False)
    np.testing.assert_array_equal(found.rotor_inertia, [0.2, 0.3])
    np.testing.assert_array_equal(found.damping, [0.3, 0.0])
    np.testing.assert_array_equal(found.friction, [0.2, 0.0])
    model.armature = np.zeros(2)
    plain = load_robot(model, floating_base=False)
    q = np.array([0.2, 0.5])
    np.testing.assert_array_equal(found.mass_matrix(q), plain.mass_matrix(q))
    assert found.urdf_sha256 != plain.urdf_sha256


def test_what_cannot_be_is_refused():
    model = pin.buildModelFromXML(ARM)
    model.gravity.linear = np.array([0.0, 0.0, -1.62])
    with pytest.raises(RobotError, match="gravity"):
        load_robot(model, floating_base=False)
    screw = pin.Model()
    number = screw.addJoint(0, pin.JointModelHelicalUnaligned(np.array([0.0, 0.0, 1.0]), 0.1),
                            pin.SE3.Identity(), "screw")  # fmt: skip
    screw.appendBodyToJoint(number, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    with pytest.raises(RobotError, match="screw is a JointModelHelical"):
        load_robot(screw, floating_base=False)
    turning = pin.buildModelFromXML(ARM.replace('type="revolute"', 'type="continuous"', 1))
    with pytest.raises(RobotError, match="joint j"):
        load_robot(turning, floating_base=False)
    assert load_robot(turning, floating_base=False, actuated=["k"]).joints == ("k",)
    assert "j" in load_robot(turning, floating_base=False, skip_unusable=True).skipped


def test_a_mimicking_model_is_refused():
    text = ARM.replace("</robot>", "") + link("c") + joint("l", "b", "c", mimic=("k", 2, 0))
    model = pin.buildModelFromXML(f"{text}</robot>", mimic=True)
    with pytest.raises(RobotError, match="joint l is one of Pinocchio's mimic joints"):
        load_robot(model, floating_base=False)
