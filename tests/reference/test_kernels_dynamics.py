"""Terms of robots against Pinocchio, which computes them in the bodies' own axes."""

import numpy as np
import pinocchio as pin
import pytest

from sealag.kernels import dynamics, keep
from sealag.robot import load_robot

ROBOTS = (
    "bundled:hume.urdf",
    "example-robot-data:talos_data/robots/talos_reduced.urdf",
    "example-robot-data:anymal_b_simple_description/robots/anymal.urdf",
)
SLIDER = """<robot name="slider">
<link name="base"><inertial><mass value="2"/><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/>
<inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0.01" ixz="0" iyz="0.02"/></inertial></link>
<link name="cart"><inertial><mass value="1"/><origin xyz="0 0.1 0"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="bob"><inertial><mass value="0.5"/><origin xyz="0 0 -0.4"/>
<inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/>
<origin xyz="0.3 0 0" rpy="0.2 0.4 -0.1"/><axis xyz="1 2 -1"/>
<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>
<joint name="swing" type="revolute"><parent link="cart"/><child link="bob"/>
<origin xyz="0 0.2 0.1"/><axis xyz="0.3 1 0.2"/>
<limit lower="-1" upper="1" effort="9" velocity="9"/></joint></robot>"""


@pytest.fixture(params=[*ROBOTS, "slider"])
def urdf(request, tmp_path):
    """A robot's file."""
    if request.param != "slider":
        return request.param
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER)
    return str(path)


@pytest.fixture(params=[True, False], ids=["floating", "fixed"])
def instant(urdf, request):
    """A robot somewhere far from the origin, moving; our terms and Pinocchio's."""
    robot, rng = load_robot(urdf, floating_base=request.param), np.random.default_rng(2)
    model = robot._model
    q = pin.randomConfiguration(model, np.full(model.nq, -1.0), np.full(model.nq, 1.0))
    if request.param:
        q[:3] += 50.0
    v, data, terms = rng.normal(size=model.nv), model.createData(), dynamics.allocate(robot.tree)
    kept = keep(dynamics.Model(robot.tree, terms))
    for _ in range(2):  # nothing is left from the first time
        dynamics.evaluate(kept, q, v)
    pin.computeAllTerms(model, data, q, v)
    return robot, q, v, terms, data


def close(ours, theirs):
    scale = max(1.0, float(np.abs(theirs).max(initial=0.0)))
    np.testing.assert_allclose(ours, theirs, atol=1e-13 * scale)


def test_terms_are_pinocchio_s(instant):
    robot, q, v, terms, data = instant
    close(terms.M, data.M)
    close(terms.nle, data.nle)
    close(terms.rotation, [place.rotation for place in data.oMi])
    close(terms.position, [place.translation for place in data.oMi])
    close(terms.com, data.com[0])
    close(terms.com_velocity, data.vcom[0])
    close(terms.com_jacobian, data.Jcom)
    close(terms.momentum, data.hg.vector)
    close(terms.energy, [data.kinetic_energy, data.potential_energy])
    pin.forwardKinematics(robot._model, data, q, v, np.zeros_like(v))
    pin.centerOfMass(robot._model, data, pin.KinematicLevel.ACCELERATION)
    close(terms.com_drift, data.acom[0])


def test_frames_are_pinocchio_s(instant):
    """Jacobian, place and J̇ v of every frame, from the joints' terms alone."""
    robot, q, v, terms, data = instant
    model, names, nv = robot._model, robot.frame_names(), robot.nv
    ours = dynamics.allocate_frames(len(names), nv)
    for array in ours:
        array[:] = np.nan
    dynamics.frames(keep(dynamics.Placed(terms, robot.frame_mounts(names), ours)))
    pin.updateFramePlacements(model, data)
    pin.forwardKinematics(model, data, q, v, np.zeros_like(v))
    pin.computeJointJacobians(model, data, q)
    at = robot.workspace()
    at.update(q, v)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for f, name in enumerate(names):
        number = model.getFrameId(name)
        close(ours.J[f], pin.getFrameJacobian(model, data, number, world))
        close(ours.R[f], data.oMf[number].rotation)
        close(ours.p[f], data.oMf[number].translation)
        close(ours.drift[f], pin.getFrameClassicalAcceleration(model, data, number, world).vector)
        close(at.frame_velocity(name), pin.getFrameVelocity(model, data, number, world).vector)
        close(at.frame_jacobian(name), ours.J[f])


def test_gravity_torque_is_pinocchio_s(instant):
    robot, q, v, _, data = instant
    at = robot.workspace()
    at.update(q, v)
    close(at.gravity(), pin.computeGeneralizedGravity(robot._model, data, q))


def test_gravity_gradient_is_pinocchio_s(instant):
    """Among the base's own directions its symmetric part."""
    robot, q, _, terms, data = instant
    H = np.full((robot.nv, robot.nv), np.nan)
    dynamics.gravity_gradient(keep(dynamics.Model(robot.tree, terms)), H)
    expected = pin.computeGeneralizedGravityDerivatives(robot._model, data, q)
    base = robot.nv_base
    expected[:base, :base] = 0.5 * (expected[:base, :base] + expected[:base, :base].T)
    close(H, expected)
    np.testing.assert_array_equal(H, H.T)


def plain_gravity_gradient(robot, q):
    """Differences of the gravity torque, by each coordinate."""
    step, columns = 1e-5, []
    for direction in np.eye(robot.nv):
        ahead = robot.gravity(robot.integrate(q, step * direction))
        back = robot.gravity(robot.integrate(q, -step * direction))
        columns.append((ahead - back) / (2.0 * step))
    H = np.array(columns).T
    base = robot.nv_base
    H[:base, :base] = 0.5 * (H[:base, :base] + H[:base, :base].T)
    return H


def test_gravity_gradient_is_that_of_its_plain_twin(instant):
    robot, q, _, _, _ = instant
    twin = plain_gravity_gradient(robot, q)
    np.testing.assert_allclose(
        robot.gravity_gradient(q), twin, atol=1e-7 * max(1.0, np.abs(twin).max())
    )
    elsewhere = robot.integrate(q, 0.1 * np.ones(robot.nv))
    assert np.abs(robot.gravity_gradient(elsewhere) - twin).max() > 1e-3  # negative control
