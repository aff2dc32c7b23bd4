"""The simulator against MuJoCo on Hume: springs, floating base, contact, delay, friction."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from helpers.controllers import JointPD
from helpers.mujoco_sea import MujocoRobot
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.robot import Contact, load_robot
from sealag.simulation import Clock, Foot, Network, Outcome, Scene, closed_loop

TICK = 1e-3
ROTOR = np.array([0.1357, 0.093, 0.093] * 2)


@pytest.fixture(scope="module")
def hume():
    robot = load_robot("bundled:hume.urdf", floating_base=True)
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=1000.0,
        rotor_inertia=ROTOR,
        inertia_shaping=0.5,
        motor_damping=np.array([3.0, 30.0, 30.0] * 2),
    )
    return robot, springs


def _late(delay):
    none = Link(delay=Constant(value=0.0))
    late = Link(delay=Constant(value=delay))
    return Network(central_up=none, central_down=late, embedded_down=none)


def _drive(twin, controller, steps, substeps):
    """Tick a controller over MuJoCo; return states (steps + 1, nq + n)."""
    n = twin.robot.n
    command, rows = np.zeros(n), []
    for k in range(steps):
        q, v, theta, theta_dot = twin.read()
        rows.append(np.concatenate([q, theta]))
        seen = SimpleNamespace(q_joint=q[-n:], v_joint=v[-n:], theta=theta, theta_dot=theta_dot)
        controller.tick(k * TICK, seen, command)
        twin.data.ctrl[:] = command
        for _ in range(substeps):
            mujoco.mj_step(twin.model, twin.data)
    q, _, theta, _ = twin.read()
    return np.array([*rows, np.concatenate([q, theta])])


class TestOneFoot:
    """Hume on one held foot, commands 15 ms late through MuJoCo's own actuator delay."""

    duration, delay, foot = 0.3, 0.015, "left_foot"

    @pytest.fixture
    def start(self, hume):
        robot, _ = hume
        q = robot.configuration(np.deg2rad([5, -25, 55, -5, -35, 75]))
        q[2] -= robot.frame_placement(self.foot, q)[1][2]
        return q

    def _controller(self, q):
        return JointPD(q[-6:], stiffness=200.0, damping=2.0, offset=5.0)

    def _ours(self, hume, q, step, delay):
        robot, springs = hume
        run = closed_loop(
            robot,
            springs,
            self._controller(q),
            q=q,
            theta=q[-6:],
            duration=self.duration,
            clock=Clock(physics=step, central=TICK),
            network=_late(delay),
            scene=Scene(feet=[Foot(contact=Contact(frame=self.foot), friction=np.inf)]),
        )
        assert run.outcome is Outcome.COMPLETED
        assert run.contact_force[:, 0, 2].min() > 0
        return np.concatenate([run.q, run.theta], axis=1)

    def _mujoco(self, hume, q, step, impedance=0.9999):
        robot, springs = hume
        late = self.delay - step / 4  # between two samples: which of them is no rounding matter
        twin = MujocoRobot.build(
            robot, springs, step=step, feet=(self.foot,), delay=late, impedance=impedance
        )
        twin.write(q, np.zeros(robot.nv), q[-6:], np.zeros(6))
        twin.hold(self.foot)
        controller, first = self._controller(q), np.zeros(6)
        seen = SimpleNamespace(q_joint=q[-6:], v_joint=np.zeros(6))
        controller.tick(0.0, seen, first)
        twin.fill_delay(first)
        return _drive(twin, controller, round(self.duration / TICK), round(TICK / step))

    def test_errors_shrink_at_each_integrator_s_order(self, hume, start):
        exact = self._ours(hume, start, TICK / 8, self.delay)
        own = [np.abs(self._ours(hume, start, TICK / k, self.delay) - exact).max() for k in (1, 2)]
        assert own[0] < 2e-7
        assert own[0] / own[1] > 10  # fourth order: 16
        theirs = [np.abs(self._mujoco(hume, start, TICK / k) - exact).max() for k in (1, 2, 4, 8)]
        ratios = np.array(theirs[:-1]) / theirs[1:]
        assert theirs[0] < 2e-3
        np.testing.assert_allclose(ratios, 2.0, atol=0.25)  # first order

    def test_agrees_with_the_limit_of_small_steps_and_stiff_contact(self, hume, start):
        exact = self._ours(hume, start, TICK / 4, self.delay)

        def limit(impedance):
            fine = self._mujoco(hume, start, TICK / 16, impedance)
            return 2 * fine - self._mujoco(hume, start, TICK / 8, impedance)

        stiff, soft = limit(0.9999), limit(0.999)
        np.testing.assert_allclose(stiff + (stiff - soft) / 9, exact, atol=1e-6)

    def test_a_millisecond_of_delay_shows(self, hume, start):
        exact = self._ours(hume, start, TICK / 4, self.delay)
        other = self._ours(hume, start, TICK / 4, self.delay - TICK)
        assert np.abs(other - exact).max() > 1e-4


class TestLanding:
    """Hume dropped with forward speed: unilateral contact, plastic impact, sliding."""

    feet, radius, duration = ("left_foot", "right_foot"), 1e-3, 0.2

    def _start(self, robot):
        q = robot.configuration(np.deg2rad([0, -25, 55, 0, -25, 55]))
        low = min(robot.frame_placement(foot, q)[1][2] for foot in self.feet)
        q[2] += self.radius + 0.01 - low
        return q, np.array([0.8] + [0.0] * 11)

    def _ours(self, hume, friction):
        robot, springs = hume
        q, v = self._start(robot)
        feet = [
            Foot(contact=Contact(frame=foot), friction=friction, radius=self.radius)
            for foot in self.feet
        ]
        run = closed_loop(
            robot,
            springs,
            JointPD(q[-6:], stiffness=300.0, damping=2.0),
            q=q,
            v=v,
            theta=q[-6:],
            theta_dot=np.zeros(6),
            duration=self.duration,
            clock=Clock(physics=TICK / 2, central=TICK),
            scene=Scene(feet=feet, fall=None),
        )
        assert run.outcome is Outcome.COMPLETED
        return run

    def _mujoco(self, hume, friction):
        robot, springs = hume
        q, v = self._start(robot)
        twin = MujocoRobot.build(
            robot,
            springs,
            step=TICK / 16,
            feet=self.feet,
            friction=friction,
            radius=self.radius,
            soft=2.5e-4,
        )
        twin.write(q, v, q[-6:], np.zeros(6))
        controller = JointPD(q[-6:], stiffness=300.0, damping=2.0)
        return _drive(twin, controller, round(self.duration / TICK), 16)

    @pytest.mark.parametrize(("friction", "other"), [(0.03, 0.8), (0.8, 0.03)])
    def test_every_joint_follows_the_same_path(self, hume, friction, other):
        twin = self._mujoco(hume, friction)[:, : hume[0].nq]
        apart = np.abs(self._ours(hume, friction).q - twin).max()
        wrong = np.abs(self._ours(hume, other).q - twin).max()
        print(friction, apart, wrong)
        assert apart < 1e-3
        assert wrong > 10 * apart
