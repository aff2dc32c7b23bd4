"""Actuators, transparency and delay signals against closed forms."""

import numpy as np
import pytest

from sealag.actuation import actuators, deviation_rms, torque_transfer, transparency
from sealag.delay import (
    Constant,
    Delays,
    Link,
    PacketOrder,
    RoundTrip,
    Sinusoid,
    Table,
    measured,
)
from sealag.errors import InputError

SPRING = {"spring_stiffness": 350.0, "rotor_inertia": 0.09, "motor_damping": 10.0}


def test_bandwidth_is_where_half_the_power_passes():
    joint = actuators(["a", "b"], **{**SPRING, "motor_damping": [1.0, 100.0]})
    answer = transparency(joint, delay=0.01)
    gain = np.abs(torque_transfer(joint, answer.bandwidth))
    np.testing.assert_allclose(np.diag(gain), np.sqrt(0.5), rtol=1e-12)
    assert answer.bandwidth[0] > answer.bandwidth[1], "damping costs bandwidth"
    slow = transparency(joint, delay=0.02)
    np.testing.assert_allclose(slow.phase_lag - answer.phase_lag, 2 * np.pi * 0.01, rtol=1e-9)


def test_inertia_shaping_is_a_factor():
    joint = actuators(["a"], **SPRING, inertia_shaping=0.5)
    assert joint.shaped_inertia[0] == 0.045
    assert joint.inertia_shaping[0] == 0.5


def test_deviation_is_a_root_mean_square():
    assert deviation_rms([[3.0], [4.0]], [[0.0], [0.0]])[0] == pytest.approx(np.sqrt(12.5))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, 0.0, [1.0, 2.0]])
@pytest.mark.parametrize("key", SPRING)
def test_bad_actuators_are_refused(key, bad):
    with pytest.raises(InputError, match=key):
        actuators(["a"], **{**SPRING, key: bad})


PAPER = Delays(
    central=Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=1.0),
    embedded=Sinusoid(mean=0.003, amplitude=0.002, angular_frequency=1.0),
)


def test_the_papers_delays():
    assert PAPER.d_1 == pytest.approx(0.0325)
    assert PAPER.d_0 == PAPER.d_1
    assert PAPER.d_2 == pytest.approx(0.0175)
    t = np.linspace(0, 20, 5001)
    assert PAPER.d_1_at(t).max() <= PAPER.d_1
    assert PAPER.d_1_at(t).max() == pytest.approx(PAPER.d_1, rel=1e-5)


def test_sampling_adds_its_hold():
    sampled = Delays(central=Constant(0.01), embedded=Constant(0.0), sample_time=0.002)
    assert sampled.d_1 == pytest.approx(0.012)
    assert sampled.d_2 == pytest.approx(0.007)


def test_ways_need_not_be_alike():
    """d_1 is the sum around the loop, d_2 what lies between controller and motor."""
    central = RoundTrip(up=Link(delay=Constant(0.002)), down=Link(delay=Constant(0.007)))
    embedded = RoundTrip(up=Link(delay=Constant(0.5)), down=Link(delay=Constant(0.001)))
    delays = Delays(central=central, embedded=embedded)
    assert delays.d_1 == pytest.approx(0.010)
    assert delays.d_2 == pytest.approx(0.008)
    assert delays.d_1_at(0.3) == pytest.approx(0.010)
    assert delays.central.mean == pytest.approx(0.009)
    assert delays.scaled(2.0).d_1 == pytest.approx(0.020)


def test_jitter_and_losses_count():
    plain = {"central": Constant(0.01), "embedded": Constant(0.0), "sample_time": 0.002}
    jitter = RoundTrip.halved(Constant(0.01), jitter=0.003)
    assert Delays(**{**plain, "central": jitter}).d_1 == pytest.approx(0.012 + 2 * 0.003)
    overtaken = RoundTrip.halved(Constant(0.01), jitter=0.003, order=PacketOrder.ARRIVAL)
    assert Delays(**{**plain, "central": overtaken}).d_1 == pytest.approx(0.012 + 4 * 0.003)
    lost = RoundTrip.halved(Constant(0.01), loss=0.1, max_burst=3)
    assert Delays(**{**plain, "central": lost}).d_1 == pytest.approx(0.012 + 2 * 3 * 0.002)
    looks = Delays(**plain, embedded_period=0.001)
    assert looks.d_1 == pytest.approx(0.012 + 3 * 0.001)
    with pytest.raises(InputError, match="period"):
        Delays(central=lost, embedded=Constant(0.0))
    with pytest.raises(InputError, match="embedded period"):
        Delays(**plain, embedded_period=0.003)
    with pytest.raises(InputError, match="factor"):
        looks.scaled(-1.0)


def test_table_and_samples():
    table = Table(time=np.array([0.0, 1.0, 3.0]), delay=np.array([0.01, 0.03, 0.01]))
    assert table.upper_bound == 0.03
    assert table.mean == pytest.approx(0.02)
    assert table.at(0.5) == pytest.approx(0.02)
    samples = measured([0.01, 0.02, 0.5], period=0.1, quantile=0.5)
    assert samples.upper_bound == pytest.approx(0.02)
    assert measured([0.01, 0.02, 0.5], period=0.1).upper_bound == 0.5


def test_bad_delays_are_refused():
    with pytest.raises(InputError, match="ms meant"):
        Constant(20.0)
    with pytest.raises(InputError, match="negative"):
        Constant(-0.01)
    with pytest.raises(InputError, match="amplitude"):
        Sinusoid(mean=0.01, amplitude=0.02, angular_frequency=1.0)
    with pytest.raises(InputError, match="increase"):
        Table(time=np.array([0.0, 0.0]), delay=np.array([0.01, 0.01]))
    with pytest.raises(InputError, match="at least one"):
        measured([], period=0.1)
