"""Crossings next to zero frequency, and the directions of crossings that almost touch."""

import math

import numpy as np
import pytest

from sealag.margin import delay_margin


@pytest.mark.parametrize("excess", [1e-3, 1e-8, 1e-12, 2.0**-52])
def test_slow_crossing_is_found(excess: float) -> None:
    """ẋ = −x − b x(t − d), b just above 1: ω² = b² − 1, cos ωd = −1/b."""
    b = 1.0 + excess
    answer = delay_margin([[-1.0]], [[-b]])
    omega = math.sqrt((b - 1.0) * (b + 1.0))
    assert answer.delay == pytest.approx((math.pi - math.atan(omega)) / omega, rel=1e-6)
    assert answer.guaranteed


def test_touch_at_zero_frequency_takes_for_ever() -> None:
    for b in (1.0, 1.0 - 1e-8, 1.0 - 2.0**-53):
        answer = delay_margin([[-1.0]], [[-b]])
        assert (answer.delay, answer.crossings, answer.guaranteed) == (math.inf, (), True)


def test_touch_that_rounding_cannot_tell_is_not_guaranteed() -> None:
    """Beside a symmetry the matrices are projected, and no longer exactly the user's."""
    rest = np.diag([-1.0, 0.0])
    answer = delay_margin(rest, rest, symmetries=[[0.0], [1.0]])
    assert answer.delay == math.inf
    assert not answer.guaranteed
    assert delay_margin(rest, 0.999 * rest, symmetries=[[0.0], [1.0]]).guaranteed


@pytest.mark.parametrize("gap", [1e-4, 1e-8, 1e-12])
def test_almost_unstable_loop_has_its_short_margin(gap: float) -> None:
    """ẋ = a x − x(t − d), a just below 1: ω² = 1 − a², cos ωd = a, so d → 1."""
    a = 1.0 - gap
    answer = delay_margin([[a]], [[-1.0]])
    omega = math.sqrt((1.0 - a) * (1.0 + a))
    assert answer.unstable_roots == 0
    assert answer.delay == pytest.approx(math.atan2(omega, a) / omega, rel=1e-6)


def test_slow_crossing_survives_a_change_of_coordinates() -> None:
    b, fast = 1.0 + 1e-6, [3.0, 40.0, 200.0]
    T = np.random.default_rng(3).normal(size=(4, 4))
    A_0, A_1 = np.diag([-1.0, *(-f for f in fast)]), np.diag([-b, 0.1, 0.2, -0.3])
    answer = delay_margin(*(np.linalg.solve(T, A @ T) for A in (A_0, A_1)))
    omega = math.sqrt(b * b - 1.0)
    assert answer.delay == pytest.approx(math.acos(-1.0 / b) / omega, rel=1e-6)


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("excess", [1e-7, 1e-9])
def test_crossings_that_almost_touch_have_directions(copies: int, excess: float) -> None:
    """ẍ + ẋ + b ẋ(t − d) + x = 0, b just above 1: (1 − ω²)² = (b² − 1) ω², two crossings."""
    b = 1.0 + excess
    loop = ([[0, 1], [-1, -1]], [[0, 0], [0, -b]])
    answer = delay_margin(*(np.kron(np.eye(copies), A) for A in loop))
    root = math.sqrt(b * b - 1.0)
    slow, fast = (math.sqrt(1.0 + root**2 / 4.0) + side * root / 2.0 for side in (-1.0, 1.0))
    found = sorted(answer.crossings, key=lambda crossing: crossing.frequency)
    frequencies = [crossing.frequency for crossing in found]
    assert frequencies == pytest.approx([slow] * copies + [fast] * copies, rel=1e-9)
    assert [crossing.direction for crossing in found] == [-1] * copies + [1] * copies
    late = math.pi - math.atan2(fast * fast - 1.0, fast)
    assert answer.delay == pytest.approx(late / fast, rel=1e-7)


def test_what_almost_touches_from_the_other_side_has_no_crossing() -> None:
    answer = delay_margin([[0, 1], [-1, -1]], [[0, 0], [0, -(1.0 - 1e-9)]])
    assert (answer.delay, answer.guaranteed) == (math.inf, True)
