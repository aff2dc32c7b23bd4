"""A zero root that rounding has moved is no decay: the loop is not stable."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from sealag.whole_body import FrozenLoop


def _loop(rate, turn):
    """A stable delayed oscillator beside a motion with the roots rate ± turn i."""
    drift = np.array([[rate, turn], [-turn, rate]])
    A_0 = block_diag(np.array([[0.0, 1.0], [-4.0, -1.0]]), drift)
    B, C = np.zeros((4, 1)), np.zeros((1, 4))
    B[1, 0], C[0, 0] = 1.0, -3.0
    return FrozenLoop(
        A_0=A_0, B=B, C=C, A_e=np.zeros((4, 4)), embedded_delay=0.0,
        states=("a", "b", "c", "d"), symmetries=np.zeros((4, 0)),
    )  # fmt: skip


@pytest.mark.parametrize("rate", [-5e-12, 0.0, 5e-12])
@pytest.mark.parametrize("turn", [0.0, 4e-10])
def test_what_rounding_leaves_of_a_zero_root_is_not_stable(rate, turn):
    found = _loop(rate, turn).margin()
    assert (found.delay, found.unstable_roots) == (0.0, 2)


@pytest.mark.parametrize("rate", [-1e-6, -1.0])
def test_a_slow_decay_is_stable(rate):
    """The control: the margin is the oscillator's, |−ω² + ωj + 4| = 3."""
    found = _loop(rate, 0.0).margin()
    crossings = np.sqrt(np.roots([1.0, -7.0, 7.0]).real)
    phases = [np.angle(-3.0 / (4.0 - w**2 + 1j * w)) % (2.0 * np.pi) for w in crossings]
    assert found.unstable_roots == 0
    assert found.delay == pytest.approx(min(phases / crossings), rel=1e-6)
