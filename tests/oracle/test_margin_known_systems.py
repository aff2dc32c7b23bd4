"""Systems whose delay margin is known in closed form or from the literature."""

import math

import numpy as np
import pytest

from sealag.errors import InputError, SolverError
from sealag.margin import DelayedLoop

KNOWN = {
    "two lags": ([[-2, 0], [0, -0.9]], [[-1, 0], [-1, -1]], math.acos(-0.9) / math.sqrt(0.19)),
    "damped velocity": ([[0, 1], [-1, -1]], [[0, 0], [0, -1]], math.pi),
    "damped position": ([[0, 1], [-1, -1]], [[0, 0], [-1, 0]], math.pi / 2),
    "integrator": ([[0]], [[-1]], math.pi / 2),
    "touching": ([[-3, -2.5], [1, 0.5]], [[1.5, 2.5], [-0.5, -1.5]], 2.41840),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_margin(name):
    A_0, A_1, expected = KNOWN[name]
    margin = DelayedLoop(A_0, A_1).margin(confirm=name != "touching")
    assert margin.delay == pytest.approx(expected, rel=2e-6)
    assert margin.crossings[0].residual < 1e-9


def test_unstable_start_regains_stability():
    A_0, A_1 = [[0, 1], [-2, 0.1]], [[0, 0], [1, 0]]
    margin = DelayedLoop(A_0, A_1).margin(horizon=2.0)
    assert margin.delay == 0.0
    assert margin.unstable_roots == 2
    stable = [(a, b) for a, b, count in margin.intervals if count == 0]
    assert stable[0][0] == pytest.approx(0.100168, abs=1e-6)
    assert stable[0][1] == pytest.approx(1.717858, abs=1e-6)


def test_stable_for_every_delay():
    assert DelayedLoop([[-2.0]], [[1.0]]).margin().delay == math.inf
    assert DelayedLoop([[-2.0]], [[0.0]]).margin().delay == math.inf


def test_roots_agree_with_the_scalar_lambert_solution():
    from scipy.special import lambertw

    delay, gain = 0.7, -1.3
    roots = DelayedLoop([[0.0]], [[gain]]).roots(delay)
    exact = lambertw(gain * delay, 0) / delay
    assert abs(roots[0].real - exact.real) < 1e-9
    assert abs(abs(roots[0].imag) - abs(exact.imag)) < 1e-9


def test_symmetry_is_taken_out_by_structure():
    """A free mass beside a delayed loop: two zero roots that say nothing about stability."""
    A_0 = np.zeros((3, 3))
    A_0[0, 1] = 1.0
    A_1 = np.zeros((3, 3))
    A_1[2, 2] = -1.0
    free = np.array([[1.0], [0.0], [0.0]])
    assert DelayedLoop(A_0, A_1).margin().delay == 0.0
    margin = DelayedLoop(A_0, A_1, symmetries=free).margin()
    assert margin.delay == pytest.approx(math.pi / 2)
    assert margin.neutral == 2
    with pytest.raises(SolverError, match="no symmetry of the loop"):
        DelayedLoop(A_0, A_1, symmetries=np.array([[0.0], [0.0], [1.0]])).margin()


@pytest.mark.parametrize("factor", [1e-6, 1e-2, 1e3, 1e6])
def test_time_scales_with_the_matrices(factor):
    A_0, A_1, expected = KNOWN["two lags"]
    margin = DelayedLoop(factor * np.array(A_0, float), factor * np.array(A_1, float)).margin()
    assert margin.delay == pytest.approx(expected / factor, rel=1e-6)


def test_bad_matrices_are_refused():
    with pytest.raises(InputError, match="square"):
        DelayedLoop(np.zeros((2, 3)), np.zeros((2, 3))).margin()
    with pytest.raises(InputError, match="finite"):
        DelayedLoop([[np.nan]], [[1.0]]).margin()
