"""Gains under a limit of transparency: amplitudes on a grid, means by hand, programs anew."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm, arm_system, constant_delays, joint_task
from sealag.errors import InputError
from sealag.passivity import Status
from sealag.robot import Motion
from sealag.tune import tune
from sealag.whole_body import Law, MotorAngles, StaticJoint

K_X = np.array([[40.0, 12.0], [12.0, 25.0]])
OMEGA = 6.0


def two_joints(folder, signal=None):
    """An arm of two joints under a full joint stiffness."""
    robot = arm(folder)
    law = Law(
        tasks=(joint_task(robot, K_X),), stiffness_form="force", signal=signal or MotorAngles(),
        gravity="planned",
    )  # fmt: skip
    return arm_system(folder, robot=robot, law=law, posture=np.array([np.pi / 2, 0.0]))


def swing(count=37, turns=3, rest=False):
    """Whole turns of joints that swing with different amplitudes; the second may rest."""
    time = np.linspace(0.0, turns * 2.0 * np.pi / OMEGA, count)
    amplitude = np.array([0.2, 0.0 if rest else 0.3])
    q = np.array([np.pi / 2, 0.1]) + amplitude * np.sin(OMEGA * time)[:, None]
    v = amplitude * OMEGA * np.cos(OMEGA * time)[:, None]
    return Motion(
        time=time, q=q, v=v, contact_sets=((),), contact_index=np.zeros(count, dtype=np.int64)
    )


def amplitude(drives, frequency, damping):
    """|K / (B_s s² + D s + K)| of every joint at frequencies (F,) in Hz, (F, n)."""
    s = 2j * np.pi * np.atleast_1d(frequency)[:, None]
    K, B_s = drives.spring_stiffness, drives.shaped_inertia
    return np.abs(K / (B_s * s**2 + damping * s + K))


@pytest.mark.parametrize("signal", [MotorAngles(), StaticJoint()], ids=["motor", "static"])
@pytest.mark.parametrize("bandwidth", [0.5, 3.0, 9.0])
def test_every_amplitude_below_the_bandwidth_passes(tmp_path, signal, bandwidth):
    tuned = tune(two_joints(tmp_path, signal), limits={"bandwidth": bandwidth})
    drives = tuned.system.actuators
    D = drives.motor_damping
    below = np.linspace(1e-3, bandwidth, 2000)
    assert (amplitude(drives, below, D) >= np.sqrt(0.5)).all()
    assert (amplitude(drives, bandwidth, 1.001 * D) < np.sqrt(0.5)).all()
    assert tuned.found
    assert tuned.certificate.answer.status is Status.CERTIFIED


@pytest.mark.parametrize("bandwidth", [0.5, 3.0, 9.0])
def test_no_damping_within_the_limit_allows_more_stiffness(tmp_path, bandwidth):
    """Damping and factor chosen at once, by CVXPY."""
    system = two_joints(tmp_path)
    drives, d = system.actuators, system.delays.d_1
    s, D = cp.Variable(), cp.Variable(2)
    most = [
        max(x for x in np.geomspace(1e-1, 1e3, 20_001) if gain(x) >= np.sqrt(0.5))
        for gain in (lambda x, j=j: float(amplitude(drives, bandwidth, x)[0, j]) for j in range(2))
    ]
    problem = cp.Problem(cp.Maximize(s), [cp.diag(D) / d - s * K_X >> 0, most >= D])
    problem.solve(solver=cp.CLARABEL)
    tuned = tune(system, limits={"bandwidth": bandwidth})
    assert tuned.limit == pytest.approx(float(s.value), rel=1e-3)  # of the grid
    assert tuned.binding.kind == "transparency"
    task = tuned.system.law.tasks[0]
    stiffer = replace(task, stiffness=1.001 * np.asarray(task.stiffness))
    law = replace(system.law, tasks=(stiffer,))
    assert sealag.certify(replace(tuned.system, law=law)).answer.status is not Status.CERTIFIED


@pytest.mark.parametrize("bandwidth", [18.8, 19.4])
def test_the_least_damping_under_a_bandwidth_is_that_of_another_program(bandwidth):
    system = sealag.load(EXAMPLES / "anymal.toml")
    drives, d = system.actuators, system.delays.d_1
    tuned = tune(system, aim="damping", limits={"bandwidth": bandwidth})
    F = system.spaces().F_theta[0]
    F, size = (F + F.T) / 2.0, float(np.abs(F).max())
    omega = 2.0 * np.pi * bandwidth
    K, B_s = drives.spring_stiffness, drives.shaped_inertia
    most = np.sqrt(2.0 * K**2 - (K - B_s * omega**2) ** 2) / omega
    D = cp.Variable(system.robot.n)
    limits = [cp.diag(D) / (d * size) - F / size >> 0, most >= D]
    least = cp.Problem(cp.Minimize(cp.sum(D)), limits).solve(solver=cp.CLARABEL)
    assert tuned.found
    assert tuned.limit == pytest.approx(float(least), rel=1e-5)
    assert tuned.limit > tune(system, aim="damping").limit
    assert tuned.binding.kind == "transparency"
    assert (tuned.system.actuators.motor_damping <= most).all()


def test_a_bandwidth_that_leaves_too_little_damping_is_a_no():
    system = sealag.load(EXAMPLES / "anymal.toml")
    tuned = tune(system, aim="damping", limits={"bandwidth": 20.5})
    assert not tuned.found
    assert "bandwidth 20.5 Hz" in tuned.reasons[0]
    assert "11.500 ms are required" in tuned.reasons[0]
    none = tune(system, limits={"bandwidth": 300.0})
    assert not none.found
    assert "shaped inertia" in none.reasons[0]


def test_the_rms_of_a_swing_in_closed_form(tmp_path):
    """θ = A sin ωt: the mean square of B_s θ̈ + D θ̇ is A²ω²(D² + B_s²ω²)/2."""
    system, rms = two_joints(tmp_path), 4.0
    tuned = tune(system, swing(), limits={"rms": rms})
    A = np.array([0.2, 0.3])
    B_s = system.actuators.shaped_inertia
    most = np.sqrt(2.0 * rms**2 / (A * OMEGA) ** 2 - (B_s * OMEGA) ** 2)
    assert tuned.system.actuators.motor_damping == pytest.approx(most, rel=1e-3)
    assert tuned.found
    shown = tuned.summary()["transparency"]["rms_nm"]
    assert list(shown.values()) == pytest.approx([rms, rms], rel=1e-3)
    assert max(shown.values()) <= rms * (1.0 + 1e-12)


def test_a_motion_that_brakes_needs_some_damping(tmp_path):
    """While a link only brakes, damping gives back what inertia takes: an interval, not a bound."""
    system = two_joints(tmp_path)
    time = np.linspace(0.0, 0.5, 51)
    v = np.stack([3.0 - 4.0 * time, np.full_like(time, 0.5)], axis=1)
    q = np.stack([3.0 * time - 2.0 * time**2, 0.5 * time], axis=1)
    motion = Motion(
        time=time, q=q, v=v, contact_sets=((),), contact_index=np.zeros(51, dtype=np.int64)
    )
    B_s = system.actuators.shaped_inertia
    D = np.linspace(0.0, 1.0, 20_001)
    a = np.array([-4.0, 0.0])
    square = [
        np.trapezoid((B_s[j] * a[j] + D[:, None] * v[None, :, j]) ** 2, time) / 0.5
        for j in range(2)
    ]
    rms = 1.02 * np.sqrt(square[0].min())
    assert np.sqrt(square[0][0]) > rms
    inside = D[np.sqrt(square[0]) <= rms]
    loose = replace(system.law.tasks[0], stiffness=1e-3 * K_X)
    soft = replace(system, law=replace(system.law, tasks=(loose,)))
    least = tune(soft, motion, aim="damping", limits={"rms": rms})
    assert least.found
    assert least.system.actuators.motor_damping[0] == pytest.approx(inside.min(), rel=1e-3)
    most = tune(soft, motion, limits={"rms": rms})
    assert most.system.actuators.motor_damping[0] == pytest.approx(inside.max(), rel=1e-3)
    none = tune(soft, motion, limits={"rms": 0.97 * rms})
    assert not none.found
    assert "joint0" in none.reasons[0]


def test_a_joint_at_rest_keeps_its_damping(tmp_path):
    system = two_joints(tmp_path)
    tuned = tune(system, swing(rest=True), limits={"rms": 4.0})
    assert tuned.system.actuators.motor_damping[1] == system.actuators.motor_damping[1]
    both = tune(system, swing(rest=True), limits={"rms": 4.0, "bandwidth": 3.0})
    drives = both.system.actuators
    assert amplitude(drives, 3.0, drives.motor_damping)[0, 1] == pytest.approx(np.sqrt(0.5))


def test_joint_pd_keeps_what_its_motors_have(tmp_path):
    system = sealag.load(EXAMPLES / "go2.toml")
    tuned = tune(system, limits={"bandwidth": 4.0})
    drives = tuned.system.actuators
    assert tuned.found
    assert amplitude(drives, 4.0, drives.motor_damping).min() == pytest.approx(np.sqrt(0.5))
    again = sealag.load(EXAMPLES / "go2.toml", text=tuned.system.text)
    assert sealag.certify(again).answer.status is Status.CERTIFIED


@pytest.mark.parametrize(
    ("changes", "asked", "words"),
    [
        ({"spring_damping": 0.1}, {}, "joint0 has spring_damping"),
        ({"viscous_friction": [0.0, 0.1]}, {}, "joint1 has viscous_friction"),
        ({"torque_bandwidth": 100.0}, {}, "joint0 has torque_bandwidth"),
        ({}, {"number": "jitter"}, "passive number only"),
        ({}, {"limits": {"rms": 1.0}}, "motion"),
        ({}, {"limits": {"bandwidth": -1.0}}, "bandwidth is -1"),
        ({}, {"limits": {"bandwidth": np.nan}}, "bandwidth is nan"),
        ({}, {"limits": {"phase": 1.0}}, "'phase'"),
    ],
)
def test_limits_that_have_no_answer_are_refused(tmp_path, changes, asked, words):
    system = arm_system(tmp_path, springs=changes, delays=constant_delays(0.002, 0.002))
    with pytest.raises(InputError, match=words):
        tune(system, **{"limits": {"bandwidth": 2.0}, **asked})
