"""Designs for tests: arms under gravity with their own law, and delays that use up a bound."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helpers.chains import chain
from sealag.actuation import Actuators
from sealag.delay import Constant, Delays, Link, PacketOrder, RoundTrip, Sinusoid
from sealag.robot import Robot

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


class MotorStiffness:
    """tau = F (theta_d - theta) + g_d with its potential: motor-angle feedback."""

    def __init__(self, F, target, gravity):
        self.F, self.target, self.gravity = F, target, gravity

    def reset(self, t, measurement):
        """Nothing to forget."""

    def tick(self, t, measurement, out):
        """Write the command."""
        out[:] = self.F @ (self.target - measurement.theta) + self.gravity

    def storage(self, t, measurement, command):
        """Return V_3 and write the undelayed command."""
        self.tick(t, measurement, command)
        away = measurement.theta - self.target
        return float(0.5 * away @ self.F @ away - self.gravity @ away)


@dataclass(frozen=True, kw_only=True)
class Arm:
    """A random arm in a vertical plane that holds q with its motors at theta."""

    robot: Robot
    springs: Actuators
    F: np.ndarray
    q: np.ndarray
    theta: np.ndarray

    def controller(self):
        """Return the law that holds it."""
        return MotorStiffness(self.F, self.theta, self.robot.gravity(self.q))

    def loop(self):
        """ẋ = A_0 x + A_1 x(t - d) about q, x = (q, q̇, theta, theta_dot)."""
        n, springs = self.robot.n, self.springs
        M_inv = np.linalg.inv(self.robot.mass_matrix(self.q))
        K, B_inv = np.diag(springs.spring_stiffness), np.diag(1 / springs.shaped_inertia)
        D, I, O = np.diag(springs.motor_damping), np.eye(n), np.zeros((n, n))
        A_0 = np.block(
            [
                [O, I, O, O],
                [-M_inv @ (K + self.slope()), O, M_inv @ K, O],
                [O, O, O, I],
                [B_inv @ K, O, -B_inv @ K, -B_inv @ D],
            ]
        )
        A_1 = np.zeros_like(A_0)
        A_1[3 * n :, 2 * n : 3 * n] = -B_inv @ self.F
        return A_0, A_1

    def slope(self):
        """Return ∂g/∂q by central differences."""
        step = 1e-5 * np.eye(self.robot.n)
        rows = [self.robot.gravity(self.q + s) - self.robot.gravity(self.q - s) for s in step]
        return np.array(rows).T / 2e-5


def random_arm(folder, seed):
    """Return an arm of one joint (even seeds) or two (odd seeds)."""
    rng = np.random.default_rng(seed)
    n = 1 + seed % 2
    robot = chain(
        folder,
        count=n,
        mass=rng.uniform(0.5, 2.0),
        inertia=rng.uniform(0.05, 0.5),
        length=rng.uniform(0.2, 0.6),
        along="x",
    )
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=rng.uniform(200, 1000, n),
        rotor_inertia=rng.uniform(0.05, 0.2, n),
        inertia_shaping=0.5,
        motor_damping=rng.uniform(5, 30, n),
    )
    root = rng.normal(size=(n, n))
    F = 40.0 * (root @ root.T + np.eye(n))
    q = rng.uniform(-1, 1, n)
    theta = q + robot.gravity(q) / springs.spring_stiffness
    return Arm(robot=robot, springs=springs, F=F, q=q, theta=theta)


def rough_delays(bound: float, tick: float) -> Delays:
    """Delays that vary, jitter, overtake and lose packets on both ways; d_1 is the bound."""

    def delays(way: float) -> Delays:
        link = Link(
            delay=Sinusoid(mean=0.9 * way, amplitude=0.1 * way, angular_frequency=3.0),
            jitter=tick,
            loss=0.2,
            max_burst=3,
            order=PacketOrder.NEWEST,
        )
        return Delays(
            central=RoundTrip(up=link, down=link),
            embedded=Constant(value=0.0),
            sample_time=tick,
            embedded_period=tick / 2,
        )

    return delays((bound - delays(0.0).d_1) / 2)
