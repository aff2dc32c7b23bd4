"""Robots read from URDF against MuJoCo's own reading of the same file."""

import re
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.design import load
from sealag.robot import load_robot

SEED = 11
PROJECTS = [
    "bundled:hume",
    EXAMPLES / "anymal.toml",
    EXAMPLES / "talos.toml",
    EXAMPLES / "baxter.toml",
]


def in_mujoco(robot):
    """The same URDF without pictures, a free joint on its root, other joints left out."""
    tree = ElementTree.parse(robot.urdf_path)
    root = tree.getroot()
    for link in root.iter("link"):
        for tag in ("visual", "collision"):
            for picture in link.findall(tag):
                link.remove(picture)
        for inertia in link.iter("inertia"):  # MuJoCo refuses ANYmal's placeholder of 1e-6
            if inertia.get("ixx") == inertia.get("ixy"):
                inertia.attrib.update(ixy="0", ixz="0", iyz="0")
    for joint in root.iter("joint"):
        if joint.get("type") != "fixed" and joint.get("name") not in robot.joints:
            joint.set("type", "fixed")
        for tag in ("mimic", "safety_controller", "dynamics"):
            for part in joint.findall(tag):
                joint.remove(part)
    keep = (
        '<mujoco><compiler fusestatic="false" discardvisual="true" balanceinertia="true"/></mujoco>'
    )
    root.insert(0, ElementTree.fromstring(keep))
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    if robot.floating_base:
        spec.worldbody.first_body().add_freejoint()
    return spec.compile()


@pytest.fixture(scope="module", params=PROJECTS)
def pair(request):
    robot = load(request.param).robot
    return robot, in_mujoco(robot)


def state(robot, model, rng):
    """One random state in both conventions, and the map of velocities from ours to MuJoCo's."""
    n, base = robot.n, robot.nv_base
    q = robot.integrate(robot.neutral(), rng.normal(size=robot.nv) * 0.4)
    v = rng.normal(size=robot.nv)
    data = mujoco.MjData(model)
    order = [model.joint(name) for name in robot.joints]
    T = np.zeros((model.nv, robot.nv))
    if base:
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, q[[6, 3, 4, 5]])
        data.qpos[:3], data.qpos[3:7] = q[:3], q[[6, 3, 4, 5]]
        T[:3, :3], T[3:6, 3:6] = rotation.reshape(3, 3), np.eye(3)
    for k, joint in enumerate(order):
        data.qpos[joint.qposadr[0]] = q[q.size - n + k]
        T[joint.dofadr[0], base + k] = 1.0
    data.qvel[:] = T @ v
    return q, v, data, T


def moving(model, data):
    """Mass and centre of everything that moves."""
    bodies = np.flatnonzero(model.body_weldid > 0)
    mass = model.body_mass[bodies]
    return mass.sum(), mass @ data.xipos[bodies] / mass.sum()


def test_mass_matrix_gravity_and_centre_of_mass(pair):
    robot, model = pair
    rng = np.random.default_rng(SEED)
    assert model.nv == robot.nv
    for _ in range(5):
        q, _, data, T = state(robot, model, rng)
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        ours = robot.mass_matrix(q)
        np.testing.assert_allclose(T.T @ M @ T, ours, atol=1e-7 * np.abs(ours).max())
        gravity = robot.gravity(q)
        size = 1e-7 * max(np.abs(gravity).max(), 1.0)
        np.testing.assert_allclose(T.T @ data.qfrc_bias, gravity, atol=size)
        mass, center = moving(model, data)
        assert robot.mass == pytest.approx(mass, rel=1e-9)
        np.testing.assert_allclose(center, robot.center_of_mass(q), atol=1e-9)
        wrong = robot.mass_matrix(robot.integrate(q, 0.05 * np.ones(robot.nv)))
        assert np.abs(T.T @ M @ T - wrong).max() > 1e-5 * np.abs(ours).max()  # negative control


def test_frames_and_their_velocities(pair):
    robot, model = pair
    rng = np.random.default_rng(SEED)
    names = {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, b) for b in range(1, model.nbody)}
    frames = sorted(names & set(robot.frame_names()))[:8]
    assert len(frames) >= 5
    q, v, data, _ = state(robot, model, rng)
    mujoco.mj_forward(model, data)
    for frame in frames:
        body = model.body(frame).id
        rotation, place = robot.frame_placement(frame, q)
        np.testing.assert_allclose(data.xpos[body], place, atol=1e-9)
        np.testing.assert_allclose(data.xmat[body].reshape(3, 3), rotation, atol=1e-9)
        J = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, J, None, data.xpos[body], body)
        speed = robot.frame_jacobian(frame, q)[:3] @ v
        np.testing.assert_allclose(J @ data.qvel, speed, atol=1e-9)


def test_a_changed_urdf_is_another_robot(tmp_path):
    """Negative control: a shank that is a tenth heavier is seen."""
    robot = load("bundled:hume").robot
    text = robot.urdf_path.read_text()
    number = re.search(r'<mass value="3(\.0)?"', text)
    assert number is not None
    (tmp_path / "h.urdf").write_text(text.replace(number.group(0), '<mass value="3.3"', 1))
    heavier = load_robot(tmp_path / "h.urdf", floating_base=True)
    model = in_mujoco(robot)
    assert model.body_subtreemass[0] == pytest.approx(heavier.mass - 0.3, rel=1e-9)
