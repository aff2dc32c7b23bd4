"""Crossings next to zero frequency, and the directions of crossings that almost touch."""

import math

import flint
import numpy as np
import pytest

from humanoids2016 import random_sea_plant
from sealag.margin import DelayedLoop


@pytest.mark.parametrize("excess", [1e-3, 1e-8, 1e-12, 2.0**-52])
def test_slow_crossing_is_found(excess: float) -> None:
    """ẋ = −x − b x(t − d), b just above 1: ω² = b² − 1, cos ωd = −1/b."""
    b = 1.0 + excess
    answer = DelayedLoop([[-1.0]], [[-b]]).margin()
    omega = math.sqrt((b - 1.0) * (b + 1.0))
    assert answer.delay == pytest.approx((math.pi - math.atan(omega)) / omega, rel=1e-6)
    assert answer.guaranteed


def test_touch_at_zero_frequency_takes_for_ever() -> None:
    for b in (1.0, 1.0 - 1e-8, 1.0 - 2.0**-53):
        answer = DelayedLoop([[-1.0]], [[-b]]).margin()
        assert (answer.delay, answer.crossings, answer.guaranteed) == (math.inf, (), True)


def test_touch_that_rounding_cannot_tell_is_not_guaranteed() -> None:
    """Beside a symmetry the matrices are projected, and no longer exactly the user's."""
    rest = np.diag([-1.0, 0.0])
    answer = DelayedLoop(rest, rest, symmetries=[[0.0], [1.0]]).margin()
    assert answer.delay == math.inf
    assert not answer.guaranteed
    assert DelayedLoop(rest, 0.999 * rest, symmetries=[[0.0], [1.0]]).margin().guaranteed


@pytest.mark.parametrize("gap", [1e-4, 1e-8, 1e-12])
def test_almost_unstable_loop_has_its_short_margin(gap: float) -> None:
    """ẋ = a x − x(t − d), a just below 1: ω² = 1 − a², cos ωd = a, so d → 1."""
    a = 1.0 - gap
    answer = DelayedLoop([[a]], [[-1.0]]).margin()
    omega = math.sqrt((1.0 - a) * (1.0 + a))
    assert answer.unstable_roots == 0
    assert answer.delay == pytest.approx(math.atan2(omega, a) / omega, rel=1e-6)


def test_slow_crossing_survives_a_change_of_coordinates() -> None:
    b, fast = 1.0 + 1e-6, [3.0, 40.0, 200.0]
    T = np.random.default_rng(3).normal(size=(4, 4))
    A_0, A_1 = np.diag([-1.0, *(-f for f in fast)]), np.diag([-b, 0.1, 0.2, -0.3])
    answer = DelayedLoop(*(np.linalg.solve(T, A @ T) for A in (A_0, A_1))).margin()
    omega = math.sqrt(b * b - 1.0)
    assert answer.delay == pytest.approx(math.acos(-1.0 / b) / omega, rel=1e-6)


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("excess", [1e-7, 1e-9])
def test_crossings_that_almost_touch_have_directions(copies: int, excess: float) -> None:
    """ẍ + ẋ + b ẋ(t − d) + x = 0, b just above 1: (1 − ω²)² = (b² − 1) ω², two crossings."""
    b = 1.0 + excess
    loop = ([[0, 1], [-1, -1]], [[0, 0], [0, -b]])
    answer = DelayedLoop(*(np.kron(np.eye(copies), A) for A in loop)).margin()
    root = math.sqrt(b * b - 1.0)
    slow, fast = (math.sqrt(1.0 + root**2 / 4.0) + side * root / 2.0 for side in (-1.0, 1.0))
    found = sorted(answer.crossings, key=lambda crossing: crossing.frequency)
    frequencies = [crossing.frequency for crossing in found]
    assert frequencies == pytest.approx([slow] * copies + [fast] * copies, rel=1e-9)
    assert [crossing.direction for crossing in found] == [-1] * copies + [1] * copies
    late = math.pi - math.atan2(fast * fast - 1.0, fast)
    assert answer.delay == pytest.approx(late / fast, rel=1e-7)


def test_what_almost_touches_from_the_other_side_has_no_crossing() -> None:
    answer = DelayedLoop([[0, 1], [-1, -1]], [[0, 0], [0, -(1.0 - 1e-9)]]).margin()
    assert (answer.delay, answer.guaranteed) == (math.inf, True)


def _off(A_0, A_1, delay: float, frequency: float) -> float:
    """Newton's relative step to det(jω − A_0 − e^{-jφ} A_1) = 0 with φ = ωd, in 300 bits."""
    n, small = len(A_0), flint.arb(2) ** -120

    def determinant(phi: flint.arb, omega: flint.arb) -> flint.acb:
        turned = flint.acb(0, -phi).exp()
        rows = [
            [flint.acb(-A_0[i, j], omega * (i == j)) - turned * A_1[i, j] for j in range(n)]
            for i in range(n)
        ]
        return flint.acb_mat(rows).det()

    with flint.ctx.workprec(300):
        omega = flint.arb(frequency)
        phi = omega * flint.arb(delay)
        here = determinant(phi, omega)
        by_phi = (determinant(phi + small, omega) - here) / small
        by_omega = (determinant(phi, omega + small) - here) / small
        area = (by_omega.conjugate() * by_phi).imag
        steps = (
            (by_omega.conjugate() * here).imag / area / phi,
            (here * by_phi.conjugate()).imag / area / omega,
        )
        return max(abs(float(step.mid())) for step in steps)


@pytest.mark.parametrize("slow", [1e-4, 1e-6])
@pytest.mark.parametrize("seed", [0, 3, 5, 9])
def test_slow_root_beside_fast_ones_is_refined(seed: int, slow: float) -> None:
    """ẋ = −s (x + 1.5 x(t − d)), ω = s √1.25, mixed with modes up to 2000 1/s."""
    T = np.random.default_rng(seed).normal(size=(6, 6))
    loop = (
        np.diag([-slow, -30.0, -100.0, -300.0, -1000.0, -2000.0]),
        np.diag([-1.5 * slow, 1.0, 2.0, -3.0, 4.0, -5.0]),
    )
    A_0, A_1 = (np.linalg.solve(T, A @ T) for A in loop)
    answer = DelayedLoop(A_0, A_1).margin()
    assert answer.guaranteed
    assert len(answer.crossings) == 1
    omega = slow * math.sqrt(1.25)
    assert answer.delay == pytest.approx(math.acos(-1.0 / 1.5) / omega, rel=1e-4)
    assert _off(A_0, A_1, answer.delay, answer.frequency) < 1e-6


@pytest.mark.parametrize(("seed", "count"), [(406, 3), (927, 4), (937, 4)])
def test_crossing_of_a_soft_direction_is_refined(seed: int, count: int) -> None:
    plant = random_sea_plant(seed)
    answer = DelayedLoop(plant.A_0, plant.A_1, symmetries=plant.symmetries).margin()
    assert answer.guaranteed
    assert len(answer.crossings) == count
    one = answer.crossings[-1]
    assert _off(plant.A_0, plant.A_1, one.delay, one.frequency) < 1e-9
    assert _off(plant.A_0, plant.A_1, (1.0 + 2e-9) * one.delay, one.frequency) > 1e-9


def test_roots_confirm_the_margin_beside_a_slow_crossing() -> None:
    plant = random_sea_plant(927)
    answer = DelayedLoop(plant.A_0, plant.A_1).margin()
    assert answer.unstable_roots == (np.linalg.eigvals(plant.A_0 + plant.A_1).real >= 0.0).sum()
    below, above = (
        DelayedLoop(plant.A_0, plant.A_1).roots(share * answer.delay)[0] for share in (0.999, 1.0)
    )
    assert below.real < 0.0
    assert above.real == pytest.approx(0.0, abs=1e-8)
    assert abs(above.imag) == pytest.approx(answer.frequency, rel=1e-8)


def test_a_slow_crossing_ends_a_stable_range():
    """ẋ = a x − x(t − d), a = 1 − 1e-8: after 1 s, at a turn of 1.4e-4 rad, no zero root."""
    a = 1.0 - 1e-8
    omega = math.sqrt((1.0 - a) * (1.0 + a))
    answer = DelayedLoop([[a]], [[-1.0]]).margin(horizon=3.0)
    assert answer.delay == pytest.approx(math.atan2(omega, a) / omega, rel=1e-7)
    assert [one.unstable_roots for one in answer.intervals] == [0, 2]
    assert answer.intervals[0].upper == answer.delay
    assert answer.intervals[1].upper == 3.0


def test_a_root_that_starts_on_the_axis_comes_back_after_a_period():
    """ẍ = −0.7 x − 0.3 x(t − d): ±j without delay, right at once, from the left again at 2π."""
    answer = DelayedLoop([[0.0, 1.0], [-0.7, 0.0]], [[0.0, 0.0], [-0.3, 0.0]]).margin()
    assert (answer.delay, answer.unstable_roots) == (0.0, 2)
    assert answer.first_crossing == pytest.approx(2.0 * math.pi)
