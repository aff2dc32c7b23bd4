"""Links and delay lines: what arrives when, in which order, and how old it may get."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sealag.delay import Constant, DelayLine, Link, PacketOrder, Sinusoid, Table
from sealag.errors import InputError

PERIOD = 1e-3


def _line(link, *, width=1, receive_period=PERIOD, seed=0):
    return DelayLine(
        link,
        width=width,
        period=PERIOD,
        receive_period=receive_period,
        rng=np.random.default_rng(seed),
    )


def _ages(link, steps=3000, seed=0):
    """Send the time itself; return how old what the receiver holds is at every tick."""
    line, out, ages = _line(link, seed=seed), np.zeros(1), []
    line.fill(np.zeros(1))
    for k in range(steps):
        t = k * PERIOD
        line.send(t, np.array([t]))
        line.receive(t, out)
        ages.append(t - out[0])
    return np.array(ages)


def test_no_delay_arrives_at_once():
    assert (_ages(Link(delay=Constant(value=0.0))) == 0).all()


def test_constant_delay_is_exact_on_the_grid():
    ages = _ages(Link(delay=Constant(value=0.013)))
    np.testing.assert_allclose(ages[13:], 0.013, atol=1e-12)
    np.testing.assert_allclose(ages[:13], PERIOD * np.arange(13), atol=1e-12)  # holds the past


def test_delay_between_ticks_rounds_up():
    ages = _ages(Link(delay=Constant(value=0.0125)))
    np.testing.assert_allclose(ages[13:], 0.013, atol=1e-12)


def test_time_varying_delay_follows_the_signal():
    signal = Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=1.0)
    ages = _ages(Link(delay=signal))[100:]
    sent = np.arange(100, 3000) * PERIOD - ages
    late = signal.at(sent)
    assert (ages >= late - 1e-9).all()
    assert (ages <= late + 2 * PERIOD).all()


def test_recorded_delays_are_replayed():
    recorded = Table(time=np.arange(5) * PERIOD, delay=np.array([3, 1, 4, 1, 5]) * PERIOD)
    link = Link(delay=recorded)
    times = np.arange(5) * PERIOD
    arrivals = link.arrivals(times, np.random.default_rng(0))
    np.testing.assert_allclose(arrivals, times + recorded.delay)


class TestOrder:
    """Packets 0 … 4 arrive at ticks 3, 2, 6, 4, 9."""

    arrivals = Table(time=np.arange(5) * PERIOD, delay=np.array([3, 1, 4, 1, 5]) * PERIOD)

    def _held(self, order):
        line, out, held = _line(Link(delay=self.arrivals, order=order)), np.zeros(1), []
        line.fill(np.array([-1.0]))
        for k in range(10):
            line.send(k * PERIOD, np.array([float(k)]))
            line.receive(k * PERIOD, out)
            held.append(out[0])
        return held[:10]

    def test_fifo_waits(self):
        assert self._held(PacketOrder.FIFO)[:9] == [-1, -1, -1, 1, 1, 1, 3, 3, 3]

    def test_newest_discards_the_overtaken(self):
        assert self._held(PacketOrder.NEWEST)[:9] == [-1, -1, 1, 1, 3, 3, 3, 3, 3]

    def test_arrival_takes_them_as_they_come(self):
        assert self._held(PacketOrder.ARRIVAL)[:9] == [-1, -1, 1, 0, 3, 3, 2, 2, 2]


@settings(max_examples=25, deadline=None)
@given(
    delay=st.floats(0, 0.02),
    jitter=st.floats(0, 0.01),
    loss=st.floats(0, 0.6),
    burst=st.integers(1, 5),
    order=st.sampled_from(list(PacketOrder)),
    seed=st.integers(0, 99),
)
def test_age_never_exceeds_its_bound(delay, jitter, loss, burst, order, seed):
    link = Link(delay=Constant(value=delay), jitter=jitter, loss=loss, max_burst=burst, order=order)
    ages = _ages(link, steps=400, seed=seed)
    assert ages.max() <= link.age_bound(PERIOD) + 1e-12


def test_burst_bound_is_needed():
    """Negative control: without the losses in a row the age would exceed its bound."""
    link = Link(delay=Constant(value=0.0), loss=0.6, max_burst=4)
    ages = _ages(link)
    assert ages.max() == pytest.approx(4 * PERIOD)
    assert ages.max() > Link(delay=Constant(value=0.0)).age_bound(PERIOD)


def test_losses_have_their_rate_and_bursts_their_limit_across_blocks():
    link = Link(delay=Constant(value=0.0), loss=0.3, max_burst=3)
    ages = _ages(link, steps=5000) / PERIOD
    assert np.mean(ages > 0.5) == pytest.approx(0.3, abs=0.03)
    assert ages.max() == pytest.approx(3.0)


def test_ring_is_long_enough_for_a_slow_receiver():
    line = _line(Link(delay=Constant(value=0.02)), receive_period=0.05)
    out = np.zeros(1)
    for k in range(1000):
        line.send(k * PERIOD, np.array([k * PERIOD]))
        if k % 50 == 49:
            line.receive(k * PERIOD, out)
            assert k * PERIOD - out[0] == pytest.approx(0.02)


def test_memory_is_allocated_once():
    line = _line(Link(delay=Constant(value=0.02), jitter=0.01), width=40)
    ring, row, out = line._values, np.zeros(40), np.zeros(40)
    for k in range(3000):
        line.send(k * PERIOD, row)
        line.receive(k * PERIOD, out)
    assert line._values is ring
    assert len(ring) < 60


@pytest.mark.parametrize(
    "changes",
    [{"jitter": -1e-3}, {"jitter": np.nan}, {"loss": 1.0}, {"loss": -0.1}, {"max_burst": 0}],
)
def test_refused(changes):
    with pytest.raises(InputError):
        Link(delay=Constant(value=0.0), **changes)
    with pytest.raises(InputError, match="period"):
        DelayLine(
            Link(delay=Constant(value=0.0)),
            width=1,
            period=0.0,
            receive_period=PERIOD,
            rng=np.random.default_rng(0),
        )
