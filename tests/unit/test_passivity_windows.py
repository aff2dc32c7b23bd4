"""What lies between two instants, and what a box leaves out, is inside the ball of a window.

One joint whose J* and J*ᵀS swell together as s(t) and f s(t): a point has the norm
s √(W + d² f² / W), and what is proven for the largest s of a window has s² (W + d² f² / W) = 2.
"""

import numpy as np
import pytest

from sealag.passivity import Problem, Windows, solve

F = 7.0
START, BEND, PEAK = 1.3, 0.04, 5.35
"""s(t) = 1.3 − 0.04 (t − 5.35)²: the peak lies between two instants, and not halfway."""


def swelling(t):
    s = (START - BEND * (np.asarray(t) - PEAK) ** 2)[:, None, None]
    return Problem(J=s, M=F * s, blocks=(1,))


def proven_up_to(size, W):
    """The delay that a multiplier proves for all sizes up to one."""
    return np.sqrt(W * (2.0 / size**2 - W)) / F


@pytest.fixture
def problem():
    return swelling(np.arange(10.0))


def test_a_ball_reaches_as_far_as_a_parabola_rises_above_its_chord(problem):
    """A quarter of the bend halfway, above the higher end of the chord."""
    found = solve(problem, share=Windows(width=1, directions=1))
    W = float(found.multiplier[0, 0])
    reached = problem.J[:, 0, 0].max() + BEND / 4.0
    assert reached > START
    assert found.delay == pytest.approx(proven_up_to(reached, W), rel=1e-6)
    for one in found.windows:
        inner = one.first > 0 and one.last < 9  # the two ends have no second difference
        size = np.sqrt(W + (found.delay * F) ** 2 / W)
        assert not inner or one.radius == pytest.approx(BEND / 4.0 * size, rel=1e-6)


def test_without_a_ball_only_the_instants_are_covered(problem):
    found = solve(problem, share=Windows(width=1, directions=1, between=False))
    W = float(found.multiplier[0, 0])
    at = problem.J[:, 0, 0].max()
    assert found.delay == pytest.approx(proven_up_to(at, W), rel=1e-6)
    assert found.delay > proven_up_to(START, W)


def test_what_a_box_leaves_and_what_lies_between_add_up(problem):
    """Without directions a box is the mean of its instants."""
    found = solve(problem, share=Windows(width=1, directions=0))
    W = float(found.multiplier[0, 0])
    s = problem.J[:, 0, 0]
    reached = max((s[k] + s[k + 1]) / 2.0 + abs(s[k + 1] - s[k]) / 2.0 for k in range(1, 8))
    assert found.delay == pytest.approx(proven_up_to(reached + BEND / 4.0, W), rel=1e-6)
