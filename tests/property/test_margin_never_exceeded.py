"""No delay that is certified and stable exceeds the exact margin; published ones do."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.plants import Comparison, compare
from sealag.margin import delay_margin, random_sea_plant
from sealag.passivity import max_delay_from_stiffness

PLANTS = 1000


@pytest.fixture(scope="module")
def corpus() -> list[Comparison]:
    return [compare(seed) for seed in range(PLANTS)]


def exceeded(corpus: list[Comparison], bound: Callable[[Comparison], float | None]) -> int:
    bounds = [(bound(item), item.margin) for item in corpus]
    return sum(value is not None and value > margin for value, margin in bounds)


def test_certified_and_stable_never_exceeds_the_margin(corpus: list[Comparison]) -> None:
    spoken = [item for item in corpus if item.certified is not None]
    assert len(spoken) > PLANTS // 4
    assert {len(item.plant.K) for item in spoken} == {1, 2, 3, 4, 5, 6}
    assert exceeded(corpus, lambda item: item.certified) == 0


def test_published_criterion_exceeds_it(corpus: list[Comparison]) -> None:
    assert exceeded(corpus, lambda item: item.published) > PLANTS // 10
    by_form = [item for item in corpus if item.plant.form == "published" and not item.plant.G.any()]
    assert exceeded(by_form, lambda item: item.published) > 0


def test_check_sees_a_bound_that_is_too_long(corpus: list[Comparison]) -> None:
    def longer(item: Comparison) -> float | None:
        return None if item.certified is None else 1.3 * item.certified

    assert exceeded(corpus, longer) > 0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(10_000, 2**31), joints=st.integers(1, 4))
def test_drawn_plants_are_never_over_certified(seed: int, joints: int) -> None:
    plant = random_sea_plant(seed, joints=joints)
    if plant.certifiable and plant.stable:
        bound = max_delay_from_stiffness(plant.F, plant.D_theta).delay
        assert bound <= delay_margin(plant.A_0, plant.A_1, symmetries=plant.symmetries).delay


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31), rate=st.floats(1e-3, 1e3))
def test_faster_time_shortens_the_margin(seed: int, rate: float) -> None:
    plant = random_sea_plant(seed, joints=2, form="symmetric")
    known = {"symmetries": plant.symmetries}
    slow = delay_margin(plant.A_0, plant.A_1, **known)
    fast = delay_margin(rate * plant.A_0, rate * plant.A_1, **known)
    np.testing.assert_allclose(rate * fast.first_crossing, slow.first_crossing, rtol=1e-6)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31))
def test_other_coordinates_do_not_change_it(seed: int) -> None:
    plant = random_sea_plant(seed, joints=2, form="symmetric")
    T = np.eye(8) + 0.3 * np.random.default_rng(seed).normal(size=(8, 8))
    if np.linalg.cond(T) > 1e3:
        return
    turned = [np.linalg.solve(T, A @ T) for A in (plant.A_0, plant.A_1)]
    before = delay_margin(plant.A_0, plant.A_1, symmetries=plant.symmetries)
    after = delay_margin(*turned, symmetries=np.linalg.solve(T, plant.symmetries))
    np.testing.assert_allclose(after.first_crossing, before.first_crossing, rtol=1e-5)
