"""Every example in every scenario closes its books; no draw of its gains ends in a traceback."""

import json
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.cli._simulate import summary
from sealag.design import load, simulate
from sealag.errors import SealagError
from sealag.simulation import Outcome
from sealag.whole_body import SIGNAL_NAMES, GravityCompensation, signal_named

NAMES = ("anymal", "anymal_crawl", "baxter", "hume_held", "talos")
SCENARIOS = ("regulate", "track", "drop", "balance")


def test_all_examples_are_here():
    assert sorted(path.stem for path in EXAMPLES.glob("*.toml")) == sorted(NAMES)


@pytest.mark.parametrize(("name", "scenario"), list(product(NAMES, SCENARIOS)))
def test_first_law(name, scenario):
    run = simulate(load(EXAMPLES / f"{name}.toml"), scenario=scenario, duration=0.2)
    assert run.outcome is Outcome.COMPLETED, run.message
    moved = run.audit.throughput[-1]
    assert np.abs(run.audit.residual).max() <= 1e-4 * max(moved, 1e-3)
    if scenario == "drop" and run.feet:
        assert run.audit.scalar_flows["impact"][-1] > 0.1
        assert moved > 10.0


def _drawn(system, rng):
    """The design with other gains, springs, dampers and signals, good or bad."""

    def factor(low, high):
        return 10.0 ** rng.uniform(low, high)

    tasks = tuple(
        replace(task, stiffness=factor(-2, 3) * np.asarray(task.stiffness))
        for task in system.law.tasks
    )
    motors = system.actuators
    return replace(
        system,
        law=replace(
            system.law,
            tasks=tasks,
            signal=signal_named(str(rng.choice(SIGNAL_NAMES))),
            gravity=rng.choice(list(GravityCompensation)),
        ),
        actuators=replace(
            motors,
            spring_stiffness=factor(-2, 1) * motors.spring_stiffness,
            motor_damping=factor(-3, 2) * motors.motor_damping,
        ),
    )


@pytest.mark.parametrize("name", NAMES)
def test_no_design_ends_in_a_traceback(name):
    """Whatever the gains: a refusal in sealag's words, or a run with a named outcome and finite
    numbers. The draws must reach both, and runs that go wrong."""
    rng, system, ends = np.random.default_rng(7), load(EXAMPLES / f"{name}.toml"), Counter()
    for _ in range(12):
        try:
            run = simulate(
                _drawn(system, rng),
                scenario=str(rng.choice(SCENARIOS)),
                duration=0.25,
                delay_scale=10.0 ** rng.uniform(-1, 2),
            )
        except SealagError:
            ends["refused"] += 1
            continue
        assert bool(run.message) == (run.outcome is not Outcome.COMPLETED)
        json.dumps(summary(run, Path("run.mcap")), allow_nan=False)
        ends["completed" if run.outcome is Outcome.COMPLETED else "ended"] += 1
    assert min(ends[end] for end in ("refused", "completed", "ended")) > 0
