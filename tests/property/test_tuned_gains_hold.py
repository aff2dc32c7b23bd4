"""Tuned joint PD of a quadruped holds after a push at its whole delay; a fifth more does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import constant_delays
from sealag.tune import tune

TICK = 2.5e-4


def fastest(run, start, end):
    """Largest motor speed between two instants, rad/s."""
    time, speed = np.asarray(run.time), np.abs(np.asarray(run.theta_dot)).max(axis=1)
    return float(speed[(time >= start) & (time <= end)].max())


@pytest.mark.slow
@pytest.mark.parametrize("delay", [5e-3, 1e-2, 2e-2])
def test_a_push_dies_out_with_the_tuned_gains_only(delay):
    example = sealag.load(EXAMPLES / "go2.toml")
    way = (delay - TICK) / 2.0
    system = replace(example, delays=constant_delays(way, way, sample_time=TICK))
    tuned = tune(system)
    assert tuned.found
    growth = []
    for factor in (1.0, 1.2):
        task = tuned.system.law.tasks[0]
        task = replace(task, stiffness=factor * np.asarray(task.stiffness))
        design = replace(tuned.system, law=replace(tuned.system.law, tasks=(task,)))
        run = sealag.simulate(design, scenario="balance", duration=2.8)
        growth.append(fastest(run, 2.4, 2.8) / fastest(run, 0.4, 0.6))
        if factor == 1.0:
            assert run.outcome == "completed"
    assert growth[0] < 1.5
    assert growth[1] > 3.0


def test_the_readme_says_what_tune_answers():
    """The figures of the README are those of the example."""
    tuned = tune(sealag.load(EXAMPLES / "anymal.toml"), safety=1.2)
    page = (Path(__file__).resolve().parents[2] / "README.md").read_text()
    assert f"factor of all stiffness    {tuned.scale:.6g}" in page
