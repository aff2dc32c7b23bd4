"""Every example in every scenario closes its books; no draw of its gains ends in a traceback."""

import json
from collections import Counter
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.design import load, simulate
from sealag.errors import SealagError
from sealag.simulation import Outcome
from sealag.whole_body import GravityCompensation, Signal

pytestmark = pytest.mark.slow

SOFT = ("anymal", "anymal_crawl", "baxter", "hume_held", "talos")
"""Examples with springs that some of the drawn gains are too stiff for."""
NAMES = (*SOFT, "go2", "panda")
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


def _design(system, *, stiffness, signal, gravity, springs=1.0, damping=1.0):
    """The design with its gains, springs and dampers scaled, and another signal."""
    motors = system.actuators
    tasks = tuple(
        replace(task, stiffness=scale * np.asarray(task.stiffness))
        for task, scale in zip(system.law.tasks, stiffness, strict=True)
    )
    return replace(
        system,
        law=replace(system.law, tasks=tasks, signal=Signal.named(signal), gravity=gravity),
        actuators=replace(
            motors,
            spring_stiffness=springs * motors.spring_stiffness,
            motor_damping=damping * motors.motor_damping,
        ),
    )


def _drawn(system, rng):
    """The design with other gains, springs, dampers and signals, good or bad."""

    def factor(low, high):
        return 10.0 ** rng.uniform(low, high)

    return _design(
        system,
        stiffness=[factor(-2, 3) for _ in system.law.tasks],
        signal=str(rng.choice(Signal.names())),
        gravity=rng.choice(list(GravityCompensation)),
        springs=factor(-2, 1),
        damping=factor(-3, 2),
    )


def _wild(system):
    """Stiff tasks, hardly damped motors without limits, motor angles: what throws itself over."""
    strong = replace(system.actuators, torque_limit=np.full(system.robot.n, np.inf))
    return _design(
        replace(system, actuators=strong),
        stiffness=[1e3] * len(system.law.tasks),
        signal="motor",
        gravity=system.law.gravity,
        damping=1e-3,
    )


@pytest.mark.parametrize("name", SOFT)
def test_no_design_ends_in_a_traceback(name):
    """Whatever the gains: a refusal in sealag's words, or a run with a named outcome and finite
    numbers. Drawn designs must reach refusals and completed runs; a wild one goes wrong, unless its
    base is fixed: nothing falls there."""
    rng, system, ends = np.random.default_rng(7), load(EXAMPLES / f"{name}.toml"), Counter()
    for draw in range(10):
        try:
            run = simulate(
                _drawn(system, rng) if draw else _wild(system),
                scenario=str(rng.choice(SCENARIOS)) if draw else "track",
                duration=0.25,
                delay_scale=10.0 ** rng.uniform(-1, 2) if draw else 1.0,
            )
        except SealagError:
            ends["refused"] += 1
            continue
        assert bool(run.message) == (run.outcome is not Outcome.COMPLETED)
        json.dumps(run.summary(recording=Path("run.mcap")), allow_nan=False)
        ends["completed" if run.outcome is Outcome.COMPLETED else "ended"] += 1
    assert min(ends[end] for end in ("refused", "completed")) > 0
    assert (ends["ended"] > 0) == system.robot.floating_base
