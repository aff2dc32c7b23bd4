"""A design at several sample rates: its own loop, its own way, what it tolerates."""

from dataclasses import replace

import pytest

import sealag
from helpers.designs import EXAMPLES
from sealag.delay import Constant, Link
from sealag.errors import InputError


def anymal(way=0.009):
    system = sealag.load(EXAMPLES / "anymal.toml")
    up = replace(system.delays.central, up=Link(delay=Constant(value=way)))
    down = replace(up, down=Link(delay=Constant(value=0.0)))
    none = Link(delay=Constant(value=0.0))
    inner = replace(system.delays.embedded, up=none, down=none)
    return replace(system, delays=replace(system.delays, central=down, embedded=inner))


def test_each_rate_costs_half_a_period():
    exact = anymal().local_margins().delay_s
    for rate in anymal().rate_sweep([50.0, 100.0]):
        assert rate.way_s == pytest.approx(0.009)
        assert rate.stable is True
        if rate.largest_s is not None:
            assert rate.largest_s == pytest.approx(exact - 0.5 / rate.rate_hz, rel=5e-3)
            assert rate.proven_s < rate.largest_s


def test_a_way_between_two_margins_needs_the_faster_rate():
    rates = {rate.rate_hz: rate.stable for rate in anymal(way=0.080).rate_sweep([50.0, 100.0])}
    assert rates[50.0] is False
    assert rates[100.0] is True


def test_the_design_s_own_rate_is_among_them():
    system = anymal()  # 333 Hz is lifted: 30 commands of 10 signals
    odd = replace(system, delays=replace(system.delays, sample_time=1.0 / 333.0))
    assert 333.0 in {rate.rate_hz for rate in odd.rate_sweep([100.0])}


def test_late_torque_feedback_is_a_second_delay():
    system = sealag.load(EXAMPLES / "anymal.toml")
    late = replace(system, delays=replace(system.delays, delayed_torque_feedback=True))
    with pytest.raises(InputError, match="delayed_torque_feedback"):
        late.rate_sweep()
