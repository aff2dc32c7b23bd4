"""Damping that the controller computes, moved into the drives: the nearest, certified, written."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm, arm_system, joint_task
from sealag.errors import InputError
from sealag.passivity import Status
from sealag.robot import Motion
from sealag.tune import tune
from sealag.whole_body import Law, Task

INSTANTS = 5
D_X = (8.0, 3.0, 2.0)


@pytest.fixture
def handed(tmp_path):
    """An arm whose hand is damped by the controller, along a swing."""
    robot = arm(tmp_path)
    hand = Task(
        name="hand", kind="pose", stiffness=30.0, damping=D_X, frame="link1", axes=(0, 2, 4),
    )  # fmt: skip
    law = Law(tasks=(hand, joint_task(robot, 5.0)), stiffness_form="force", gravity="planned")
    system = arm_system(tmp_path, robot=robot, law=law, posture=np.array([np.pi / 2, 0.3]))
    time = np.linspace(0.0, 1.0, INSTANTS)
    q = np.stack([np.pi / 2 + 0.3 * np.sin(6 * time), 0.8 + 0.5 * np.cos(6 * time)], axis=1)
    motion = Motion(
        time=time, q=q, v=np.zeros_like(q), contact_sets=((),),
        contact_index=np.zeros(INSTANTS, dtype=np.int64),
    )  # fmt: skip
    return system, motion


@pytest.fixture(scope="module")
def go2(tmp_path_factory):
    """The dog whose controller computes K_d = 1 Nms/rad of every joint."""
    text = (EXAMPLES / "go2.toml").read_text()
    project = tmp_path_factory.mktemp("go2") / "go2.toml"
    project.write_text(text.replace('damping_at = "drive" ', 'damping_at = "controller" '))
    return project


def left_over(D, central, Pi):
    """Σ ‖Πᵀ D Π − C‖² over all instants."""
    return sum(np.linalg.norm(P.T @ np.diag(D) @ P - C) ** 2 for P, C in zip(Pi, central))


def test_of_a_fixed_base_it_is_the_mean_of_the_diagonal(handed):
    system, motion = handed
    J = system.spaces(motion).J_star[:, :3]
    central = J.transpose(0, 2, 1) @ np.diag(D_X) @ J
    tuned = tune(system, motion, aim="mapping")
    fit = np.diagonal(central, axis1=1, axis2=2).mean(axis=0)
    assert tuned.mapping.damping == pytest.approx(fit, rel=2e-6)
    size = sum(np.linalg.norm(C) ** 2 for C in central)
    left = left_over(fit, central, np.broadcast_to(np.eye(2), central.shape))
    assert tuned.mapping.error == pytest.approx(np.sqrt(left / size), rel=1e-6)
    assert 0.1 < tuned.mapping.error < tuned.mapping.worst
    assert tuned.system.actuators.motor_damping == pytest.approx(
        system.actuators.motor_damping + fit, rel=1e-6
    )
    assert not tuned.system.law.damped
    assert tuned.certificate.answer.status is Status.CERTIFIED
    before = sealag.certify(system, motion)
    assert before.answer.status is Status.NOT_CERTIFIED


def test_no_other_drive_damping_is_nearer(handed):
    system, motion = handed
    J = system.spaces(motion).J_star[:, :3]
    central, Pi = J.transpose(0, 2, 1) @ np.diag(D_X) @ J, np.tile(np.eye(2), (5, 1, 1))
    fit = tune(system, motion, aim="mapping").mapping.damping
    least = left_over(fit, central, Pi)
    rng = np.random.default_rng(0)
    for _ in range(20):
        other = np.maximum(fit + rng.normal(scale=0.3, size=2), 0.0)
        assert left_over(other, central, Pi) > least


def test_contacts_that_mix_joints_leave_nothing_over(go2):
    """J*ᵀ K_d J* of a standing dog is full, but on what its feet leave K_d in the drives is it."""
    system = sealag.load(go2)
    tuned = tune(system, aim="mapping")
    assert tuned.mapping.damping.tolist() == [1.0] * 12
    assert tuned.mapping.error < 1e-12
    J = system.spaces().J_star[0]
    assert np.abs(np.diag(J.T @ J) - 1.0).max() > 0.2  # the plain diagonal is another
    assert tuned.found
    assert 'damping_at = "drive"' in tuned.system.text
    again = sealag.load(EXAMPLES / "go2.toml")
    assert tuned.system.actuators.motor_damping == pytest.approx(again.actuators.motor_damping)
    assert tuned.reached_s == pytest.approx(again.local_margins().passive_s, rel=1e-6)


def test_late_damping_tolerates_less_the_more_of_it_is_late(go2):
    margins = tune(sealag.load(go2), aim="mapping").mapping.jitter_s
    assert margins["central"] == pytest.approx(sealag.load(go2).local_margins().jitter_s)
    assert 1.5 * margins["central"] < margins["half"] < 0.2 * margins["embedded"]


def test_a_law_without_damping_has_nothing_to_move(tmp_path):
    with pytest.raises(InputError, match="No task of system has a damping"):
        tune(arm_system(tmp_path), aim="mapping")


def test_what_is_left_in_the_controller_is_refused_as_before(handed):
    """Half the damping stays late: the certificate sees it."""
    system, motion = handed
    half = tuple(replace(one, damping=0.5 * np.asarray(one.damping)) for one in system.law.tasks)
    moved = replace(system, law=replace(system.law, tasks=half))
    assert sealag.certify(moved, motion).answer.status is Status.NOT_CERTIFIED
