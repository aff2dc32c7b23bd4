"""Settings of [simulation] and the defaults behind them, seen in a run."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system
from sealag import simulate
from sealag.design import System, load


def with_setting(system, **changes):
    """The design with other values in [simulation]."""
    return replace(system, simulation=system.simulation.model_copy(update=changes))


def test_the_tracked_reference_swings_as_its_settings_say(tmp_path, monkeypatch):
    """Offset size (1 − cos 2πft)/2 of the first row, and the rate that is its derivative."""
    seen, controller = [], System.controller

    def spy(system, posture=None, *, reference=None, **choices):
        seen.append(reference)
        return controller(system, posture, reference=reference, **choices)

    monkeypatch.setattr(System, "controller", spy)
    system = with_setting(arm_system(tmp_path), track_amplitude=0.06, track_frequency_hz=0.7)
    simulate(system, scenario="track", duration=0.01)
    reference = next(one for one in seen if one is not None)
    for t in np.linspace(0.0, 2.0, 17):
        offset, rate = reference(t)
        wanted = 0.03 * (1.0 - np.cos(2.0 * np.pi * 0.7 * t))
        np.testing.assert_allclose(offset, [wanted, 0.0], atol=1e-14)
        ahead, behind = (reference(t + step)[0] for step in (1e-5, -1e-5))
        np.testing.assert_allclose(rate, (ahead - behind) / 2e-5, atol=1e-8)


def test_a_drop_begins_at_its_height():
    system = load(str(EXAMPLES / "anymal.toml"))
    low, high = (
        simulate(with_setting(system, drop_height=height), scenario="drop", duration=0.005)
        for height in (0.01, 0.047)
    )
    assert high.q[0, 2] - low.q[0, 2] == pytest.approx(0.037, abs=1e-9)
    assert not low.contact_mode[0].any()


def test_the_log_has_the_period_that_is_asked_for_or_set(tmp_path):
    system = with_setting(arm_system(tmp_path), log_period_ms=4.0)
    for asked, period in ((None, 0.004), (0.01, 0.01)):
        run = simulate(system, scenario="track", duration=0.04, log_period=asked)
        np.testing.assert_allclose(np.diff(run.time), period, atol=1e-12)
