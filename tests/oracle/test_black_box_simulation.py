"""Where the black box says unstable the motion grows, where it says stable it dies away.

Twice: in the black box's own stepping of the loop, rate by rate, and in sealag's simulator.
"""

import re
from pathlib import Path

import numpy as np
import pytest

import sealag
from oracle.black_box.box import BlackBox
from oracle.black_box.roots import Late, roots
from oracle.black_box.run import deviation, growth

pytestmark = pytest.mark.slow

CASES = Path(__file__).parent / "black_box" / "cases"


def rightmost(black, delay):
    """Largest real part of the loop's roots at a delay, 1/s."""
    loop = black.loop(black.rest())
    late = Late(B=loop.delayed.B, C=loop.delayed.C, delay=delay)
    return float(roots(loop.A_0, [*loop.fixed, late]).real.max())


@pytest.mark.parametrize(
    ("name", "delay", "step", "duration"),
    [
        ("s8_delayed_torque_feedback", 1e-3, 5e-4, 1.0),
        ("s2_torque_bandwidth_one_joint", 1e-3, 1e-3, 1.2),
        ("s5_tank_locally_active", 4e-3, 4e-3, 10.0),
        ("dampbest", 100e-3, 4e-3, 5.0),
    ],
)
def test_growth_rates_are_those_of_the_roots(name, delay, step, duration):
    path = CASES / f"{name}.toml"
    black = BlackBox(path, sealag.load(path))
    measured = growth(*deviation(black, delay=delay, duration=duration, step=step))
    assert measured == pytest.approx(rightmost(black, delay), rel=0.1)


def swing(name, folder, *, delay_ms, duration, change=("", ""), scenario="regulate"):
    """Late size of the joints' motion in sealag's simulator over its early size, after a push, or
    (drop) after springs that did not carry the joints at first."""
    text = (CASES / f"{name}.toml").read_text().replace(*change)
    text = re.sub(
        r"(central_round_trip.*value_ms *= *)[0-9.]+", lambda found: f"{found[1]}{delay_ms}", text
    )
    for urdf in CASES.glob("*.urdf"):
        (folder / urdf.name).write_text(urdf.read_text())
    path = folder / f"{name}.toml"
    path.write_text(text)
    system = sealag.load(path)
    link = system.robot.link_names()[-1]
    push = f'[[simulation.pushes]]\nframe = "{link}"\nforce_n = [3.0, 3.0, 3.0]\n'
    path.write_text(f"{text}\n{push}start_s = 0.05\nduration_s = 0.1\n")
    run = sealag.simulate(sealag.load(path), scenario=scenario, duration=duration)
    if run.outcome != "completed":
        return np.inf
    speed = np.linalg.norm(run.theta_dot, axis=1)
    quarter = len(speed) // 4
    return speed[-quarter:].max() / speed[quarter : 2 * quarter].max()


IDEAL = ("torque_bandwidth=20.0", "torque_bandwidth=2000.0")


@pytest.mark.parametrize(
    ("name", "change", "delay_ms", "grows", "scenario"),
    [
        ("dampbest", ("", ""), 30.0, False, "regulate"),
        ("dampbest", ("", ""), 100.0, True, "regulate"),
        ("s2_torque_bandwidth_one_joint", ("", ""), 1.0, True, "regulate"),
        ("s2_torque_bandwidth_one_joint", IDEAL, 1.0, False, "regulate"),
        ("s8_delayed_torque_feedback", ("", ""), 1.0, True, "drop"),
        ("s8_delayed_torque_feedback", ("=true", "=false"), 1.0, False, "drop"),
    ],
)
def test_the_simulator_agrees(name, change, delay_ms, grows, scenario, tmp_path):
    """A push on the only link of s8 has no lever, so that its springs start unloaded instead."""
    ratio = swing(name, tmp_path, delay_ms=delay_ms, duration=8.0, change=change, scenario=scenario)
    system = sealag.load(tmp_path / f"{name}.toml")
    growth_rate = rightmost(BlackBox(tmp_path / f"{name}.toml", system), system.delays.d_1)
    assert (growth_rate > 0.0) == grows
    assert ratio > 2.0 if grows else ratio < 0.5
