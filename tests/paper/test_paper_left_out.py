"""C(q) against Pinocchio's own rotors, slow models, F_c, and the time that is left."""

import re
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

from humanoids2016 import (
    CoupledRotors,
    Progress,
    held_legs,
    live_leg,
    planned_walk,
    reference_rows,
    rotor_table,
    simulate_walk,
    slow_models,
    task_terms,
    torque_rate_rows,
    waits_for,
)
from sealag.design import load
from sealag.robot import load_robot

HUME = load("bundled:hume")
RATIO = 20.0


def with_rotors(folder, robot, drives):
    """Hume with a rotor as a body of its own on the link before each joint, as Pinocchio sees it.

    Its spin inertia is B/r² about the joint's axis, and nothing else but a weight of nothing.
    """
    tree = ElementTree.parse(robot.urdf_path)
    root = tree.getroot()
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    for name, inertia in zip(robot.joints, drives.rotor_inertia.tolist()):
        axis = np.abs(np.array(joints[name].find("axis").get("xyz").split(), dtype=float))
        spin = inertia / RATIO**2 * axis
        link = ElementTree.SubElement(root, "link", name=f"rotor_{name}")
        body = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(body, "mass", value="1e-12")
        ElementTree.SubElement(
            body, "inertia", ixx=str(spin[0]), iyy=str(spin[1]), izz=str(spin[2]),
            ixy="0", ixz="0", iyz="0",
        )  # fmt: skip
        joint = ElementTree.SubElement(root, "joint", name=f"spin_{name}", type="continuous")
        ElementTree.SubElement(joint, "parent", link=joints[name].find("parent").get("link"))
        ElementTree.SubElement(joint, "child", link=f"rotor_{name}")
        place = joints[name].find("origin")
        ElementTree.SubElement(joint, "origin", **place.attrib)
        ElementTree.SubElement(joint, "axis", xyz=joints[name].find("axis").get("xyz"))
    path = folder / "rotors.urdf"
    tree.write(path)
    return pin.buildModelFromUrdf(str(path))


def test_c_and_its_velocity_terms_are_those_of_rotors_that_are_bodies(tmp_path):
    robot = load_robot(HUME.robot.urdf_path, floating_base=False, actuated=HUME.robot.joints)
    drives, n = HUME.actuators, robot.n
    model = with_rotors(tmp_path, robot, drives)
    plain = pin.buildModelFromUrdf(str(robot.urdf_path))
    rng = np.random.default_rng(4)
    q, v, theta_dot = (rng.normal(size=n) for _ in range(3))

    def places(of, names):
        return [of.joints[of.getJointId(name)].idx_v for name in names]

    at, spins = places(model, robot.joints), places(model, [f"spin_{j}" for j in robot.joints])
    big_q, big_v = pin.neutral(model), np.zeros(model.nv)
    for joint, value in zip(robot.joints, q):
        big_q[model.joints[model.getJointId(joint)].idx_q] = value
    big_v[at], big_v[spins] = v, RATIO * theta_dot
    M = pin.crba(model, model.createData(), big_q)
    plant = CoupledRotors(robot, drives, RATIO)
    C, gyro, drift = plant.coupling(q, v)
    scale = RATIO  # θ = spin angle / r
    np.testing.assert_allclose(C, scale * M[np.ix_(at, spins)], atol=1e-12)
    assert np.abs(C).max() > 1e-4
    forces = pin.nle(model, model.createData(), big_q, big_v)
    big_v[spins] = 0.0
    still = pin.nle(model, model.createData(), big_q, big_v)
    np.testing.assert_allclose(gyro @ theta_dot, (forces - still)[at], atol=1e-9)
    np.testing.assert_allclose(drift, scale * still[spins], atol=1e-9)
    assert np.abs(gyro @ theta_dot).max() > 1e-5
    assert plain.nv == n


@pytest.fixture(scope="module")
def walked():
    motion = planned_walk(HUME, rate=50.0)
    return motion, simulate_walk(HUME), live_leg(HUME, motion)


def test_without_c_the_second_plant_is_the_simulator_s(walked):
    _, walk, live = walked
    table = rotor_table(HUME, walk, live, ratios=(20.0,), swing_time=0.2)
    assert table.reference_rad < 1e-6
    (row,) = table.rows
    assert row.swing_rad > 10.0 * table.reference_rad  # and with C it is another one
    assert 0.0 < row.coupling < 0.2
    assert 0.0 < row.motor < row.link < 0.2
    assert abs(row.margin_change) < 1e-3


def test_a_slow_model_costs_symmetry_in_proportion_to_its_period(walked):
    motion, _, _ = walked
    fresh, slow, slower = slow_models(HUME, motion, periods=(0.0, 0.04, 0.2))
    assert fresh.asymmetry < 1e-12
    assert fresh.away_rad == 0.0
    assert 1e-3 < slow.asymmetry < slower.asymmetry
    assert slow.away_rad < slower.away_rad
    assert slow.bound_s == pytest.approx(fresh.bound_s, rel=0.02)
    assert slower.unstable <= slower.stale
    assert slower.unstable > 0 == fresh.unstable
    assert held_legs(HUME).robot.nv == 6


def test_the_plant_answers_f_c_as_ten_says(walked):
    _, walk, _ = walked
    terms = task_terms(HUME, walk)
    assert terms.residual < 1e-9
    assert terms.push_n == pytest.approx(60.0, rel=1e-6)
    assert 0.0 < terms.mu_n < terms.feedback_n


def test_a_reference_of_q_bar_is_feedback(walked):
    _, _, live = walked
    rows = {row.name: row for row in reference_rows(live)}
    plain = rows["x_d(t)"]
    assert plain.asymmetry < 1e-12
    assert plain.least > 0.0
    assert rows["CoM height on a plane of slope 0.3"].asymmetry > 1e-3
    left = rows["CoM x, y left to the pendulum"]
    assert left.bound_s > plain.bound_s  # less stiffness, more delay


def test_torque_rate_feedback_makes_the_damping_symmetric_again(walked):
    _, _, live = walked
    none, some = torque_rate_rows(live, damping=(0.0, 4.0))
    assert none.without_s == none.with_s == pytest.approx(reference_rows(live)[0].margin_s)
    assert none.asymmetry == 0.0 < some.asymmetry
    assert some.without_s != pytest.approx(some.with_s, rel=1e-4)


def test_time_left_follows_what_the_stages_took():
    now, said = [0.0], []
    stages = {"a": 10.0, "b": 10.0, "c": 100.0}
    progress = Progress(stages, said.append, clock=lambda: now[0], others=lambda: "")
    progress.begin("a")
    assert said[-1] == "[1/3] a; about 2 min left"
    now[0] = 30.0  # three times as slow as an idle machine, on little evidence
    progress.begin("b")
    assert said[-1] == "[2/3] b; about 3 min left"
    now[0] = 300.0
    progress.begin("c")
    assert said[-1] == "[3/3] c; about 13 min left"
    busy = Progress(stages, said.append, clock=lambda: now[0], others=lambda: "blender (load 5)")
    busy.begin("a")
    assert said[-1] == "[1/3] a; about 2 min left; waits for blender (load 5)"


def test_what_it_waits_for_is_named_under_load_only(monkeypatch):
    monkeypatch.setattr("os.getloadavg", lambda: (0.5, 0.5, 0.5), raising=False)
    assert waits_for() == ""
    monkeypatch.setattr("os.getloadavg", lambda: (99.0, 0.5, 0.5), raising=False)
    assert re.search(r"\(load 99\.0 on \d+ processors\)$", waits_for())
