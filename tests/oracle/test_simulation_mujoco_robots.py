"""Whole robots with springs, motors, pushes and delays against own MuJoCo models, at fourth order.

MuJoCo runs 80 times finer than the finest step here and shares no code: the test's own loop keeps
its states, hands them to the controller late, holds commands and switches the push.
"""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from helpers.controllers import JointPD
from helpers.designs import EXAMPLES
from helpers.mujoco_sea import MujocoRobot
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.design import load
from sealag.simulation import Clock, Network, Outcome, Push, Scene, closed_loop

pytestmark = pytest.mark.slow

TICK, DURATION = 8e-3, 0.1
UP, DOWN, DRIVE = 2.34e-3, 1.17e-3, 0.83e-3
FINE = 1e-5  # divides all of them, and the push
START, LASTING = 0.01235, 0.05281
STIFFNESS = {"anymal": 100.0, "baxter": 200.0, "talos": 1000.0}
FINEST = {"anymal": 5e-10, "baxter": 5e-10, "talos": 1e-7}  # rad and m, at 0.25 ms
FRAMES = {"anymal": "base", "baxter": "left_gripper", "talos": "torso_2_link"}
FORCE = np.array([100.0, -40.0, 30.0])


class Case:
    """A robot in the air, every joint and drive different, moving and out of rest."""

    def __init__(self, name):
        system = load(EXAMPLES / f"{name}.toml")
        self.robot, self.frame, self.q = system.robot, FRAMES[name], system.posture.copy()
        n, rng = self.robot.n, np.random.default_rng(len(name))
        K = STIFFNESS[name] * rng.uniform(0.8, 1.2, n)
        inertia = rng.uniform(0.1, 0.2, n)
        self.springs = Actuators.of(
            self.robot.joints, spring_stiffness=K, rotor_inertia=inertia,
            inertia_shaping=rng.uniform(0.4, 1.6, n), motor_damping=rng.uniform(5, 9, n),
            spring_damping=rng.uniform(0.1, 0.2, n),
        )  # fmt: skip
        self.v = rng.uniform(-0.3, 0.3, self.robot.nv)
        self.theta = self.q[-n:] + rng.uniform(-0.02, 0.02, n)
        self.gains = {"stiffness": 0.2 * K, "damping": 0.5, "motor": True}

    def controller(self):
        return JointPD(self.q[-self.robot.n :], **self.gains)

    def ours(self, step, *, late=0.0, force=FORCE):
        links = {"central_up": UP, "central_down": DOWN, "embedded_down": DRIVE + late}
        run = closed_loop(
            self.robot, self.springs, self.controller(),
            q=self.q, v=self.v, theta=self.theta, duration=DURATION,
            clock=Clock(physics=step, central=TICK, log=2e-3),
            network=Network(**{k: Link(delay=Constant(d)) for k, d in links.items()}),
            scene=Scene(
                pushes=[Push(frame=self.frame, force=tuple(force), start=START, duration=LASTING)],
                fall=None,
            ),
        )  # fmt: skip
        assert run.outcome is Outcome.COMPLETED, run.message
        assert run.ages.total == pytest.approx(UP + DOWN + DRIVE + late + TICK, abs=1e-12)
        return np.concatenate([run.q[-1], run.theta[-1]])

    def mujoco(self):
        n = self.robot.n
        twin = MujocoRobot.build(
            self.robot, self.springs, step=FINE, pushed=self.frame, integrator="RK4"
        )
        twin.write(self.q, self.v, self.theta, self.v[-n:])
        up, way, every = (round(t / FINE) for t in (UP, DOWN + DRIVE, TICK))
        first, last = round(START / FINE), round((START + LASTING) / FINE)
        controller, told, due = self.controller(), np.zeros(n), {}
        seen = [(self.theta, self.v[-n:])]
        controller.tick(0.0, SimpleNamespace(theta=self.theta, theta_dot=self.v[-n:]), told)
        due[0] = told.copy()
        for k in range(round(DURATION / FINE)):
            if k % every == 0:
                theta, theta_dot = seen[max(k - up, 0)]
                controller.tick(k, SimpleNamespace(theta=theta, theta_dot=theta_dot), told)
                due[k + way] = told.copy()
            twin.data.ctrl[:n] = due.get(k, twin.data.ctrl[:n])
            twin.data.ctrl[n:] = FORCE if first <= k < last else 0.0
            mujoco.mj_step(twin.model, twin.data)
            seen.append(twin.read()[2:])
        q, _, theta, _ = twin.read()
        return np.concatenate([q, theta])


@pytest.mark.parametrize("name", FRAMES)
def test_fourth_order(name):
    case = Case(name)
    exact = case.mujoco()
    steps = (2e-3, 1e-3, 5e-4, 2.5e-4)
    errors = np.array([np.abs(case.ours(step) - exact).max() for step in steps])
    ratios = errors[:-1] / errors[1:]
    print(name, errors, ratios)
    np.testing.assert_allclose(ratios, 16.0, atol=3.0)
    assert errors[-1] < FINEST[name]
    # negative controls: 10 µs more delay, and a push that is a hundredth weaker
    assert np.abs(case.ours(steps[-1], late=1e-5) - exact).max() > 10 * errors[-1]
    assert np.abs(case.ours(steps[-1], force=0.99 * FORCE) - exact).max() > 10 * errors[-1]
