"""Robots with mimic joints against Pinocchio's model of all joints, reduced by v_all = T v."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

from helpers.mimics import MIMICS, random_mimics
from helpers.robots import urdf_path
from sealag.robot import Contact, load_robot

SEED = 23
PANDA = "panda_description/urdf/panda.urdf"
TIAGO = "tiago_pro_description/robots/tiago_pro.urdf"


class Pair:
    """A robot, Pinocchio's model of the same file with all joints free, and a state of both."""

    def __init__(self, path, *, floating_base, mimics):
        self.robot = load_robot(path, floating_base=floating_base)
        free = (pin.JointModelFreeFlyer(),) if floating_base else ()
        self.model = model = pin.buildModelFromUrdf(str(path), *free)
        self.data, robot = model.createData(), self.robot
        assert set(robot.followers) == set(mimics)
        base = robot.nv_base
        self.T = np.zeros((model.nv, robot.nv))
        self.T[:base, :base] = np.eye(base)
        self.constant, self.follows = np.zeros(model.nq), np.zeros(model.nv, dtype=bool)
        for name in model.names[2 if floating_base else 1 :]:
            leader, multiplier, offset = mimics.get(name, (name, 1.0, 0.0))
            joint = model.joints[model.getJointId(name)]
            assert joint.nq == 1
            self.T[joint.idx_v, base + robot.joint_index(leader)] = multiplier
            self.constant[joint.idx_q] = offset
            self.follows[joint.idx_v] = name in mimics
        rng = np.random.default_rng(SEED)
        self.q = robot.integrate(robot.neutral(), rng.normal(size=robot.nv) * 0.6)
        self.v = rng.normal(size=robot.nv)
        pin.computeAllTerms(model, self.data, self.all(self.q), self.T @ self.v)
        self.at = robot.workspace()
        self.at.update(self.q, self.v)

    def all(self, q):
        base, n = self.robot.nq - self.robot.n, self.robot.n
        joints = self.T[self.robot.nv_base :, -n:] @ q[base:]
        return self.constant + np.concatenate([q[:base], joints])


OWN = {"slide": ("lead", -0.5, 0.1), "chain": ("lead", -1.5, 0.5), "beside": ("own", -2.0, 0.0)}


@pytest.fixture(params=["fixed", "floating", "panda", *range(20)])
def pair(request, tmp_path):
    """Robots of our own, a public one, and random trees by seed."""
    path = tmp_path / "mimics.urdf"
    if isinstance(request.param, int):
        rng = np.random.default_rng(SEED + request.param)
        text, mimics = random_mimics(rng)
        path.write_text(text)
        return Pair(path, floating_base=rng.random() < 0.5, mimics=mimics)
    if request.param == "panda":
        mimics = {"panda_finger_joint2": ("panda_finger_joint1", 1.0, 0.0)}
        return Pair(urdf_path(f"example-robot-data:{PANDA}"), floating_base=False, mimics=mimics)
    path.write_text(MIMICS)
    return Pair(path, floating_base=request.param == "floating", mimics=OWN)


def close(ours, theirs):
    scale = max(1.0, float(np.abs(theirs).max(initial=0.0)))
    np.testing.assert_allclose(ours, theirs, atol=1e-12 * scale)


def test_terms_are_those_of_all_joints_reduced(pair):
    at, data, T = pair.at, pair.data, pair.T
    close(at.M, T.T @ data.M @ T)
    close(at.nle, T.T @ data.nle)
    close(at.gravity(), T.T @ pin.computeGeneralizedGravity(pair.model, data, pair.all(pair.q)))
    close(at.com, data.com[0])
    close(at.com_velocity, data.vcom[0])
    close(at.com_jacobian(), data.Jcom @ T)
    close(at.momentum, data.hg.vector)
    close(at.centroidal_map() @ pair.v, data.hg.vector)
    close([at.kinetic_energy, at.potential_energy], [data.kinetic_energy, data.potential_energy])
    close(at.center_of_mass(pair.q), data.com[0])
    still = np.zeros(pair.model.nv)
    pin.forwardKinematics(pair.model, data, pair.all(pair.q), T @ pair.v, still)
    pin.centerOfMass(pair.model, data, pin.KinematicLevel.ACCELERATION)
    close(at.com_bias(), data.acom[0])


def test_uncoupled_joints_would_be_another_robot(pair):
    """Negative control: with the followers locked M is another one."""
    T = pair.T * ~pair.follows[:, None]
    assert not pair.follows.any() or np.abs(T.T @ pair.data.M @ T - pair.at.M).max() > 1e-3


def test_frames_move_through_all_their_joints(pair):
    model, data, world = pair.model, pair.data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    pin.forwardKinematics(model, data, pair.all(pair.q), pair.T @ pair.v, np.zeros(model.nv))
    pin.updateFramePlacements(model, data)
    for name in pair.robot.link_names():
        number = model.getFrameId(name, pin.FrameType.BODY)
        rotation, place = pair.at.frame_placement(name)
        close(rotation, data.oMf[number].rotation)
        close(place, data.oMf[number].translation)
        J = pin.getFrameJacobian(model, data, number, world)
        close(pair.at.frame_jacobian(name), J @ pair.T)
        close(pair.at.frame_velocity(name), J @ pair.T @ pair.v)
        bias = pin.getFrameClassicalAcceleration(model, data, number, world).vector
        close(pair.at.frame_bias(name), bias)


def test_gravity_gradient_is_that_of_all_joints_reduced(pair):
    whole = pin.computeGeneralizedGravityDerivatives(pair.model, pair.data, pair.all(pair.q))
    expected = pair.T.T @ whole @ pair.T
    base = pair.robot.nv_base
    expected[:base, :base] = 0.5 * (expected[:base, :base] + expected[:base, :base].T)
    close(pair.robot.gravity_gradient(pair.q), expected)


def test_configurations_are_the_leaders(pair):
    robot, step = pair.robot, 0.1 * pair.v
    there = robot.integrate(pair.q, step)
    close(pair.all(there), pin.integrate(pair.model, pair.all(pair.q), pair.T @ step))
    close(robot.difference(pair.q, there), step)
    assert len(pair.q) == robot.nq
    last = robot.link_names()[-1]
    J = robot.contact_jacobian([Contact(frame=last)], pair.q)
    moved = robot.frame_placement(last, robot.integrate(pair.q, 1e-6 * pair.v))[1]
    back = robot.frame_placement(last, robot.integrate(pair.q, -1e-6 * pair.v))[1]
    np.testing.assert_allclose((moved - back) / 2e-6, J @ pair.v, atol=1e-8)
    copy = pickle.loads(pickle.dumps(robot))
    close(copy.mass_matrix(pair.q), robot.mass_matrix(pair.q))


def test_panda_is_pinocchio_s_own_coupled_model():
    """Pinocchio couples followers that come after their leaders itself."""
    path = urdf_path(f"example-robot-data:{PANDA}")
    coupled = pin.buildModelFromUrdf(str(path), mimic=True)
    robot = load_robot(path, floating_base=False)
    q = np.linspace(-0.5, 0.6, robot.nq)
    assert coupled.nq == robot.nq
    close(robot.mass_matrix(q), pin.crba(coupled, coupled.createData(), q))
    close(robot.gravity(q), pin.computeGeneralizedGravity(coupled, coupled.createData(), q))


def test_followers_of_a_gripper_that_is_not_actuated_are_locked():
    path = urdf_path(f"example-robot-data:{TIAGO}")
    every = load_robot(path, floating_base=False)
    assert len(every.followers) == 10
    arm = [name for name in every.joints if "finger" not in name]
    robot = load_robot(path, floating_base=False, actuated=arm)
    assert robot.followers == {}
    q = robot.configuration(dict.fromkeys(arm[:4], 0.1))
    both = every.configuration(dict.fromkeys(arm[:4], 0.1))
    own = [every.joint_index(name) for name in robot.joints]
    close(robot.mass_matrix(q), every.mass_matrix(both)[np.ix_(own, own)])
