"""Links: what arrives when, in which order, and how old what the receiver holds may get."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sealag.delay import Constant, Link, PacketOrder, RoundTrip, Sinusoid, Table
from sealag.errors import InputError

PERIOD = 1e-3


def _ages(link, steps=3000, seed=0):
    """Send at every tick; return how old what the receiver holds is at every tick."""
    times = PERIOD * np.arange(steps)
    arrival = link.arrivals(times, np.random.default_rng(seed))
    return times - times[np.maximum(link.held(arrival, times), 0)]


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
    link = Link(delay=recorded, order="newest")
    times = np.arange(5) * PERIOD
    arrivals = link.arrivals(times, np.random.default_rng(0))
    np.testing.assert_allclose(arrivals, times + recorded.delay)


class TestOrder:
    """Packets 0 … 4 arrive at ticks 3, 2, 6, 4, 9."""

    delay = Table(time=np.arange(5) * PERIOD, delay=np.array([3, 1, 4, 1, 5]) * PERIOD)

    def _held(self, order):
        link, times = Link(delay=self.delay, order=order), PERIOD * np.arange(9)
        return link.held(link.arrivals(times[:5], np.random.default_rng(0)), times).tolist()

    def test_fifo_waits(self):
        assert self._held(PacketOrder.FIFO) == [-1, -1, -1, 1, 1, 1, 3, 3, 3]

    def test_newest_discards_the_overtaken(self):
        assert self._held(PacketOrder.NEWEST) == [-1, -1, 1, 1, 3, 3, 3, 3, 3]

    def test_arrival_takes_them_as_they_come(self):
        assert self._held(PacketOrder.ARRIVAL) == [-1, -1, 1, 0, 3, 3, 2, 2, 2]

    def test_takings_are_the_changes_of_what_is_held(self):
        link = Link(delay=self.delay, order=PacketOrder.ARRIVAL)
        arrival = link.arrivals(PERIOD * np.arange(5), np.random.default_rng(0))
        arrival[3] = np.inf
        instant, number = link.takings(arrival)
        assert number.tolist() == [1, 0, 2, 4]
        np.testing.assert_allclose(instant, PERIOD * np.array([2, 3, 6, 9]))


signals = st.one_of(
    st.builds(Constant, st.floats(0, 0.02)),
    st.builds(
        Sinusoid,
        mean=st.floats(0.01, 0.02),
        amplitude=st.floats(0, 0.01),
        angular_frequency=st.floats(1, 1000),  # falls faster than time runs, too
    ),
    st.builds(
        lambda delay: Table(time=5e-3 * np.arange(len(delay)), delay=np.array(delay)),
        st.lists(st.floats(0, 0.02), min_size=1, max_size=30),
    ),
)


@settings(max_examples=300, deadline=None)
@given(
    delay=signals,
    jitter=st.one_of(st.just(0.0), st.floats(0, 0.01)),
    loss=st.one_of(st.just(0.0), st.floats(0, 0.6)),
    burst=st.integers(1, 5),
    order=st.sampled_from(list(PacketOrder)),
    seed=st.integers(0, 99),
)
def test_age_never_exceeds_its_bound(delay, jitter, loss, burst, order, seed):
    link = Link(delay=delay, jitter=jitter, loss=loss, max_burst=burst, order=order)
    ages = _ages(link, steps=400, seed=seed)
    assert ages.max() <= link.late_bound(PERIOD) + PERIOD + 1e-12
    looks = PERIOD * np.arange(400)
    waited = looks - np.maximum(link.sent(looks, np.random.default_rng(seed)), 0.0)
    assert 0.0 <= waited.min() <= waited.max() <= link.late_bound(PERIOD) + 1e-12


@pytest.mark.parametrize("angular_frequency", [50.0, 2000.0])
def test_bound_of_packets_taken_as_they_come_is_needed(angular_frequency):
    """Negative control: without the part for overtaken packets the age would exceed it."""
    delay = Sinusoid(mean=0.01, amplitude=0.01, angular_frequency=angular_frequency)
    jitter = 5e-3 if angular_frequency < 100.0 else 0.0
    ages = [
        _ages(Link(delay=delay, jitter=jitter, order=order)).max()
        for order in (PacketOrder.NEWEST, PacketOrder.ARRIVAL)
    ]
    bounds = [
        Link(delay=delay, jitter=jitter, order=order).late_bound(PERIOD) + PERIOD
        for order in (PacketOrder.NEWEST, PacketOrder.ARRIVAL)
    ]
    assert ages[0] <= bounds[0] < ages[1] <= bounds[1]


class TestSentAtEveryInstant:
    def test_a_constant_delay_is_exact_off_the_grid(self):
        looks = PERIOD * np.arange(50)
        sent = Link(delay=Constant(0.0123456)).sent(looks, np.random.default_rng(0))
        np.testing.assert_allclose(looks - sent, 0.0123456, rtol=1e-13)

    def test_what_arrives_at_a_look_was_sent_by_the_signal_earlier(self):
        signal = Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=30.0)
        looks = PERIOD * np.arange(50, 500)
        sent = Link(delay=signal).sent(looks, np.random.default_rng(0))
        np.testing.assert_allclose(sent + signal.at(sent), looks, rtol=0, atol=1e-12)

    def test_jitter_and_losses_are_those_of_the_looks(self):
        looks = PERIOD * np.arange(4000)
        link = Link(delay=Constant(5e-3), jitter=1e-3, loss=0.3, max_burst=2, order="newest")
        ages = (looks - link.sent(looks, np.random.default_rng(0)))[10:] - 5e-3
        assert ages.min() >= 0.0
        assert 2 * PERIOD < ages.max() <= 1e-3 + 2 * PERIOD + 1e-12
        assert np.mean(ages > 1e-3) == pytest.approx(0.3, abs=0.05)

    @pytest.mark.parametrize("order", ["fifo", "newest", "arrival"])
    def test_states_grow_older_only_where_packets_are_taken_as_they_come(self, order):
        looks = PERIOD * np.arange(500)
        link = Link(delay=Constant(5e-3), jitter=4 * PERIOD, order=order)
        sent = link.sent(looks, np.random.default_rng(0))
        assert (np.diff(sent).min() < 0.0) == (order == "arrival")


def test_a_longer_run_begins_like_a_shorter_one():
    link = Link(delay=Constant(1e-3), jitter=1e-3, loss=0.4, max_burst=2)
    times = PERIOD * np.arange(5000)
    runs = [link.arrivals(times[:n], np.random.default_rng(1)) for n in (1500, 5000)]
    np.testing.assert_array_equal(runs[0], runs[1][:1500])


def test_burst_bound_is_needed():
    """Negative control: without the losses in a row the age would exceed its bound."""
    link = Link(delay=Constant(value=0.0), loss=0.6, max_burst=4)
    ages = _ages(link)
    assert ages.max() == pytest.approx(4 * PERIOD)
    assert ages.max() > Link(delay=Constant(value=0.0)).late_bound(PERIOD) + PERIOD


def test_losses_have_their_rate_and_bursts_their_limit_across_blocks():
    link = Link(delay=Constant(value=0.0), loss=0.3, max_burst=3)
    ages = _ages(link, steps=5000) / PERIOD
    assert np.mean(ages > 0.5) == pytest.approx(0.3, abs=0.03)
    assert ages.max() == pytest.approx(3.0)


def test_whether_a_link_is_constant():
    assert RoundTrip.halved(Constant(0.01)).up.constant
    assert not Link(delay=Constant(0.01), jitter=1e-3).constant
    assert not Link(delay=Constant(0.01), loss=0.1).constant
    assert not Link(delay=Table(time=np.arange(2.0), delay=np.array([0.01, 0.02]))).constant


@pytest.mark.parametrize(
    "changes",
    [{"jitter": -1e-3}, {"jitter": np.nan}, {"loss": 1.0}, {"loss": -0.1}, {"max_burst": 0}],
)
def test_refused(changes):
    with pytest.raises(InputError):
        Link(delay=Constant(value=0.0), **changes)
