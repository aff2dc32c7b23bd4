"""Section III: what it costs to compute damping centrally."""

from dataclasses import replace

import numpy as np
import pytest

from humanoids2016 import Verdict, split_claim, split_damping
from sealag.design import load

HUME = load("bundled:hume")


@pytest.fixture(scope="module")
def rows():
    return split_damping(HUME)


def test_damping_in_the_drive_gives_the_passive_bound(rows):
    """d = D / k for one joint; late rates alone allow d = B_s / D however they vary."""
    for row in rows:
        k = HUME.robot.joints.index(f"right_{row.joint}")
        D, B_s = HUME.actuators.motor_damping[k], HUME.actuators.shaped_inertia[k]
        if row.share == 0.0:
            assert row.jitter_s == pytest.approx(D / 100.0, rel=1e-6)
            assert row.rates_s == np.inf
        if row.share == 1.0:
            assert row.jitter_s == pytest.approx(B_s / D, rel=2e-2)


def test_exact_margins_are_where_the_characteristic_equation_says(rows):
    """One joint by hand: at the margin some jω solves det = 0; the first such delay on a grid."""
    row = next(r for r in rows if (r.joint, r.share) == ("knee", 1.0))
    k = HUME.robot.joints.index("right_knee")
    drives = HUME.actuators
    M = HUME.robot.workspace_at(HUME.posture).M[-HUME.robot.n :, -HUME.robot.n :][k, k]
    K, B_s, D = drives.spring_stiffness[k], drives.shaped_inertia[k], drives.motor_damping[k]
    w = np.geomspace(1.0, 1e5, 2_000_000)
    drive = -B_s * w**2 + K - K**2 / (K - M * w**2)
    L = -(100.0 + 1j * w * D) / drive  # 1 = L e^{-jωd}
    at = np.flatnonzero(np.diff(np.abs(L) > 1.0))
    delay = (np.angle(L[at]) % (2.0 * np.pi)) / w[at]
    assert row.constant_s == pytest.approx(delay.min(), rel=1e-3)


def test_claim_is_confirmed_and_can_fail(rows):
    assert split_claim(rows).verdict is Verdict.CONFIRMED
    other = [replace(row, positions_s=0.5 * row.rates_s) for row in rows]
    assert split_claim(other).verdict is Verdict.CONTRADICTED
