"""Hume standing with springs, contact, delays and audit: steps per second beside mj_step."""

import sys
import time
from pathlib import Path

import mujoco
import numpy as np

from sealag.actuation import actuators
from sealag.delay import Delays, Sinusoid
from sealag.robot import Contact, load_robot
from sealag.simulation import Clock, Foot, Network, Scene, closed_loop

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
FEET = ("left_foot", "right_foot")


def _hume():
    robot = load_robot("bundled:hume.urdf", floating_base=True)
    springs = actuators(
        robot.joints,
        spring_stiffness=1000.0,
        rotor_inertia=np.array([0.1357, 0.093, 0.093] * 2),
        inertia_shaping=0.5,
        motor_damping=np.array([3.0, 30.0, 30.0] * 2),
    )
    q = robot.configuration(np.deg2rad([0, -25, 55, 0, -25, 55]))
    q[2] -= robot.frame_placement(FEET[0], q)[1][2]
    return robot, springs, q


def ours(step: float, duration: float = 1.0) -> float:
    """Seconds of wall clock for a second of Hume with everything but a whole-body controller.

    Args:
        step: physics step, s; the central loop runs at 1 kHz.
        duration: simulated time, s.
    """
    from helpers.controllers import JointPD

    robot, springs, q = _hume()
    delays = Delays(
        central=Sinusoid(mean=0.02, amplitude=0.01, angular_frequency=1.0),
        embedded=Sinusoid(mean=0.003, amplitude=0.002, angular_frequency=1.0),
    )
    feet = [
        Foot(contact=Contact(frame=foot), torsional_damping=3.0, torsional_radius=0.01)
        for foot in FEET
    ]
    start = time.perf_counter()
    closed_loop(
        robot,
        springs,
        JointPD(q[-6:], stiffness=100.0, damping=2.0),
        q=q,
        duration=duration,
        network=Network.from_delays(delays),
        clock=Clock(physics=step, central=1e-3),
        scene=Scene(feet=feet, fall=None),
    )
    return (time.perf_counter() - start) / duration


def theirs(step: float, duration: float = 1.0) -> float:
    """Seconds of wall clock for a second of mj_step on the same model, both feet held.

    Args:
        step: MuJoCo's step, s.
        duration: simulated time, s.
    """
    from helpers.mujoco_sea import MujocoRobot

    robot, springs, q = _hume()
    twin = MujocoRobot.build(robot, springs, step=step, feet=FEET, delay=0.015)
    twin.write(q, np.zeros(robot.nv), q[-6:], np.zeros(6))
    for foot in FEET:
        twin.hold(foot)
    start = time.perf_counter()
    for _ in range(round(duration / step)):
        mujoco.mj_step(twin.model, twin.data)
    return (time.perf_counter() - start) / duration


def run() -> None:
    """Print both, and their ratio at equal step and at equal error (see the oracle's table)."""
    ours(1e-3, 0.05)
    for step in (1e-3, 5e-4):
        mine, peer = ours(step), theirs(step)
        fine = theirs(step / 16)
        print(
            f"Hume, step {step * 1e3:g} ms: {1 / mine:.1f} x real time "
            f"({1 / mine / step:.0f} steps/s) with contact, delay and audit; mj_step alone is "
            f"{mine / peer:.1f} times as fast, and at 1/16 of the step, where its error is still "
            f"larger, {mine / fine:.2f} times"
        )


if __name__ == "__main__":
    run()
