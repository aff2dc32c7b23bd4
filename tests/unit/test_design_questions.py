"""Questions from Python that have no answer are refused with a sentence."""

import numpy as np
import pytest

import sealag
from sealag.errors import InputError
from sealag.passivity import max_delay
from sealag.robot import load_robot

EYE, ONES = np.eye(3), np.ones(3)

ARRAYS = {
    "batches": (np.ones((5, 3, 3)), np.broadcast_to(EYE, (4, 3, 3)), "batches"),
    "complex": (EYE * 1j, EYE, "J_star"),
    "text": ([["a"] * 3] * 3, EYE, "J_star"),
    "ragged": ([[1.0, 2.0], [3.0]], EYE, "J_star"),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_that_cannot_be(name):
    J, inertia, word = ARRAYS[name]
    with pytest.raises(InputError, match=word):
        max_delay(J, inertia, ONES, ONES)


def test_arrays_that_can_be():
    batch = max_delay(np.tile(EYE, (5, 1, 1, 1)), np.tile(EYE, (4, 1, 1)), ONES, ONES)
    np.testing.assert_allclose(batch.delay, np.ones((5, 4)), rtol=1e-6)
    assert max_delay(EYE.astype(int), EYE, [1, 1, 1], [1, 1, 1]).delay == pytest.approx(1.0)


QUESTIONS = {
    "criterion": (sealag.certify, {"criterion": "x"}),
    "proofs": (sealag.certify, {"proofs": 1.5}),
    "motion": (sealag.certify, {"motion": 3.5}),
    "seed": (sealag.simulate, {"seed": -1}),
    "whole number": (sealag.simulate, {"seed": 1.5}),
    "duration": (sealag.simulate, {"duration": float("nan")}),
}


@pytest.mark.parametrize("name", QUESTIONS)
def test_questions_that_cannot_be(name):
    ask, arguments = QUESTIONS[name]
    with pytest.raises(InputError, match=name):
        ask(sealag.load("bundled:hume"), **arguments)


def test_positions_outside_limits():
    robot = load_robot("bundled:hume.urdf", floating_base=True)
    q = robot.configuration({"left_knee": float(robot.position_upper[-1])})
    robot.require_within_limits([q, q])
    with pytest.raises(InputError, match="row 2"):
        robot.require_within_limits([q, robot.configuration({"left_knee": 55.0})])
