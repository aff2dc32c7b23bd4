"""The simulator and the exact local margin agree; certified designs stay passive under pushes."""

import numpy as np
import pytest

from helpers.chains import planar_arm
from sealag.actuation import actuators
from sealag.delay import Constant, Link, PacketOrder, Sinusoid
from sealag.margin import delay_margin
from sealag.passivity import max_delay_from_stiffness
from sealag.simulation import Clock, Network, Outcome, Push, Scene, closed_loop


class MotorStiffness:
    """tau = F (theta_d - theta) with its potential: motor-angle feedback."""

    def __init__(self, F, target):
        self.F, self.target = F, target

    def reset(self, t, measurement):
        """Nothing to forget."""

    def tick(self, t, measurement, out):
        """Write the command."""
        out[:] = self.F @ (self.target - measurement.theta)

    def storage(self, t, measurement, command):
        """Return V_3 and write the undelayed command."""
        self.tick(t, measurement, command)
        away = measurement.theta - self.target
        return float(0.5 * away @ self.F @ away)


def _design(folder, seed):
    rng = np.random.default_rng(seed)
    n = 1 + seed % 2
    robot = planar_arm(
        folder,
        count=n,
        mass=rng.uniform(0.5, 2.0),
        inertia=rng.uniform(0.05, 0.5),
        length=rng.uniform(0.2, 0.6),
    )
    springs = actuators(
        robot.joints,
        spring_stiffness=rng.uniform(200, 1000, n),
        rotor_inertia=rng.uniform(0.05, 0.2, n),
        inertia_shaping=0.5,
        motor_damping=rng.uniform(5, 30, n),
    )
    root = rng.normal(size=(n, n))
    F = 20.0 * (root @ root.T + np.eye(n))
    return robot, springs, F, rng.uniform(-1, 1, n)


def _loop(robot, springs, F, q):
    """ẋ = A_0 x + A_1 x(t - d) about q, x = (q, q̇, theta, theta_dot)."""
    n = robot.n
    M_inv = np.linalg.inv(robot.mass_matrix(q))
    K, B_inv = np.diag(springs.spring_stiffness), np.diag(1 / springs.shaped_inertia)
    D, I, O = np.diag(springs.motor_damping), np.eye(n), np.zeros((n, n))
    A_0 = np.block(
        [
            [O, I, O, O],
            [-M_inv @ K, O, M_inv @ K, O],
            [O, O, O, I],
            [B_inv @ K, O, -B_inv @ K, -B_inv @ D],
        ]
    )
    A_1 = np.zeros_like(A_0)
    A_1[3 * n :, 2 * n : 3 * n] = -B_inv @ F
    return A_0, A_1


def _growth(robot, springs, F, q, delay, periods, *, up=0.0):
    """Ratio of the late to the early swing after a small displacement, with constant delay."""
    count = max(40, int(np.ceil(100.0 * delay)))
    tick = delay / count
    whole = delay - tick / 2  # the hold adds half a period
    first = round(up * count) * tick
    measured, late = Link(delay=Constant(value=first)), Link(delay=Constant(value=whole - first))
    none = Link(delay=Constant(value=0.0))
    away = 1e-4 * np.random.default_rng(0).normal(size=robot.n)
    run = closed_loop(
        robot,
        springs,
        MotorStiffness(F, q),
        q=q + away,
        theta=q + away,
        duration=round(periods * delay / tick) * tick,
        clock=Clock(physics=tick, central=tick),
        network=Network(central_up=measured, central_down=late, embedded_down=none),
        scene=Scene(),
    )
    assert run.outcome is Outcome.COMPLETED
    swing = np.abs(run.q - q).max(axis=1)
    third = len(swing) // 3
    return swing[-third:].max() / swing[third : 2 * third].max()


@pytest.mark.parametrize("seed", range(50))
def test_margin_parts_convergence_from_divergence(tmp_path, seed):
    robot, springs, F, q = _design(tmp_path, seed)
    margin = float(delay_margin(*_loop(robot, springs, F, q)).delay)
    assert np.isfinite(margin)
    assert margin > 0
    assert _growth(robot, springs, F, q, 0.95 * margin, 60) < 1
    assert _growth(robot, springs, F, q, 1.05 * margin, 60) > 1


@pytest.mark.parametrize("seed", [0, 1])
def test_only_the_sum_of_both_ways_moves_the_roots(tmp_path, seed):
    """d_1 decides, d_2 does not: the same total gives the same swing however it is split."""
    robot, springs, F, q = _design(tmp_path, seed)
    margin = float(delay_margin(*_loop(robot, springs, F, q)).delay)
    growth = [_growth(robot, springs, F, q, 1.05 * margin, 60, up=up) for up in (0.0, 0.3, 0.9)]
    np.testing.assert_allclose(growth[1:], growth[0], rtol=1e-6)
    assert _growth(robot, springs, F, q, 1.15 * margin, 60, up=0.3) > 1.05 * growth[1]


PUSHES = 250  # of each of 40 designs: 10,000


@pytest.mark.parametrize("seed", range(1, 80, 2))  # two joints each
def test_certified_design_stays_passive_under_pushes(tmp_path, seed):
    """Time-varying delay, jitter and losses whose bound is the certified delay; many pushes."""
    robot, springs, F, q = _design(tmp_path, seed)
    certified = float(max_delay_from_stiffness(F, springs.motor_damping).delay)
    tick = certified / 60
    signal = Sinusoid(mean=certified / 6, amplitude=certified / 8, angular_frequency=3.0)
    link = Link(
        delay=signal, jitter=certified / 40, loss=0.2, max_burst=3, order=PacketOrder.NEWEST
    )
    network = Network(
        central_up=link, central_down=link, embedded_down=Link(delay=Constant(value=0.0))
    )
    clock = Clock(physics=tick / 2, central=tick)
    assert network.delay_bound(clock) < certified
    rng = np.random.default_rng(seed)
    pushes = [
        Push(frame=f"link{robot.n - 1}", force=(*rng.normal(0, 20, 2), 0.0), start=start,
             duration=5 * tick)
        for start in 20 * tick * np.arange(1, PUSHES + 1)
    ]  # fmt: skip
    run = closed_loop(
        robot,
        springs,
        MotorStiffness(F, q),
        q=q,
        theta=q,
        duration=(20 * PUSHES + 100) * tick,
        clock=clock,
        network=network,
        scene=Scene(pushes=pushes),
        seed=seed,
    )
    assert run.outcome is Outcome.COMPLETED
    side = run.audit.controller_side
    assert side is not None
    assert np.abs(run.v).max() < 1e3
    assert side.passive, (side.first_violation, side.joint, side.slack.min())
    assert run.audit.joint_side.passive
    assert run.audit.delay_side.passive
    assert side.tolerance < 1e-2 * run.audit.scalar_flows["disturbance"][-1]
    assert run.audit.scalar_flows["disturbance"][-1] > 0
