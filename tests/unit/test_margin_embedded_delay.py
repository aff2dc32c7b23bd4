"""A second, fixed delay in the loop: ẋ = A_0 x + A_1 x(t − d) + A_e x(t − e)."""

import math

import numpy as np
import pytest

from humanoids2016 import random_sea_plant
from sealag.errors import InputError, SolverError
from sealag.margin import DelayedLoop


def collocated(A_0, A_1, A_e, d: float, e: float, *, nodes: int = 44) -> np.ndarray:
    """Roots by one Chebyshev grid over the longer delay, the shorter one interpolated."""
    longest = max(d, e)
    x = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    ends = np.isin(np.arange(nodes + 1), (0, nodes))
    c = np.where(ends, 0.5, 1.0) * (-1.0) ** np.arange(nodes + 1)
    D = np.outer(1.0 / c, c) / (x[:, None] - x + np.eye(nodes + 1))
    D = (D - np.diag(D.sum(axis=1))) * 2.0 / longest
    past = longest * (x - 1.0) / 2.0

    def at(age: float) -> np.ndarray:
        away = -age - past
        if (hit := np.abs(away) < 1e-14 * longest).any():
            return hit.astype(float)
        return (c / away) / (c / away).sum()

    n = len(A_0)
    generator = np.kron(D, np.eye(n))
    generator[:n] = np.kron(at(0.0), A_0) + np.kron(at(d), A_1) + np.kron(at(e), A_e)
    return np.linalg.eigvals(generator)


def drive(seed: int, *, joints: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A random plant a third of whose motor-side torque is measured late."""
    plant = random_sea_plant(seed, joints=joints)
    late = np.zeros_like(plant.A_0)
    late[3 * joints :] = plant.A_0[3 * joints :] / 3.0
    return plant.A_0 - late, plant.A_1, late


def test_two_delays_of_one_integrator() -> None:
    """ẋ = −a x(t − e) − b x(t − d): b² = a² + ω² − 2aω sin ωe, solved by bisection."""
    a, b, e = 0.7, 1.3, 0.4
    low, high = 0.0, 5.0
    for _ in range(200):
        omega = (low + high) / 2.0
        if a * a + omega * omega - 2.0 * a * omega * math.sin(omega * e) < b * b:
            low = omega
        else:
            high = omega
    z = -(1j * omega + a * np.exp(-1j * omega * e)) / b
    answer = DelayedLoop([[0.0]], [[-b]], A_e=[[-a]], embedded_delay=e).margin()
    assert answer.frequency == pytest.approx(omega, rel=1e-10)
    assert answer.delay == pytest.approx(-np.angle(z) % (2.0 * math.pi) / omega, rel=1e-10)
    assert answer.guaranteed
    assert answer.delay != pytest.approx(DelayedLoop([[-a]], [[-b]]).margin().delay, rel=1e-2)


@pytest.mark.parametrize(("e", "count"), [(1.5, 0), (1.6, 2), (7.8, 2), (7.9, 4)])
def test_roots_without_delay_have_the_embedded_one_in_place(e: float, count: int) -> None:
    """ẋ = −x(t − e) loses a pair at e = π/2 + 2πk."""
    answer = DelayedLoop([[0.0]], [[-1e-3]], A_e=[[-1.0]], embedded_delay=e).margin()
    assert answer.unstable_roots == count
    assert (answer.delay > 0.0) == (count == 0)


def test_without_an_embedded_part_or_its_delay_it_is_the_one_delay_loop() -> None:
    A_0, A_1, A_e = drive(0)
    whole = DelayedLoop(A_0 + A_e, A_1).margin()
    none = DelayedLoop(A_0 + A_e, A_1, A_e=0.0 * A_e, embedded_delay=0.02).margin()
    at_once = DelayedLoop(A_0, A_1, A_e=A_e).margin()
    soon = DelayedLoop(A_0, A_1, A_e=A_e, embedded_delay=1e-9).margin()
    late = DelayedLoop(A_0, A_1, A_e=A_e, embedded_delay=2e-2).margin()
    assert none.first_crossing == whole.first_crossing
    assert at_once.first_crossing == pytest.approx(whole.first_crossing, rel=1e-9)
    assert soon.first_crossing == pytest.approx(whole.first_crossing, rel=1e-6)
    assert soon.unstable_roots == whole.unstable_roots
    assert late.first_crossing != pytest.approx(whole.first_crossing, rel=1e-4)


@pytest.mark.parametrize("seed", [0, 2, 3, 7, 8, 9])
def test_crossing_and_count_agree_with_collocation(seed: int) -> None:
    loop, e = drive(seed), 0.01
    answer = DelayedLoop(*loop[:2], A_e=loop[2], embedded_delay=e).margin()
    start = collocated(*loop, 1e-7, e)
    assert int((start.real > 0.0).sum()) == answer.unstable_roots
    assert math.isfinite(answer.first_crossing)
    d, root = answer.first_crossing, 1j * answer.frequency
    if answer.frequency * d < 30.0:
        assert np.abs(collocated(*loop, d, e) - root).min() < 1e-5 * abs(root)
        assert np.abs(collocated(*loop, 1.1 * d, e) - root).min() > 1e-4 * abs(root)
    own = DelayedLoop(*loop[:2], A_e=loop[2], embedded_delay=e).roots(d, count=12)
    assert np.abs(own - root).min() < 1e-8 * abs(root)


def test_unstable_count_grows_at_the_first_crossing() -> None:
    loop, e = drive(3), 0.01
    answer = DelayedLoop(*loop[:2], A_e=loop[2], embedded_delay=e).margin(horizon=0.5, confirm=True)
    for part in answer.intervals[:3]:
        middle = (part.lower + part.upper) / 2.0
        roots = DelayedLoop(*loop[:2], A_e=loop[2], embedded_delay=e).roots(middle, count=12)
        assert int((roots.real > 0.0).sum()) == part.unstable_roots


def test_symmetries_are_divided_out_with_the_embedded_part() -> None:
    A_0, A_1, A_e = drive(0)
    wide = [np.zeros((5, 5)) for _ in range(3)]
    for one, part in zip(wide, (A_0, A_1, A_e), strict=True):
        one[:4, :4] = part
    wide[0][4, :4] = 1.0
    free = np.eye(5)[:, [4]]
    known = DelayedLoop(A_0, A_1, A_e=A_e, embedded_delay=0.01).margin()
    answer = DelayedLoop(*wide[:2], A_e=wide[2], embedded_delay=0.01, symmetries=free).margin()
    assert answer.neutral == 1
    assert answer.delay == pytest.approx(known.delay, rel=1e-8)
    wide[2][4, 4] = -1.0
    with pytest.raises(SolverError, match="no symmetry of the loop"):
        DelayedLoop(*wide[:2], A_e=wide[2], embedded_delay=0.01, symmetries=free).margin()


def test_an_embedded_part_of_zeros_is_none() -> None:
    A_0, A_1, A_e = drive(0)
    none = DelayedLoop(A_0, A_1, A_e=0.0 * A_e, embedded_delay=0.01).margin()
    assert none.delay == DelayedLoop(A_0, A_1).margin().delay


def test_embedded_part_is_checked() -> None:
    with pytest.raises(InputError, match="A_e has shape"):
        DelayedLoop([[0.0]], [[-1.0]], A_e=[1.0], embedded_delay=0.1).margin()
    with pytest.raises(InputError, match="without an A_e"):
        DelayedLoop([[0.0]], [[-1.0]], embedded_delay=0.1).margin()
    with pytest.raises(InputError, match="embedded_delay is -0"):
        DelayedLoop([[0.0]], [[-1.0]], A_e=[[1.0]], embedded_delay=-0.1).margin()


def test_what_feeds_back_late_counts_without_delay_too():
    """ẋ = −x − 0.1 x(t − d) + 2 x(t − e) grows for any e."""
    loop = {"A_0": [[-1.0]], "B": [[-0.1]], "embedded_delay": 1e-3}
    grows = DelayedLoop(**loop, A_e=[[2.0]]).margin()
    assert (grows.delay, grows.unstable_roots) == (0.0, 1)
    assert DelayedLoop(**loop, A_e=[[-2.0]]).margin().unstable_roots == 0


def test_roots_of_an_endless_embedded_delay_are_counted_and_not_listed() -> None:
    """A pair crosses at e = π/2 + 2πk: a list of them would need terabytes."""
    answer = DelayedLoop([[0.0]], [[0.0]], A_e=[[-1.0]], embedded_delay=1e12).margin()
    assert answer.unstable_roots == pytest.approx(1e12 / np.pi, rel=1e-9)
    answer = DelayedLoop([[0.0]], [[0.0]], A_e=[[-1.0]], embedded_delay=100.0).margin()
    assert answer.unstable_roots == 2 * np.ceil((100.0 - np.pi / 2) / (2.0 * np.pi))
