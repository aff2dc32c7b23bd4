"""Whether a loop loses stability within a given delay, and how much work that saves."""

import math

import numpy as np
import pytest

from humanoids2016 import random_sea_plant
from sealag.errors import InputError
from sealag.margin import DelayedLoop

PLANTS = [random_sea_plant(seed, joints=2) for seed in range(12)]


@pytest.mark.parametrize("plant", PLANTS)
def test_it_is_the_margin_or_longer(plant) -> None:
    known = {"symmetries": plant.symmetries}
    whole = DelayedLoop(plant.A_0, plant.A_1, **known).margin()
    limit = 1.0001 * whole.first_crossing if math.isfinite(whole.first_crossing) else 3.0
    within = DelayedLoop(plant.A_0, plant.A_1, **known).margin(at_most=limit)
    assert within.delay == pytest.approx(whole.delay, rel=1e-9)
    assert within.first_crossing == pytest.approx(whole.first_crossing, rel=1e-9)
    assert within.unstable_roots == whole.unstable_roots
    short = DelayedLoop(plant.A_0, plant.A_1, **known).margin(at_most=0.9999 * limit)
    assert short.first_crossing == math.inf
    assert short.searched_to == 0.9999 * limit
    assert short.delay == (0.0 if whole.unstable_roots else math.inf)
    assert whole.searched_to == math.inf


@pytest.mark.parametrize(("limit", "delay"), [(1.0, math.inf), (1.6, math.pi / 2)])
def test_a_margin_beyond_the_limit_is_not_given(limit, delay) -> None:
    answer = DelayedLoop([[0.0]], [[-1.0]]).margin(at_most=limit)
    assert answer.delay == pytest.approx(delay)


def counted(monkeypatch) -> list[int]:
    """The sizes of all eigenvalue problems from now on: one a sample, and few besides."""
    samples, eig = [], np.linalg.eig

    def counting(A):
        samples.append(len(A))
        return eig(A)

    monkeypatch.setattr(np.linalg, "eig", counting)
    return samples


def test_a_short_limit_needs_fewer_samples(monkeypatch) -> None:
    samples = counted(monkeypatch)
    plant = PLANTS[4]
    whole = DelayedLoop(plant.A_0, plant.A_1).margin()
    all_of_them = len(samples)
    samples.clear()
    DelayedLoop(plant.A_0, plant.A_1).margin(at_most=0.01 * whole.first_crossing)
    assert 0 < len(samples) < all_of_them / 2


def test_a_crossing_costs_few_samples(monkeypatch) -> None:
    """Scalar loops ẋ = −b x − a x(t − d), mixed: ω² = a² − b², cos ωd = −b/a."""
    samples = counted(monkeypatch)
    b, a = np.geomspace(0.01, 10.0, 12), np.geomspace(0.02, 25.0, 12)
    Q = np.linalg.qr(np.random.default_rng(5).normal(size=(12, 12)))[0]
    answer = DelayedLoop(-Q @ np.diag(b) @ Q.T, -Q @ np.diag(a) @ Q.T).margin()
    found = sorted(answer.crossings, key=lambda crossing: crossing.frequency)
    omega = np.sqrt(a**2 - b**2)
    np.testing.assert_allclose([c.frequency for c in found], omega, rtol=1e-9)
    np.testing.assert_allclose([c.delay for c in found], np.arccos(-b / a) / omega, rtol=1e-9)
    assert 12 <= len(samples) < 20 * len(found)


def test_a_dense_delayed_part_costs_few_samples(monkeypatch) -> None:
    samples = counted(monkeypatch)
    rng = np.random.default_rng(1)
    A_0, A_1 = (rng.normal(size=(40, 40)) / math.sqrt(40.0) for _ in range(2))
    answer = DelayedLoop(A_0 - 1.2 * np.eye(40), A_1).margin()
    assert answer.guaranteed
    assert len(samples) < 300


def test_limits_are_checked() -> None:
    with pytest.raises(InputError, match="at_most is -1"):
        DelayedLoop([[0.0]], [[-1.0]]).margin(at_most=-1.0)
    with pytest.raises(InputError, match="intervals need"):
        DelayedLoop([[0.0]], [[-1.0]]).margin(at_most=1.0, intervals=True)
