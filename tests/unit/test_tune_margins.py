"""Gains by margins and for joint PD: first crossings that the exact loop confirms."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system, constant_delays, joint_task
from sealag.tune import tune
from sealag.whole_body import Law

GO2 = EXAMPLES / "go2.toml"


def one_joint(folder, stiffness=30.0, **changes):
    """One joint that hangs, its stiffness fed back from the motor."""
    robot = arm_system(folder, count=1).robot
    law = Law(tasks=(joint_task(robot, stiffness),), stiffness_form="force", gravity="planned")
    posture = np.array([np.pi / 2])
    delays = constant_delays(5e-3, 5e-3, sample_time=1e-3)
    return arm_system(
        folder, robot=robot, law=law, count=1, posture=posture, delays=delays, **changes
    )


@pytest.mark.parametrize("number", ["jitter", "constant"])
def test_a_margin_ends_at_its_first_crossing(tmp_path, number):
    system = one_joint(tmp_path)
    tuned = tune(system, number=number)
    assert tuned.found
    assert tuned.scale >= tune(system).scale * (1.0 - 1e-5)

    def margin(factor):
        task = replace(system.law.tasks[0], stiffness=30.0 * tuned.scale * factor)
        other = replace(system, law=replace(system.law, tasks=(task,)))
        margins = other.local_margins()
        return margins.jitter_s if number == "jitter" else margins.delay_s

    assert margin(1.0) >= system.delays.d_1
    assert margin(1.001) < system.delays.d_1
    assert margin(0.3) >= system.delays.d_1


@pytest.mark.parametrize("number", ["jitter", "constant"])
def test_the_search_begins_where_passivity_ends_however_soft_the_gain(tmp_path, number):
    """What is found is a stiffness, whatever the factor from where it was."""
    soft, usual = (tune(one_joint(tmp_path, k), number=number) for k in (1e-4, 30.0))
    assert soft.found
    assert 1e-4 * soft.scale == pytest.approx(30.0 * usual.scale, rel=1e-4)


def test_a_joint_whose_jitter_margin_is_its_passive_bound_has_a_least_damping(tmp_path):
    """Both are alike to rounding, so that the passive damping itself may just not hold."""
    system = one_joint(tmp_path)
    passive, jitter = (tune(system, aim="damping", number=name) for name in ("passive", "jitter"))
    assert jitter.found
    D = [one.system.actuators.motor_damping[0] for one in (passive, jitter)]
    assert D[1] == pytest.approx(D[0], rel=2e-5)


def test_a_loop_that_is_unstable_without_delay_is_left_at_once(tmp_path, monkeypatch):
    """An upright link under its own weight falls with soft gains: no margin is searched there."""
    upright = replace(one_joint(tmp_path, 0.5), posture=np.array([-np.pi / 2]))
    searched = []
    local = type(upright).local

    def counted(system, *arguments, **choices):
        found = local(system, *arguments, **choices)
        searched.append(found.unstable_modes)
        return found

    monkeypatch.setattr(type(upright), "local", counted)
    assert tune(upright, number="constant").found
    assert searched
    assert not any(searched)


def test_less_damping_than_passivity_needs_is_enough_for_a_constant_delay(tmp_path):
    system = one_joint(tmp_path)
    passive, constant = (
        tune(system, aim="damping", number=name) for name in ("passive", "constant")
    )
    D = [one.system.actuators.motor_damping[0] for one in (passive, constant)]
    assert D[0] == pytest.approx(30.0 * system.delays.d_1, rel=2e-6)
    assert constant.found
    assert D[1] <= D[0] * (1.0 + 1e-6)
    less = replace(
        constant.system.actuators, motor_damping=0.998 * constant.system.actuators.motor_damping
    )
    margin = replace(constant.system, actuators=less).local_margins().delay_s
    assert margin < system.delays.d_1


def test_a_bandwidth_is_that_of_the_joint_with_its_links_free():
    """kp = m ω², 1/m the joint's diagonal of (J M⁻¹ Jᵀ) with the feet on the ground."""
    system = sealag.load(GO2)
    tuned = tune(system, aim="bandwidth", bandwidth=30.0, damping_ratio=0.7)
    robot, n = system.robot, system.robot.n
    M, J = (
        robot.mass_matrix(system.posture),
        robot.contact_jacobian(system.contacts, system.posture),
    )
    inverse = np.linalg.inv(M)
    held = inverse - inverse @ J.T @ np.linalg.pinv(J @ inverse @ J.T) @ J @ inverse
    inertia = 1.0 / np.diag(held)[-n:] + system.actuators.shaped_inertia
    gains = tuned.gains()
    np.testing.assert_allclose(list(gains["kp"].values()), 900.0 * inertia, rtol=1e-5)
    np.testing.assert_allclose(list(gains["D_theta"].values()), 42.0 * inertia, rtol=1e-5)
    kd = np.array(list(gains["kd"].values()))
    np.testing.assert_allclose(kd + 0.05, 42.0 * inertia, rtol=1e-5)
    assert tuned.found


@pytest.mark.parametrize("delay", [5e-3, 1e-2, 2e-2])
def test_the_largest_bandwidth_is_the_last_that_is_passive(delay):
    system = sealag.load(GO2)
    best = tune(system, aim="bandwidth", delay=delay)
    assert best.found
    more = tune(system, aim="bandwidth", delay=delay, bandwidth=1.001 * best.bandwidth_rad_s)
    assert not more.found
    assert best.reached_s == pytest.approx(delay, rel=1e-4)
    # All joints alike would have 2 ζ / d; what couples them through the feet takes from it.
    assert 0.2 < best.bandwidth_rad_s * delay / 2.0 <= 1.0


def test_damping_in_the_controller_has_a_bandwidth_by_its_margin(tmp_path):
    text = GO2.read_text().replace('damping_at = "drive" ', 'damping_at = "controller" ')
    project = tmp_path / "go2.toml"
    project.write_text(text)
    system = sealag.load(project)
    assert not tune(system, aim="bandwidth", bandwidth=30.0).found
    tuned = tune(system, aim="bandwidth", number="constant", bandwidth=100.0)
    assert tuned.reached_s == pytest.approx(tuned.system.frozen().margin().delay, rel=1e-4)
    assert tuned.reached_s > 0.0
