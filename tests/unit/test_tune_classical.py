"""Limits that the literature knows, laws without a potential, and walks that nothing holds."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.small_systems import arm, arm_system, constant_delays, joint_task
from sealag.passivity import Status
from sealag.tune import tune
from sealag.whole_body import Law, StaticJoint, Task


@pytest.mark.parametrize("delay", [1e-4, 1e-6, 1e-8])
def test_without_delay_the_limit_is_the_spring(tmp_path, delay):
    """d → 0: K_q ≺ K, the classical limit of a series elastic joint; at d it is 1/(1/K + d/D)."""
    robot = arm(tmp_path, count=1)
    law = Law(
        tasks=(joint_task(robot, 30.0),), stiffness_form="force", signal=StaticJoint(),
        gravity="planned",
    )  # fmt: skip
    delays = constant_delays(0.5 * delay, 0.4 * delay, sample_time=0.1 * delay)
    system = arm_system(tmp_path, robot=robot, law=law, count=1, delays=delays,
                        posture=np.array([np.pi / 2]))  # fmt: skip
    tuned = tune(system)
    K, D = system.actuators.spring_stiffness[0], system.actuators.motor_damping[0]
    limit = 30.0 * tuned.limit
    assert limit == pytest.approx(1.0 / (1.0 / K + delay / D), rel=1e-9)
    assert limit < K
    assert (K - limit) / K == pytest.approx(K * delay / D, rel=1e-2)
    assert tuned.binding.kind in ("spring", "stability")


@pytest.fixture
def asymmetric(tmp_path):
    """An arm whose printed stiffness Λ K_x has no potential."""
    robot = arm(tmp_path)
    hand = Task(name="hand", kind="pose", stiffness=(60.0, 240.0), frame="link1", axes=(0, 4))
    law = Law(tasks=(hand,), stiffness_form="published", gravity="planned")
    return arm_system(tmp_path, robot=robot, law=law, posture=np.array([np.pi / 2, 0.8]))


@pytest.mark.slow
def test_a_law_without_a_potential_is_tuned_by_its_jitter_margin(asymmetric):
    assert asymmetric.spaces().asymmetry[0] > 0.05
    passive = tune(asymmetric)
    assert not passive.found
    assert "no potential" in " ".join(passive.reasons)
    tuned = tune(asymmetric, number="jitter")
    assert tuned.found
    assert tuned.certificate.answer.status is Status.NOT_CERTIFIED
    required = asymmetric.delays.d_1
    assert tuned.system.local_margins().jitter_s >= required
    law = tuned.system.law
    stiffer = replace(law.tasks[0], stiffness=1.001 * np.asarray(law.tasks[0].stiffness))
    beyond = replace(tuned.system, law=replace(law, tasks=(stiffer,)))
    assert beyond.local_margins().jitter_s < required


def test_a_pendulum_upside_down_is_passive_only(tmp_path):
    """Soft gains hold no arm that stands on its base: passive at the delay, and that is all."""
    robot = arm(tmp_path)
    law = Law(tasks=(joint_task(robot, 1.0),), stiffness_form="force", gravity="planned")
    system = arm_system(
        tmp_path, robot=robot, law=law, posture=np.array([-np.pi / 2, 0.0]),
        springs={"motor_damping": np.array([0.5, 0.5])},
    )  # fmt: skip
    tuned = tune(system, aim="damping")
    assert not tuned.found
    assert tuned.passive_only
    assert tuned.reached_s >= system.delays.d_1
    hanging = replace(system, posture=np.array([np.pi / 2, 0.0]))
    held = tune(hanging, aim="damping")
    assert held.found
    assert not held.passive_only


def test_motor_angles_do_not_need_springs_stiffer_than_the_tasks(tmp_path):
    robot = arm(tmp_path)
    law = Law(tasks=(joint_task(robot, 500.0),), stiffness_form="force", gravity="planned")
    system = arm_system(tmp_path, robot=robot, law=law, posture=np.array([np.pi / 2, 0.0]))
    assert system.spaces().contraction.max() > 1.0
    tuned = tune(system, aim="damping")
    d = system.delays.d_1
    assert tuned.system.actuators.motor_damping == pytest.approx([500.0 * d] * 2, rel=1e-5)
    static = replace(system, law=replace(law, signal=StaticJoint()))
    assert "stiffer than the springs" in tune(static, aim="damping").reasons[0]
