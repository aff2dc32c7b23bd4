"""Future work (iii): damping that is fitted to the walk and its delay."""

from dataclasses import replace

import numpy as np
import pytest

from humanoids2016 import Verdict, WalkCase, simulate_walk, tuned_claim, tuned_walk
from sealag.design import load

HUME = load("bundled:hume")


@pytest.fixture(scope="module")
def found():
    """Two steps of the walk."""
    case = WalkCase(walking=replace(HUME.walking, steps=2))
    return tuned_walk(HUME, simulate_walk(HUME, case))


@pytest.mark.slow
def test_fitted_damping_is_worth_twice_the_printed_one(found):
    assert found.walked
    assert found.delay_s == pytest.approx(0.0335)
    assert found.bound_s < 0.5 * found.delay_s
    assert found.tuned_stiffness > 2.0 * found.stiffness
    assert np.all(found.damping > 0.0)
    claim = tuned_claim(found, HUME.robot.joints)
    assert claim.verdict is Verdict.CONFIRMED
    assert "The walk with it is a gait." in claim.computed


@pytest.mark.slow
def test_the_claim_can_fail(found):
    for changes in ({"walked": False}, {"tuned_stiffness": 1.9 * found.stiffness}):
        wrong = tuned_claim(replace(found, **changes), HUME.robot.joints)
        assert wrong.verdict is Verdict.CONTRADICTED
