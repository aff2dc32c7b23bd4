"""Hume with its whole-body controllers, springs, contact, delays and audit, beside mj_step."""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

import sealag
from sealag.actuation import Actuators
from sealag.robot import load_robot
from sealag.simulation import Run

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
FEET = ("left_foot", "right_foot")
STEP = 1e-3  # s, of both simulators and of the controllers
REPEATS = 5


def _fastest(call: Callable[[], float]) -> float:
    """Processor seconds for a simulated second, the best of some runs after a first one."""
    call()
    costs = []
    for _ in range(REPEATS):
        start = time.process_time()
        simulated = call()
        costs.append((time.process_time() - start) / simulated)
    return min(costs)


def ours(scenario: str, duration: float | None = None) -> tuple[float, Run]:
    """Processor seconds for a second of Hume in a scenario of the bundled project, and a run.

    Args:
        scenario: such as "walk" or "regulate".
        duration: simulated time, s; the scenario's own if None.
    """
    system, runs = sealag.load("bundled:hume"), []

    def simulate() -> float:
        runs.append(sealag.simulate(system, scenario=scenario, duration=duration))
        return float(runs[-1].time[-1])

    return _fastest(simulate), runs[-1]


def theirs(step: float, duration: float = 1.0) -> float:
    """Processor seconds for a second of mj_step on Hume with springs, both feet held.

    Args:
        step: MuJoCo's step, s.
        duration: simulated time, s.
    """
    from helpers.mujoco_sea import MujocoRobot

    robot = load_robot("bundled:hume.urdf", floating_base=True)
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=1000.0,
        rotor_inertia=np.array([0.1357, 0.093, 0.093] * 2),
        inertia_shaping=0.5,
        motor_damping=np.array([3.0, 30.0, 30.0] * 2),
    )
    q = robot.configuration(np.deg2rad([0, -25, 55, 0, -25, 55]))
    q[2] -= robot.frame_placement(FEET[0], q)[1][2]
    twin = MujocoRobot.build(robot, springs, step=step, feet=FEET, delay=0.015)

    def simulate() -> float:
        twin.write(q, np.zeros(robot.nv), q[-6:], np.zeros(6))
        for foot in FEET:
            twin.hold(foot)
        for _ in range(round(duration / step)):
            mujoco.mj_step(twin.model, twin.data)
        return duration

    return _fastest(simulate)


def run() -> None:
    """Print every scenario as multiples of real time and of mj_step in the same run."""
    print("\nHume at 1 kHz: control, springs, contact, delay lines and energy audit, one processor")
    peer, fine = theirs(STEP), theirs(STEP / 16)
    for title, scenario, duration in (
        ("walking controller, 7 steps", "walk", None),
        ("whole-body Controller, standing", "regulate", 1.0),
    ):
        cost, result = ours(scenario, duration)
        print(
            f"  {title:35}{1 / cost:5.1f} x real time ({cost * STEP * 1e6:4.0f} µs a step; "
            f"{result.outcome.value} at {result.time[-1]:.2f} s)"
        )
        print(
            f"  {'':35}mj_step alone, no control, delay or audit: {cost / peer:.1f} x as fast;"
            f"\n  {'':35}at 1/16 of the step, where its error is still larger: {cost / fine:.2f} x"
        )


if __name__ == "__main__":
    run()
