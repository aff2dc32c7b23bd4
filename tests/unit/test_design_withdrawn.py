"""A bound whose multiplier rounding hides is withdrawn, and all that was built on it with it.

Two motors that differ 1e20 times in damping and stiffness: 1/w = 1/3 s is found, but no multiplier
in doubles can be shown to prove it.
"""

import numpy as np
import pytest

import sealag
from helpers.certificates import failures, plain
from helpers.small_systems import arm_system, joint_task
from sealag.robot import Motion
from sealag.whole_body import Law, MotorAngles

RATE = 3.0
"""1/s: stiffness over damping of every joint, w of the delayed stiffness."""


def unlike(folder, ratio):
    """The arm with motor angles fed back to springs in the joints; and a motion of it."""
    damping = 10.0 * np.array([ratio, 1.0 / ratio])
    system = arm_system(folder, springs={"motor_damping": damping})
    task = joint_task(system.robot, np.diag(RATE * damping))
    law = Law(tasks=(task,), stiffness_form="force", gravity="planned", signal=MotorAngles())
    motion = Motion(
        time=np.array([0.0, 0.3, 1.0]), q=np.array([[0.3, -0.5], [0.4, -0.4], [0.6, -0.1]]),
        v=np.zeros((3, 2)), contact_sets=((),), contact_index=np.zeros(3, dtype=np.int64),
    )  # fmt: skip
    return arm_system(folder, law=law, springs={"motor_damping": damping}), motion


def test_no_delay_is_certified_without_a_proof(tmp_path):
    system, motion = unlike(tmp_path, 1e10)
    found = system.certified_bounds(system.spaces(motion), None, motion)
    np.testing.assert_allclose(found.delay, 1.0 / RATE, rtol=1e-5)
    answer = sealag.certify(system, motion).answer
    assert answer.status == "not_certified"
    assert answer.max_delay_s == 0.0
    assert "3 of 3 bounds have no proof" in answer.reasons[0]


@pytest.mark.parametrize("time_varying", [False, True])
def test_what_shares_its_multiplier_is_withdrawn_too(tmp_path, time_varying):
    system, motion = unlike(tmp_path, 1e10)
    certificate = sealag.certify(system, motion, time_varying=time_varying)
    assert certificate.answer.common_multiplier_delay_s is None
    assert certificate.answer.time_varying_delay_s is None
    assert certificate.evidence.common_multiplier is None
    assert failures(plain(certificate)) == []


def test_motors_that_are_alike_are_proven(tmp_path):
    system, motion = unlike(tmp_path, 3.0)
    answer = sealag.certify(system, motion).answer
    assert answer.max_delay_s == pytest.approx(1.0 / RATE, rel=1e-6)
    assert answer.common_multiplier_delay_s == pytest.approx(1.0 / RATE, rel=1e-6)
