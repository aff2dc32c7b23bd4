"""Gains along a motion: every instant holds, and all at once have no better answer."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from helpers.small_systems import arm, arm_system, joint_task
from sealag.errors import InputError
from sealag.robot import Motion
from sealag.tune import tune
from sealag.whole_body import Law, StaticJoint, Task

INSTANTS = 40


@pytest.fixture
def swinging(tmp_path):
    """An arm with a hand task and a posture task that swings, and its motion."""
    robot = arm(tmp_path)
    hand = Task(name="hand", kind="position", stiffness=300.0, frame="link1", axes=(0, 2))
    law = Law(
        tasks=(hand, joint_task(robot, 20.0)), stiffness_form="force", signal=StaticJoint(),
        gravity="planned",
    )  # fmt: skip
    system = arm_system(tmp_path, robot=robot, law=law, posture=np.array([np.pi / 2, 0.3]))
    time = np.linspace(0.0, 1.0, INSTANTS)
    q = np.stack([np.pi / 2 + 0.3 * np.sin(6 * time), 0.8 + 0.5 * np.cos(6 * time)], axis=1)
    v = np.stack([1.8 * np.cos(6 * time), -3.0 * np.sin(6 * time)], axis=1)
    motion = Motion(
        time=time, q=q, v=v, contact_sets=((),), contact_index=np.zeros(INSTANTS, dtype=np.int64)
    )
    return system, motion


def part(system, motion, name):
    """F_task (N, n, n) of one task alone."""
    tasks = tuple(t if t.name == name else replace(t, stiffness=0.0) for t in system.law.tasks)
    return replace(system, law=replace(system.law, tasks=tasks)).spaces(motion).F_task


def test_the_worst_instant_sets_the_common_factor(swinging):
    system, motion = swinging
    tuned = tune(system, motion)
    K, D = system.actuators.spring_stiffness, system.actuators.motor_damping
    root = np.sqrt(1.0 / K + system.delays.d_1 / D)
    F = system.spaces(motion).F_task
    each = [1.0 / np.linalg.eigvalsh(root[:, None] * f * root)[-1] for f in F]
    assert tuned.limit == pytest.approx(min(each), rel=1e-9)
    assert tuned.binding.instant == int(np.argmin(each))
    assert tuned.binding.time_s == motion.time[tuned.binding.instant]
    assert tuned.reached_s >= system.delays.d_1


def test_factors_of_tasks_are_those_of_all_instants_at_once(swinging):
    system, motion = swinging
    tuned = tune(system, motion, share="task")
    K, D = system.actuators.spring_stiffness, system.actuators.motor_damping
    root = np.sqrt(1.0 / K + system.delays.d_1 / D)
    hand, joints = (root[:, None] * part(system, motion, n) * root for n in ("hand", "joints"))
    f = cp.Variable(2)
    limits = [np.eye(2) - f[0] * a - f[1] * b >> 0 for a, b in zip(hand, joints)]
    cp.Problem(cp.Maximize(cp.geo_mean(f)), limits).solve(solver=cp.CLARABEL)
    assert tuned.limit == pytest.approx(float(np.sqrt(f.value[0] * f.value[1])), rel=1e-5)
    assert list(tuned.factors.values()) == pytest.approx(f.value, rel=1e-3)


@pytest.mark.parametrize("aim", ["damping", "drag"])
def test_the_least_damping_of_all_instants_at_once(swinging, aim):
    system, motion = swinging
    tuned = tune(system, motion, aim=aim)
    cost = np.ones(2)
    if aim == "drag":
        cost = np.trapezoid(motion.v**2, motion.time, axis=0)
    D = cp.Variable(2)
    F = system.delays.d_1 * system.spaces(motion).F_theta
    limits = [cp.diag(D) - (f + f.T) / 2.0 >> 0 for f in F]
    least = cp.Problem(cp.Minimize(cost @ D), limits).solve(solver=cp.CLARABEL)
    assert tuned.limit == pytest.approx(least, rel=1e-5)
    assert tuned.reached_s >= system.delays.d_1
    assert cost @ tuned.system.actuators.motor_damping == pytest.approx(least, rel=1e-5)


def test_a_motion_that_stands_still_has_no_drag(swinging):
    system, motion = swinging
    with pytest.raises(InputError, match="moves no joint"):
        tune(system, replace(motion, v=np.zeros_like(motion.v)), aim="drag")


def test_gains_of_nothing_are_refused(swinging):
    system, _ = swinging
    tasks = tuple(replace(task, stiffness=0.0) for task in system.law.tasks)
    with pytest.raises(InputError, match="All stiffness gains are 0"):
        tune(replace(system, law=replace(system.law, tasks=tasks)))
