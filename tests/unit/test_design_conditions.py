"""Conditions of the certified criterion: no task pushes, no window reaches across contacts, and no
delay is longer than the bound."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.small_systems import arm_system, constant_delays, joint_task
from sealag.robot import Contact, Motion
from sealag.whole_body import Law, MotorAngles


def moving(folder, contact_index):
    """The arm with motor angles fed back, and a motion in which contacts may hold its elbow."""
    system = arm_system(folder)
    law = Law(tasks=(joint_task(system.robot, 30.0),), stiffness_form="force", signal=MotorAngles())
    count = len(contact_index)
    t = np.linspace(0.0, 1.0, count)
    motion = Motion(
        time=t, q=np.column_stack([0.3 + 0.2 * np.sin(2.0 * t), -0.5 + 0.3 * t]),
        v=np.zeros((count, 2)), contact_sets=((), (Contact(frame="link1"),)),
        contact_index=np.array(contact_index),
    )  # fmt: skip
    return replace(system, law=law), motion


@pytest.mark.parametrize(
    ("lowest", "refused"), [(2.0, False), (0.0, False), (-1e-11, False), (-1e-6, True), (-3, True)]
)
def test_a_task_that_pushes_along_one_direction_is_refused_there(lowest, refused, tmp_path):
    """Rounding of a direction without stiffness is none."""
    system, motion = moving(tmp_path, [0, 0, 0])
    spaces = system.spaces(motion)
    assert (system.certified_bounds(spaces).delay > 0.0).all()
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    F_task = spaces.F_task.copy()
    F_task[1] = turn @ np.diag([40.0, lowest]) @ turn.T
    bound = system.certified_bounds(replace(spaces, F_task=F_task))
    assert (bound.delay == 0.0).tolist() == [False, refused, False]
    words = ("the task stiffness is indefinite at 1 of 3 instants",)
    assert bound.refusals == (words if refused else ())


def test_no_window_reaches_across_a_change_of_contacts(tmp_path):
    index = [0] * 5 + [1] * 6 + [0] * 3
    certificate = sealag.certify(*moving(tmp_path, index), time_varying=True)
    windows = [(one.first, one.last) for one in certificate.evidence.time_varying_windows]
    assert windows == [(0, 4), (5, 10), (11, 13)]


@pytest.mark.parametrize(("share", "status"), [(0.99, "certified"), (1.02, "not_certified")])
def test_a_delay_is_certified_up_to_the_bound_and_no_further(tmp_path, share, status):
    system = arm_system(tmp_path)
    bound = sealag.certify(system).answer.max_delay_s
    way = share * bound / 2.0
    answer = sealag.certify(replace(system, delays=constant_delays(way, way))).answer
    assert answer.max_delay_s == pytest.approx(bound, rel=1e-12)
    assert answer.status == status
    assert any("exceeds the bound" in reason for reason in answer.reasons) == (share > 1.0)
