"""Actuators, transparency and delay signals against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from sealag.actuation import Actuators
from sealag.delay import (
    Constant,
    Delays,
    Link,
    PacketOrder,
    RoundTrip,
    Sinusoid,
    Table,
)
from sealag.errors import InputError, UnknownNameError

SPRING = {"spring_stiffness": 350.0, "rotor_inertia": 0.09, "motor_damping": 10.0}


def test_bandwidth_is_where_half_the_power_passes():
    joint = Actuators.of(["a", "b"], **{**SPRING, "motor_damping": [1.0, 100.0]})
    answer = joint.transparency(delay=0.01)
    s = 2j * np.pi * answer.bandwidth
    K, B_s, D = joint.spring_stiffness, joint.shaped_inertia, joint.motor_damping
    gain = np.abs(K / (B_s * s**2 + D * s + K))
    np.testing.assert_allclose(gain, np.sqrt(0.5), rtol=1e-12)
    assert answer.bandwidth[0] > answer.bandwidth[1], "damping costs bandwidth"
    np.testing.assert_allclose(answer.damping_ratio, D / (2.0 * np.sqrt(K * B_s)), rtol=1e-12)
    critical = Actuators.of(["a"], **{**SPRING, "motor_damping": 2.0 * np.sqrt(350.0 * 0.09)})
    assert critical.transparency().damping_ratio[0] == pytest.approx(1.0)
    slow = joint.transparency(delay=0.02)
    np.testing.assert_allclose(slow.phase_lag - answer.phase_lag, 2 * np.pi * 0.01, rtol=1e-9)


def test_inertia_shaping_is_a_factor():
    joint = Actuators.of(["a"], **SPRING, inertia_shaping=0.5)
    assert joint.shaped_inertia[0] == 0.045
    assert joint.inertia_shaping[0] == 0.5


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, 0.0, [1.0, 2.0]])
@pytest.mark.parametrize("key", SPRING)
def test_bad_actuators_are_refused(key, bad):
    with pytest.raises(InputError, match=key):
        Actuators.of(["a"], **{**SPRING, key: bad})


@pytest.mark.parametrize("key", SPRING)
def test_missing_and_unknown_quantities_are_named(key):
    rest = {name: value for name, value in SPRING.items() if name != key}
    with pytest.raises(InputError, match=f"{key} is missing"):
        Actuators.of(["a"], **rest)
    with pytest.raises(UnknownNameError, match="stifness"):
        Actuators.of(["a"], **SPRING, stifness=1.0)


PAPER = Delays(
    central=Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=1.0),
    embedded=Sinusoid(mean=0.003, amplitude=0.002, angular_frequency=1.0),
)


def test_the_papers_delays():
    assert PAPER.d_1 == pytest.approx(0.0325)
    assert PAPER.d_2 == pytest.approx(0.0175)
    t = np.linspace(0, 20, 5001)
    around = PAPER.central.at(t) + PAPER.embedded.down.delay.at(t)
    assert around.max() <= PAPER.d_1
    assert around.max() == pytest.approx(PAPER.d_1, rel=1e-5)


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
    assert delays.central.mean == pytest.approx(0.009)
    assert delays.central.at(0.3) == pytest.approx(0.009)
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


def test_late_torque_feedback_waits_for_its_own_way_up():
    """Its packets leave and are looked for once an embedded period: two waits."""
    up = Link(delay=Constant(0.003), jitter=0.001, loss=0.1, max_burst=2)
    embedded = RoundTrip(up=up, down=Link(delay=Constant(0.05)))
    plain = {"central": Constant(0.0), "embedded": embedded, "sample_time": 0.01}
    late = Delays(**plain, embedded_period=0.002, delayed_torque_feedback=True)
    assert late.torque_feedback_delay == pytest.approx(0.003 + 0.001 + 2 * 0.002 + 2 * 0.002)
    at_once = Delays(**plain, delayed_torque_feedback=True)
    assert at_once.torque_feedback_delay == pytest.approx(0.003 + 0.001 + 2 * 0.01)
    assert Delays(**plain).torque_feedback_delay is None


def test_every_part_of_d_1_and_d_2_counts_once():
    """Loss, jitter, bursts, periods and scale together, each link its own; then one part less."""
    late = {"up": (1e-3, 2e-4, 2), "down": (3e-3, 5e-4, 3), "drive": (7e-4, 3e-4, 5)}
    link = {
        name: Link(delay=Constant(d), jitter=j, loss=0.1, max_burst=b)
        for name, (d, j, b) in late.items()
    }
    unheard = Link(delay=Constant(0.4), jitter=0.4, loss=0.5, max_burst=9)  # torque's way up

    def both(period, scale=1.0, **changed):
        ways = {**link, **changed}
        delays = Delays(
            central=RoundTrip(up=ways["up"], down=ways["down"]),
            embedded=RoundTrip(up=unheard, down=ways["drive"]),
            sample_time=2e-3,
            embedded_period=period,
        )
        delays = delays if scale == 1.0 else delays.scaled(scale)
        return np.array([delays.d_1 - delays.d_2, delays.d_2])

    # Up and drive send at the embedded period, the master at the central one; three waits.
    np.testing.assert_allclose(
        both(5e-4),
        [1.2e-3 + 2 * 5e-4 + 5e-4, 3.5e-3 + 3 * 2e-3 + 1e-3 + 5 * 5e-4 + 2e-3 + 2 * 5e-4],
        rtol=1e-12,
    )
    # Without an embedded period all of them send once a central period, and nobody waits.
    np.testing.assert_allclose(
        both(0.0), [1.2e-3 + 2 * 2e-3, 3.5e-3 + 1e-3 + (3 + 5 + 1) * 2e-3], rtol=1e-12
    )
    # A scale takes delays and jitter along, neither periods nor bursts.
    np.testing.assert_allclose(
        both(0.0, scale=3.0),
        [3 * 1.2e-3 + 2 * 2e-3, 3 * (3.5e-3 + 1e-3) + (3 + 5 + 1) * 2e-3],
        rtol=1e-12,
    )
    whole = both(5e-4)
    for name, way in (("up", 0), ("down", 1), ("drive", 1)):
        for key, value, less in (
            ("jitter", 0.0, late[name][1]),
            ("delay", Constant(0.0), late[name][0]),
            ("max_burst", late[name][2] - 1, 2e-3 if name == "down" else 5e-4),
        ):
            gained = whole - both(5e-4, **{name: replace(link[name], **{key: value})})
            assert gained[way] == pytest.approx(less), (name, key)
            assert gained[1 - way] == 0.0


def test_packets_taken_as_they_come_count_as_overtaken():
    falling = Sinusoid(mean=0.01, amplitude=0.002, angular_frequency=100.0)  # 0.2 s/s
    link = Link(delay=falling, jitter=1e-3, order=PacketOrder.ARRIVAL)
    assert link.late_bound(0.0) == pytest.approx(0.012 + 1e-3 + 1e-3 / 0.8)
    steep = Link(delay=replace(falling, angular_frequency=600.0), order=PacketOrder.ARRIVAL)
    assert steep.late_bound(0.0) == pytest.approx(0.012 + 0.004)
    plain = Delays(central=RoundTrip(up=link, down=link), embedded=Constant(0.0))
    after = replace(plain, embedded=RoundTrip(up=link, down=link))
    grid = {"sample_time": 2e-3, "embedded_period": 1e-3}
    waits = replace(after, **grid).d_1 - replace(plain, **grid).d_1
    assert waits == pytest.approx(link.late_bound(0.0))
    # without a period of their own packets leave the master when they come: they may overtake more
    assert after.d_1 - plain.d_1 == pytest.approx(link.late_bound(0.0) + link.spread)


def test_bounds_of_every_signal():
    table = Table(time=np.array([0.0, 1.0, 3.0]), delay=np.array([0.01, 0.03, 0.01]))
    wave = Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=-3.0, phase=0.4)
    trip = RoundTrip(up=Link(delay=table), down=Link(delay=wave)).scaled(2.0)
    for signal, lower, upper, fall in (
        (Constant(0.02), 0.02, 0.02, 0.0),
        (wave, 0.01, 0.03, 0.03),
        (table, 0.01, 0.03, 0.01),
        (trip, 0.04, 0.12, 0.08),
    ):
        assert signal.lower_bound == pytest.approx(lower)
        assert signal.upper_bound == pytest.approx(upper)
        assert signal.steepest_fall == pytest.approx(fall)
        t = np.linspace(-1.0, 4.0, 5001)
        values = signal.at(t)
        if signal is wave:
            np.testing.assert_allclose(values, 0.02 + 0.01 * np.sin(0.4 - 3.0 * t), atol=1e-15)
        assert lower - 1e-12 <= values.min() <= values.max() <= upper + 1e-12
        assert np.diff(values).min() / (t[1] - t[0]) >= -fall - 1e-9


def test_table_and_samples():
    table = Table(time=np.array([0.0, 1.0, 3.0]), delay=np.array([0.01, 0.03, 0.01]))
    assert table.upper_bound == 0.03
    assert table.mean == pytest.approx(0.02)
    assert table.at(0.5) == pytest.approx(0.02)
    samples = Table.measured([0.01, 0.02, 0.5], period=0.1, quantile=0.5)
    assert samples.upper_bound == pytest.approx(0.02)
    assert samples.left_out == pytest.approx(1.0 / 3.0)
    assert Table.measured([0.01, 0.02, 0.5], period=0.1).upper_bound == 0.5


def test_overtaking_is_bounded_by_the_spread():
    """A delay that falls almost as fast as time passes lets packets arrive together."""
    for fall, overtaken in ((0.5, 0.004 / 0.5), (0.9, 0.004 + 0.02), (1.5, 0.004 + 0.02)):
        wave = Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=fall / 0.01)
        link = Link(delay=wave, jitter=0.004, order=PacketOrder.ARRIVAL)
        assert link.overtaken == pytest.approx(overtaken)
        assert replace(link, order=PacketOrder.NEWEST).overtaken == 0.0


def test_bad_delays_are_refused():
    with pytest.raises(InputError, match="add up to d_1 = 6000 ms"):
        Delays(central=Constant(4.0), embedded=Constant(4.0))
    with pytest.raises(InputError, match="20000 ms"):
        Constant(20.0)
    with pytest.raises(InputError, match="negative"):
        Constant(-0.01)
    with pytest.raises(InputError, match="amplitude"):
        Sinusoid(mean=0.01, amplitude=0.02, angular_frequency=1.0)
    with pytest.raises(InputError, match="increase"):
        Table(time=np.array([0.0, 0.0]), delay=np.array([0.01, 0.01]))
    with pytest.raises(InputError, match="at least one"):
        Table.measured([], period=0.1)
