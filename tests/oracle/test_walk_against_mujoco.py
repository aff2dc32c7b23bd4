"""Seven steps in closed loop: our plant against MuJoCo with its own actuator delay."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.mujoco_walk import mujoco_walk
from humanoids2016 import WalkCase, simulate_walk
from sealag.design import load

pytestmark = pytest.mark.slow

HUME = load("bundled:hume")
CASE = WalkCase(walking=HUME.walking, physics=1.25e-4, embedded=1e-3)


@pytest.fixture(scope="module")
def hume():
    """Hume without the limits of its motors, which the MuJoCo model has not."""
    none = np.full(HUME.robot.n, np.inf)
    free = replace(HUME.actuators, torque_limit=none, velocity_limit=none)
    return replace(HUME, actuators=free)


@pytest.fixture(scope="module")
def ours(hume):
    walk = simulate_walk(hume, CASE)
    assert walk.gait.is_gait
    return walk


def _apart(walk, twin):
    """Largest difference of joint angles (rad), motor angles (rad), and of touchdowns (s)."""
    joints = np.abs(twin.q - walk.run.q)[:, -6:].max()
    motors = np.abs(twin.theta - walk.run.theta).max()
    times = twin.touchdowns(CASE.walking.gait.step_time)
    assert len(times) == len(walk.gait.touchdown)
    return joints, motors, np.abs(times - walk.gait.touchdown).max()


def test_the_same_walk_at_the_finest_step(hume, ours):
    """1e-3 rad and 1 ms over all steps; errors shrink about as the step does."""
    steps = [1e-3 / k for k in (8, 32, 128)]
    table = np.array([_apart(ours, mujoco_walk(hume, CASE, step=h)) for h in steps])
    print("step (s), joints (rad), motors (rad), touchdown (s)")
    print(np.column_stack([steps, table]))
    assert (table[-1] < 1e-3).all()
    assert table[0, 0] > 10.0 * table[-1, 0]


def test_our_own_steps_converge(hume, ours):
    """A millisecond is fine for walking: 5e-4 rad from the limit."""
    coarse = [simulate_walk(hume, replace(CASE, physics=h)).run.q for h in (1e-3, 2.5e-4)]
    apart = [np.abs(q - ours.run.q)[:, -6:].max() for q in coarse]
    assert apart[0] < 5e-4
    assert apart[1] < 0.3 * apart[0]


def test_other_delays_are_another_walk(hume, ours):
    """Negative control: a tenth more delay is seen at once."""
    late = simulate_walk(hume, replace(CASE, delay_scale=1.1))
    assert np.abs(late.run.q - ours.run.q)[:, -6:].max() > 3e-3
