"""A system built in Python, without a file: what it answers, and what it refuses to be."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.small_systems import arm, arm_system, constant_delays, joint_task
from sealag.actuation import Actuators
from sealag.design import System, load
from sealag.errors import InputError, UnknownNameError
from sealag.robot import Contact, Motion, load_robot
from sealag.simulation import Outcome
from sealag.whole_body import Law, Measurement, StaticJoint, Task

HUME = load("bundled:hume")


@pytest.fixture
def system(tmp_path):
    """The arm with q̄(θ) fed back, whose loop rests in its posture."""
    robot = arm(tmp_path)
    law = Law(tasks=(joint_task(robot, 30.0),), signal=StaticJoint(), stiffness_form="force")
    return arm_system(tmp_path, robot=robot, law=law)


def test_it_answers_every_question_without_a_file(system):
    certificate = sealag.certify(system)
    assert certificate.answer.status == "certified"
    spaces, loop = system.spaces(), system.frozen()
    # gravity is fed back at q̄ too: F_θ = (F_q⁻¹ − K⁻¹)⁻¹ with F_q = K_x − ∂g/∂q
    F_q = 30.0 * np.eye(2) - system.robot.gravity_gradient(system.posture)
    series = np.linalg.inv(np.linalg.inv(F_q) - np.diag(1.0 / system.actuators.spring_stiffness))
    np.testing.assert_allclose(spaces.F_theta[0], series, rtol=1e-6, atol=1e-6)
    margin = loop.margin().delay
    assert certificate.answer.max_delay_s < margin
    assert certificate.answer.local_margin_s == pytest.approx(margin, rel=1e-9)
    assert system.local_margins().delay_s == pytest.approx(margin, rel=1e-9)
    assert certificate.question.delay_s == system.delays.d_1
    run = sealag.simulate(system, scenario="regulate", duration=0.05)
    assert run.outcome is Outcome.COMPLETED
    measured, out = Measurement.allocate(nq=2, nv=2, n=2), np.zeros(2)
    rest = system.rest()
    measured.q[:], measured.theta[:] = rest.q, rest.theta
    controller = system.controller()
    controller.reset(0.0, measured)
    controller.tick(0.0, measured, out)
    np.testing.assert_allclose(out, rest.tau_sea, atol=1e-9)
    assert (system.text, system.motion_file, system.files) == ("", None, (system.robot.urdf_path,))
    assert certificate.question.hashes["project"] == hashlib.sha256(b"").hexdigest()


def test_it_is_what_its_project_file_builds(tmp_path):
    """The same numbers, typed as TOML with units and as Python in SI."""
    own = arm_system(tmp_path, delays=constant_delays(0.004, 0.004, 0.002))
    (tmp_path / "arm.toml").write_text("""
[robot]
urdf = "arm.urdf"
base = "fixed"
[posture.joints]
joint0 = 0.3
joint1 = -0.5
[actuators.default]
inertia_shaping = 0.5
[actuators.joint.joint0]
spring_stiffness = 300.0
rotor_inertia = 0.1
motor_damping = 12.0
[actuators.joint.joint1]
spring_stiffness = 120.0
rotor_inertia = 0.06
motor_damping = 5.0
[controller]
feedback = "motor"
gravity = "feedback"
stiffness_form = "force"
[[tasks]]
name = "joints"
kind = "posture"
stiffness = 30.0
[delays]
central_round_trip = { kind = "constant", value_ms = 8.0 }
embedded_round_trip = { kind = "constant", value_ms = 2.0 }
""")
    read = load(tmp_path / "arm.toml")
    assert own.delays.d_1 == read.delays.d_1
    for name in ("A_0", "A_1", "A_e"):
        np.testing.assert_allclose(
            getattr(own.frozen(), name), getattr(read.frozen(), name), atol=1e-9
        )
    ours, theirs = sealag.certify(own).answer, sealag.certify(read).answer
    assert ours.max_delay_s == pytest.approx(theirs.max_delay_s, rel=1e-12)
    assert ours.local_margin_s == pytest.approx(theirs.local_margin_s, rel=1e-9)
    softer = replace(own, law=replace(own.law, tasks=(joint_task(own.robot, 20.0),)))
    assert sealag.certify(softer).answer.max_delay_s > 1.2 * ours.max_delay_s


def test_hume_in_fifteen_lines():
    robot = load_robot("bundled:hume.urdf", floating_base=True)
    drives = Actuators.of(
        robot.joints, spring_stiffness=1500.0, rotor_inertia=0.1, motor_damping=40.0,
        torque_limit=100.0,
    )  # fmt: skip
    tasks = (
        Task(name="com", kind="com", stiffness=100.0),
        Task(name="torso", kind="orientation", frame="torso", stiffness=50.0),
    )
    system = System(
        robot=robot,
        actuators=drives,
        law=Law(tasks=tasks, gravity="planned"),
        contacts=(Contact(frame="left_foot"), Contact(frame="right_foot")),
        posture=HUME.posture,
        delays=constant_delays(0.004, 0.004),
    )
    certificate = sealag.certify(system)
    assert 0.0 < certificate.answer.max_delay_s < np.inf
    assert certificate.answer.stable is False, "a biped on point feet is an inverted pendulum"


def test_a_motion_s_instants_have_loops_of_their_own(system):
    q = np.array([[0.3, -0.5], [1.2, 0.4]])
    motion = Motion(
        time=np.array([0.0, 1.0]), q=q, v=np.zeros((2, 2)), contact_sets=((),),
        contact_index=np.zeros(2, dtype=np.int64),
    )  # fmt: skip
    np.testing.assert_allclose(system.frozen(motion, 0).A_0, system.frozen().A_0, atol=1e-9)
    there = replace(system, posture=q[1])
    np.testing.assert_allclose(system.frozen(motion, 1).A_0, there.frozen().A_0, atol=1e-9)
    np.testing.assert_allclose(system.rest(motion, 1).q, q[1], atol=1e-9)
    np.testing.assert_allclose(system.in_posture(motion, 1).q, q[1])
    assert np.abs(system.frozen(motion, 1).A_0 - system.frozen().A_0).max() > 0.1
    np.testing.assert_allclose(system.spaces(motion).F_theta[1], there.spaces().F_theta[0])


def test_parts_that_do_not_fit_are_refused_in_a_sentence(tmp_path, system):
    robot = system.robot
    other = Actuators.of(
        ("elbow", "wrist"), spring_stiffness=300.0, rotor_inertia=0.1, motor_damping=10.0
    )
    with pytest.raises(InputError, match=r"elbow, wrist, the robot's joints are joint0, joint1"):
        replace(system, actuators=other)
    with pytest.raises(InputError, match=r"shape \(3,\); \(2,\) is right"):
        replace(system, posture=np.zeros(3))
    with pytest.raises(InputError, match="joint1"):
        replace(system, posture=np.array([0.0, 9.5]))
    with pytest.raises(InputError, match="not finite"):
        replace(system, posture=np.array([0.0, np.nan]))
    for wrong in (None, 0.01):
        with pytest.raises(InputError, match=f"delays is {wrong}; a Delays is needed"):
            replace(system, delays=wrong)
    with pytest.raises(InputError, match=r"contacts has foot; Contact\(frame=…\) is needed"):
        replace(HUME, contacts=("foot",))
    with pytest.raises(InputError, match="base is fixed"):
        replace(system, contacts=(Contact(frame="link1"),))
    with pytest.raises(UnknownNameError, match="nose"):
        replace(HUME, contacts=(Contact(frame="nose"),))
    nowhere = Task(name="t", kind="position", frame="nose", stiffness=1.0)
    with pytest.raises(UnknownNameError, match="nose"):
        replace(system, law=Law(tasks=(nowhere,)))
    wrong = joint_task(robot, [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="shape"):
        replace(system, law=Law(tasks=(wrong,)))
    replace(system, posture=np.array([0.0, 8.9]), law=Law(tasks=(joint_task(robot, [1.0, 2.0]),)))


def test_late_drives_are_named(tmp_path):
    late = constant_delays(0.002, 0.002, 0.004, delayed_torque_feedback=True)
    system = arm_system(tmp_path, delays=late)
    assert system.late_joints == ("joint0", "joint1")
    assert not system.ideal_drives
    loop = system.frozen()
    assert loop.embedded_delay == system.delays.torque_feedback_delay > 0.0
    assert np.abs(loop.A_e).max() > 0.0
    unshaped = arm_system(tmp_path, delays=late, springs={"inertia_shaping": [1.0, 0.5]})
    assert unshaped.late_joints == ("joint1",)
    at_once = arm_system(tmp_path)
    assert at_once.ideal_drives
    assert at_once.late_joints == ()
    assert not arm_system(tmp_path, springs={"torque_bandwidth": [np.inf, 100.0]}).ideal_drives
