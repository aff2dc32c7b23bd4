"""The frozen loop against matrices written out by hand, its symmetries, and its contacts."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from helpers.small_systems import arm, arm_system, joint_task
from sealag.design import load
from sealag.margin import DelayedLoop
from sealag.robot import Contact
from sealag.whole_body import FrozenLoop, Law, LinkAngles, MotorAngles, StaticJoint

HUME = load("bundled:hume")
GAIN = 30.0
BOTH = (Contact(frame="left_foot"), Contact(frame="right_foot"))

PARTS = {
    "springs alone": {},
    "spring damping": {"spring_damping": np.array([0.7, 0.2])},
    "viscous friction": {"viscous_friction": np.array([0.4, 0.9])},
    "no shaping": {"inertia_shaping": 1.0},
    "slow drives": {"torque_bandwidth": np.array([90.0, 250.0])},
    "one slow drive": {"torque_bandwidth": np.array([np.inf, 250.0])},
    "everything": {
        "spring_damping": np.array([0.7, 0.2]),
        "viscous_friction": np.array([0.4, 0.9]),
        "torque_bandwidth": np.array([90.0, 250.0]),
    },
}


def system_of(folder, *, count=2, damping=(0.0, 0.0), signal=None, gravity="planned", **springs):
    robot = arm(folder, count=count, damping=damping)
    law = Law(
        tasks=(joint_task(robot, GAIN),),
        signal=signal or MotorAngles(),
        gravity=gravity,
        stiffness_form="force",
    )
    springs = {name: np.broadcast_to(value, 2)[:count] for name, value in springs.items()}
    return arm_system(folder, robot=robot, law=law, count=count, springs=springs)


def gravity_slope(robot, q):
    step = 1e-6 * np.eye(robot.n)
    return np.stack([robot.gravity(q + s) - robot.gravity(q - s) for s in step], axis=1) / 2e-6


def by_hand(system, q, *, late=False, links=False):
    """A_0, A_1, A_e of docs/theory sections 1, 2 over [q, θ, q̇, θ̇, τ_m]; late feedback if so.

    M q̈ = −G q + τ_s − D_j q̇, τ_s = K (θ − q) + D_s (θ̇ − q̇), B θ̈ = τ_m − τ_s − b θ̇,
    τ_m = B/B_s (u − D θ̇) + (1 − B/B_s) τ_s, behind a bandwidth ω: τ̇_m = ω (that − τ_m).
    """
    robot, drives = system.robot, system.actuators
    n = robot.n
    slow = np.flatnonzero(np.isfinite(drives.torque_bandwidth))
    size = 4 * n + len(slow)
    x = np.eye(size)
    q_, theta, q_rate, theta_rate = (x[k * n : (k + 1) * n] for k in range(4))
    torque = {joint: x[4 * n + k] for k, joint in enumerate(slow)}
    K, D_s = np.diag(drives.spring_stiffness), np.diag(drives.spring_damping)
    spring = K @ (theta - q_) + D_s @ (theta_rate - q_rate)
    M_inverse = np.linalg.inv(robot.mass_matrix(q))
    A_0, A_1, A_e = np.zeros((3, size, size))
    A_0[:n], A_0[n : 2 * n] = q_rate, theta_rate
    A_0[2 * n : 3 * n] = M_inverse @ (
        spring - gravity_slope(robot, q) @ q_ - np.diag(robot.damping) @ q_rate
    )
    ratio = drives.rotor_inertia / drives.shaped_inertia
    fed_back = -GAIN * (q_ if links else theta)
    for i in range(n):
        B, b = drives.rotor_inertia[i], drives.viscous_friction[i]
        at_once = -ratio[i] * drives.motor_damping[i] * theta_rate[i]
        back = (1.0 - ratio[i]) * spring[i]
        row, share = 3 * n + i, 1.0 / B
        A_0[row] = (-spring[i] - b * theta_rate[i]) / B
        if i in torque:
            A_0[row] += torque[i] / B
            row, share = 4 * n + slow.tolist().index(i), drives.torque_bandwidth[i]
            A_0[row] -= share * torque[i]
        A_0[row] += share * at_once
        A_1[row] = share * ratio[i] * fed_back[i]
        (A_e if late else A_0)[row] += share * back
    return A_0, A_1, A_e


def agree(loop: FrozenLoop, expected, *, tolerance=1e-6):
    size = max(np.abs(part).max() for part in expected)
    found = loop.A_0, loop.A_1, loop.A_e
    return all(np.abs(a - b).max() < tolerance * size for a, b in zip(found, expected, strict=True))


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("damping", [(0.0, 0.0), (1.5, 0.4)])
@pytest.mark.parametrize("count", [1, 2])
def test_loop_is_the_one_written_out(tmp_path, count, damping, part):
    """At rest, where springs carry gravity and H is its whole slope."""
    system = system_of(tmp_path, count=count, damping=damping, **PARTS[part])
    rest = system.rest()
    loop = system.frozen(rest=rest)
    assert agree(loop, by_hand(system, rest.q))
    assert loop.states[: 2 * count] == (
        *(f"z{i}" for i in range(count)), *(f"theta:joint{i}" for i in range(count)),
    )  # fmt: skip
    assert not agree(loop, by_hand(system, rest.q + 0.05)), "gravity's slope and M must be seen"
    for other in PARTS:
        wrong = system_of(tmp_path, count=count, damping=damping, **PARTS[other])
        expected = by_hand(wrong, rest.q)
        same = all(
            np.array_equal(getattr(system.actuators, name), getattr(wrong.actuators, name))
            for name in set().union(*PARTS.values())
        )
        assert same == (expected[0].shape == loop.A_0.shape and agree(loop, expected))
    stiff = system_of(tmp_path, count=count, damping=(damping[0] + 0.1, 0.4), **PARTS[part])
    assert not agree(loop, by_hand(stiff, rest.q))


@pytest.mark.parametrize("part", ["springs alone", "spring damping", "everything"])
def test_late_torque_feedback_has_a_delay_of_its_own(tmp_path, part):
    system = system_of(tmp_path, **PARTS[part])
    rest = system.rest()
    loop = FrozenLoop.of(
        system.robot, system.law, system.actuators, system.posture, contacts=(), rest=rest,
        embedded_delay=0.004,
    )  # fmt: skip
    assert loop.embedded_delay == 0.004
    expected = by_hand(system, rest.q, late=True)
    assert np.abs(expected[2]).max() > 0.0
    assert agree(loop, expected)
    assert not agree(loop, by_hand(system, rest.q))
    at_once = system.frozen(rest=rest)
    assert not at_once.A_e.any()
    np.testing.assert_allclose(loop.A_0 + loop.A_e, at_once.A_0, rtol=1e-12, atol=1e-9)


def test_without_shaping_there_is_no_torque_feedback_to_be_late(tmp_path):
    system = system_of(tmp_path, inertia_shaping=1.0)
    loop = FrozenLoop.of(
        system.robot, system.law, system.actuators, system.posture, contacts=(),
        rest=system.rest(), embedded_delay=0.004,
    )  # fmt: skip
    assert not loop.A_e.any()


def test_link_angles_act_on_link_angles(tmp_path):
    system = system_of(tmp_path, signal=LinkAngles(), spring_damping=0.3)
    rest = system.rest()
    loop = system.frozen(rest=rest)
    assert agree(loop, by_hand(system, rest.q, links=True))
    assert not agree(loop, by_hand(system, rest.q))


def test_static_joint_state_is_stiffer_by_the_springs(tmp_path):
    """F_θ = (F⁻¹ − K⁻¹)⁻¹ with unequal springs."""
    system = system_of(tmp_path, signal=StaticJoint())
    rest = system.rest()
    loop = system.frozen(rest=rest)
    K = system.actuators.spring_stiffness
    series = np.diag(1.0 / (1.0 / GAIN - 1.0 / K))
    np.testing.assert_allclose(loop.C[:, 2:4], -series, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(loop.C[:, :2], 0.0, atol=1e-6)


def test_frozen_loop_of_a_fixed_robot_matches_its_matrices():
    system = load(EXAMPLES / "baxter.toml")
    loop, robot, n = system.frozen(), system.robot, 14
    q = system.rest().q
    stiffness = robot.gravity_gradient(q) + np.diag(system.actuators.spring_stiffness)
    M = robot.mass_matrix(q)
    np.testing.assert_allclose(
        loop.A_0[2 * n : 3 * n, :n], -np.linalg.solve(M, stiffness), rtol=1e-5, atol=1e-4
    )
    np.testing.assert_allclose(
        loop.A_0[2 * n : 3 * n, 2 * n : 3 * n],
        -np.linalg.solve(M, np.diag(robot.damping)), rtol=1e-9, atol=1e-9,
    )  # fmt: skip
    assert robot.damping.max() > 0.0
    assert loop.symmetries.shape[1] == 0


@pytest.mark.parametrize(
    ("contacts", "count", "felt"), [((), 4, 1), (BOTH[:1], 1, 1), (BOTH, 0, 0)]
)
def test_symmetries_are_what_contacts_leave_and_no_task_feels(contacts, count, felt):
    """Joint angles do not change as the robot is moved as a whole. Its torso turns: the law feels
    yaw, but no translation in flight, where no torque moves the CoM."""
    blind = (joint_task(HUME.robot, 100.0),)
    for tasks, expected in ((blind, count), (HUME.law.tasks, count - felt)):
        law = replace(HUME.law, signal=MotorAngles(), gravity="none", tasks=tasks)
        system = replace(HUME, contacts=contacts, law=law)
        loop = system.frozen(rest=system.in_posture())
        assert loop.symmetries.shape[1] == expected
        moved = (loop.A_0 + loop.A_1) @ loop.symmetries
        assert np.abs(moved).max(initial=0.0) < 1e-9 * np.abs(loop.A_0).max()


def test_the_turn_about_the_vertical_passes_through_the_foot_wherever_it_stands():
    """Away from the origin the base moves sideways as the robot turns about its foot."""
    law = replace(HUME.law, signal=MotorAngles(), gravity="none")
    law = replace(law, tasks=(joint_task(HUME.robot, 100.0),))
    away = HUME.posture.copy()
    away[:2] += [3.0, -2.0]
    loops = [replace(HUME, contacts=BOTH[:1], law=law, posture=q) for q in (HUME.posture, away)]
    here, there = (one.frozen(rest=one.in_posture()) for one in loops)
    assert here.symmetries.shape[1] == there.symmetries.shape[1] == 1
    moved = (there.A_0 + there.A_1) @ there.symmetries
    assert np.abs(moved).max() < 1e-9 * np.abs(there.A_0).max()
    roots = [np.sort(np.linalg.eigvals(one.A_0 + one.A_1).real) for one in (here, there)]
    np.testing.assert_allclose(roots[0], roots[1], atol=1e-4)


def test_contact_forces_are_part_of_the_links():
    """The sideways sway of ANYmal by the forces in its feet: 87.4415 ms; 87.313 without those that
    joints see, 90.5 without any."""
    system = load(EXAMPLES / "anymal.toml")
    loop = system.frozen()
    assert loop.margin().delay == pytest.approx(87.4415e-3, abs=5e-8)
    wrong = loop.A_0.copy()
    k = sum(name.startswith("z") for name in loop.states)
    links = slice(k + system.robot.n, 2 * k + system.robot.n)
    wrong[links, :k] *= 1.0 + 1e-3
    assert abs(DelayedLoop(wrong, loop.A_1).margin().delay - 87.4415e-3) > 1e-6
