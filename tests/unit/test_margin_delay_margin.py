"""The margin on systems whose answer is known, its structure, and what it refuses."""

import math

import numpy as np
import pytest

from humanoids2016 import random_sea_plant
from sealag.errors import InputError, SolverError
from sealag.margin import DelayedLoop

KNOWN = [
    ([[-2, 0], [0, -0.9]], [[-1, 0], [-1, -1]], math.acos(-0.9) / math.sqrt(0.19)),
    ([[0, 1], [-1, -1]], [[0, 0], [0, -1]], math.pi),
    ([[0, 1], [-1, -1]], [[0, 0], [-1, 0]], math.pi / 2),
    ([[0]], [[-1]], math.pi / 2),
    ([[-3, -2.5], [1, 0.5]], [[1.5, 2.5], [-0.5, -1.5]], 2.41840),
    ([[-1]], [[-0.5]], math.inf),
    ([[-1]], [[-1]], math.inf),
]


def one_joint(M: float, F: float, *, link: bool = False) -> tuple[np.ndarray, np.ndarray]:
    K, B, D = 350.0, 0.09, 10.0
    A_0 = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-K / M, K / M, 0, 0], [K / B, -K / B, 0, -D / B]])
    A_1 = np.zeros((4, 4))
    A_1[3, 0 if link else 1] = -F / B
    return A_0, A_1


@pytest.mark.parametrize(("A_0", "A_1", "expected"), KNOWN)
def test_known_margins_to_six_digits(A_0, A_1, expected: float) -> None:
    answer = DelayedLoop(A_0, A_1).margin(confirm=True)
    assert answer.delay == pytest.approx(expected, rel=1e-6)
    assert answer.guaranteed
    assert answer.residual < 1e-12


def test_delay_stabilised_system_lists_its_stable_interval() -> None:
    answer = DelayedLoop([[0, 1], [-2, 0.1]], [[0, 0], [1, 0]]).margin(intervals=True)
    assert (answer.delay, answer.unstable_roots) == (0.0, 2)
    assert answer.first_crossing == pytest.approx(1.717858, rel=1e-6)
    stable = [part for part in answer.intervals if part.unstable_roots == 0]
    assert [(part.lower, part.upper) for part in stable] == [
        (pytest.approx(0.100168, rel=3e-6), pytest.approx(1.717858, rel=1e-6))
    ]


def test_touching_root_has_no_direction_and_a_crossing_one_has() -> None:
    touching = DelayedLoop([[0, 1], [-1, -1]], [[0, 0], [0, -1]]).margin()
    assert [crossing.direction for crossing in touching.crossings] == [0]
    crossing = DelayedLoop([[0]], [[-1]]).margin()
    assert [item.direction for item in crossing.crossings] == [1]


@pytest.mark.parametrize(
    ("M", "K_q", "link", "expected"),
    [(1.0, 100.0, False, 0.0773), (5.0, 300.0, False, 0.00476), (5.0, 100.0, True, 0.0745)],
)
def test_one_joint_of_theory_6b(M: float, K_q: float, link: bool, expected: float) -> None:
    F = K_q if link else 1.0 / (1.0 / K_q - 1.0 / 350.0)
    assert DelayedLoop(*one_joint(M, F, link=link)).margin().delay == pytest.approx(
        expected, rel=2e-3
    )


def test_mode_solves_the_characteristic_equation() -> None:
    A_0, A_1 = one_joint(1.0, 140.0)
    answer = DelayedLoop(A_0, A_1).margin()
    s = 1j * answer.frequency
    P = s * np.eye(4) - A_0 - A_1 * np.exp(-s * answer.delay)
    assert np.abs(P @ answer.mode).max() < 1e-8 * np.abs(P).max()
    wrong = s * np.eye(4) - A_0 - A_1 * np.exp(-s * 1.01 * answer.delay)
    assert np.abs(wrong @ answer.mode).max() > 1e-6 * np.abs(P).max()


def test_symmetries_and_their_momentum_are_divided_out() -> None:
    """A joint of the loop beside a free-floating coordinate that drives nothing."""
    A_0, A_1 = one_joint(1.0, 140.0)
    wide_0, wide_1 = np.zeros((6, 6)), np.zeros((6, 6))
    wide_0[:4, :4], wide_1[:4, :4] = A_0, A_1
    wide_0[4, 5] = 1.0
    wide_0[5, :4] = A_0[2]
    T = np.random.default_rng(0).normal(size=(6, 6))
    mixed = [np.linalg.solve(T, A @ T) for A in (wide_0, wide_1)]
    direction = np.linalg.solve(T, np.eye(6)[:, [4]])
    answer = DelayedLoop(*mixed, symmetries=direction).margin()
    assert answer.neutral == 2
    assert answer.delay == pytest.approx(DelayedLoop(A_0, A_1).margin().delay, rel=1e-8)
    assert DelayedLoop(*mixed).margin().delay == 0.0
    with pytest.raises(SolverError, match="no symmetry of the loop"):
        DelayedLoop(*mixed, symmetries=np.eye(6)[:, [0]]).margin()


def test_neutral_equilibrium_that_is_not_declared_is_not_called_stable() -> None:
    answer = DelayedLoop([[-1.0]], [[1.0]]).margin()
    assert (answer.delay, answer.unstable_roots, answer.guaranteed) == (0.0, 1, False)


def test_identical_joints_cross_together() -> None:
    A_0, A_1 = one_joint(1.0, 140.0)
    twice = [np.kron(np.eye(2), A) for A in (A_0, A_1)]
    answer = DelayedLoop(*twice).margin(intervals=True)
    assert answer.delay == pytest.approx(DelayedLoop(A_0, A_1).margin().delay, rel=1e-9)
    assert answer.intervals[1].unstable_roots == 4


def test_no_delayed_part_and_nothing_left() -> None:
    assert DelayedLoop([[-1.0]], [[0.0]]).margin().delay == math.inf
    assert DelayedLoop([[1.0]], [[0.0]]).margin().delay == 0.0
    assert DelayedLoop([[0.0]], [[0.0]], symmetries=[[1.0]]).margin().delay == math.inf


@pytest.mark.parametrize("seed", range(6))
def test_intervals_agree_with_counted_roots(seed: int) -> None:
    plant = random_sea_plant(seed, joints=2)
    answer = DelayedLoop(plant.A_0, plant.A_1, symmetries=plant.symmetries).margin(
        intervals=True, horizon=1.0
    )
    for part in [part for part in answer.intervals if part.upper - part.lower > 1e-3][:4]:
        middle = (part.lower + min(part.upper, 1.0)) / 2.0
        roots = DelayedLoop(plant.A_0, plant.A_1, symmetries=plant.symmetries).roots(
            delay=middle, count=16
        )
        assert int((roots.real > 0.0).sum()) == part.unstable_roots


@pytest.mark.parametrize(
    ("A_0", "A_1"),
    [([[1, 2]], [[1, 2]]), ([[1]], np.eye(2)), ([[math.nan]], [[1]]), ([[1]], [[math.inf]])],
)
def test_unusable_matrices_are_refused(A_0, A_1) -> None:
    with pytest.raises(InputError):
        DelayedLoop(A_0, A_1).margin()


@pytest.mark.parametrize("delay", [-1.0, math.nan, math.inf])
def test_unusable_delay_is_refused(delay: float) -> None:
    with pytest.raises(InputError):
        DelayedLoop([[0]], [[-1]]).roots(delay=delay)
