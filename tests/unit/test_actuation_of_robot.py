"""Actuators of a robot: what the URDF states, what the user states, and what kernels get."""

import numpy as np
import pytest

from sealag.actuation import Actuators
from sealag.robot import load_robot

DRIVES = {"spring_stiffness": [300.0, 120.0], "rotor_inertia": [0.1, 0.06], "motor_damping": 5.0}
_LINK = (
    '<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="{effort}" velocity="{velocity}"/>'
    '<dynamics damping="{damping}" friction="{friction}"/></joint>'
)


@pytest.fixture
def robot(tmp_path):
    """Two joints with unlike limits and friction; the second one's speed limit is 0."""
    path = tmp_path / "r.urdf"
    path.write_text(
        '<robot name="r">'
        + "".join(_LINK.format(name=name) for name in ("base", "upper", "lower"))
        + _JOINT.format(name="a", parent="base", child="upper", effort=7, velocity=3,
                        damping=0.4, friction=0.2)
        + _JOINT.format(name="b", parent="upper", child="lower", effort=5, velocity=0,
                        damping=0.6, friction=0.1)
        + "</robot>"
    )  # fmt: skip
    return load_robot(path, floating_base=False)


def test_what_is_not_stated_is_the_urdf_s(robot):
    drives = Actuators.of_robot(robot, **DRIVES)
    np.testing.assert_array_equal(drives.torque_limit, [7.0, 5.0])
    np.testing.assert_array_equal(drives.velocity_limit, [3.0, np.inf])
    np.testing.assert_array_equal(drives.coulomb_friction, [0.2, 0.1])


def test_what_is_stated_stands_and_nan_leaves_it_to_the_urdf(robot):
    drives = Actuators.of_robot(
        robot, **DRIVES, torque_limit=[np.nan, 9.0], velocity_limit=2.0, coulomb_friction=0.0
    )
    np.testing.assert_array_equal(drives.torque_limit, [7.0, 9.0])
    np.testing.assert_array_equal(drives.velocity_limit, [2.0, 2.0])
    np.testing.assert_array_equal(drives.coulomb_friction, [0.0, 0.0])


def test_kernels_get_every_quantity_of_its_joint(robot):
    drives = Actuators.of_robot(
        robot, **DRIVES, inertia_shaping=[0.5, 2.0], viscous_friction=[0.3, 0.7],
        spring_damping=[0.01, 0.02], torque_bandwidth=[100.0, np.inf],
    )  # fmt: skip
    motors = drives.motors(robot.damping)
    for name, values in {
        "stiffness": [300.0, 120.0], "inertia": [0.1, 0.06], "ratio": [2.0, 0.5],
        "damping": [5.0, 5.0], "viscous": [0.3, 0.7], "coulomb": [0.2, 0.1],
        "spring_damping": [0.01, 0.02], "torque_limit": [7.0, 5.0],
        "velocity_limit": [3.0, np.inf], "bandwidth": [100.0, np.inf], "bearing": [0.4, 0.6],
    }.items():  # fmt: skip
        np.testing.assert_allclose(getattr(motors, name), values, err_msg=name)
    np.testing.assert_allclose(drives.shaped_inertia, [0.05, 0.12])
