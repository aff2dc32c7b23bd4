"""Loops with a double root at half a turn: the matrix there has no basis of eigenvectors."""

import numpy as np
import pytest

from sealag.margin import DelayedLoop


def joints(count, damping, feedback):
    """ẍ + c ẋ + (c²/4 + f) x = −f x(t − d): x + f turned by half has a double root at −c/2."""
    A_0 = [[0.0, 1.0], [-(damping**2) / 4.0 - feedback, -damping]]
    A_1 = [[0.0, 0.0], [-feedback, 0.0]]
    return np.kron(np.eye(count), A_0), np.kron(np.eye(count), A_1)


def first_delay(damping, feedback):
    """From the two real equations of one joint: |k − ω² + jcω| = f, and the phase of that."""
    k = damping**2 / 4.0 + feedback
    squares = np.roots([1.0, damping**2 - 2.0 * k, k**2 - feedback**2])
    omegas = np.sqrt([s.real for s in squares if abs(s.imag) < 1e-9 and s.real > 0.0])
    turns = -np.angle(-(k - omegas**2 + 1j * damping * omegas) / feedback) % (2.0 * np.pi)
    return min(turns / omegas, default=np.inf)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize(
    ("damping", "feedback"), [(40.0, 400.0), (2.0, 1.5), (1.0, 10.0), (9.0, 200.0)]
)
def test_a_double_root_far_from_the_axis_leaves_the_margin_known(count, damping, feedback):
    found = DelayedLoop(*joints(count, damping, feedback)).margin()
    assert found.delay == pytest.approx(first_delay(damping, feedback), rel=1e-9)
    assert found.guaranteed
