"""Settings of [simulation] and the defaults behind them, seen in a run."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system
from sealag import simulate
from sealag.design import load


def with_setting(system, **changes):
    """The design with other values in [simulation]."""
    return replace(system, simulation=system.simulation.model_copy(update=changes))


def test_balance_pushes_with_a_twentieth_of_the_weight_for_a_tenth_of_a_second():
    system = load("bundled:hume")
    frame = next(task.frame for task in system.law.tasks if task.frame)
    kind = type(load("bundled:hume").simulation).model_fields["pushes"].annotation.__args__[0]
    runs = {"default": simulate(system, scenario="balance", duration=0.35)}
    for share in (0.05, 0.06):
        force = [share * system.robot.weight, 0.0, 0.0]
        push = kind(frame=frame, force_n=force, start_s=0.2, duration_s=0.1)
        pushed = with_setting(system, pushes=[push])
        runs[share] = simulate(pushed, scenario="balance", duration=0.35)
    np.testing.assert_array_equal(runs["default"].q, runs[0.05].q)
    assert np.abs(runs["default"].q - runs[0.06].q).max() > 1e-6


def test_feet_stand_on_balls_of_their_radius():
    system = load(str(EXAMPLES / "anymal.toml"))
    sole, ball = (
        simulate(with_setting(system, foot_radius=size), scenario="regulate", duration=0.005)
        for size in (0.0, 0.013)
    )
    assert ball.q[0, 2] - sole.q[0, 2] == pytest.approx(0.013, abs=1e-6)


@pytest.mark.parametrize("slow", [0, 1])
def test_the_joint_side_names_the_joint_whose_drive_lags(tmp_path, slow):
    """A drive with a bandwidth is not passive: its shaped inertia comes late."""
    bandwidth = np.array([np.inf, np.inf])
    bandwidth[slow] = 10.0
    springs = {"torque_bandwidth": bandwidth, "inertia_shaping": 0.1}
    side = simulate(arm_system(tmp_path, springs=springs), scenario="track", duration=0.05)
    assert not side.audit.joint_side.passive
    assert side.audit.joint_side.joint == f"joint{slow}"
    ideal = arm_system(tmp_path, springs={"inertia_shaping": 0.1})
    assert simulate(ideal, scenario="track", duration=0.05).audit.joint_side.passive
