"""The plant's step against an adaptive integrator, and its irregular form against the regular."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sealag.actuation import Actuators
from sealag.kernels.ledger import COMMAND, DAMPING, MOTOR_WORK, PORT, SHAFT
from sealag.robot import load_robot
from sealag.simulation._plant import Plant

STEP = 1e-4


@pytest.fixture
def plant():
    """Hume in the air, moving, its springs loaded."""
    robot = load_robot("bundled:hume.urdf", floating_base=True)
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=350.0,
        rotor_inertia=np.array([0.1357, 0.093, 0.093] * 2),
        inertia_shaping=0.5,
        motor_damping=np.array([3.0, 30.0, 30.0] * 2),
    )
    rng = np.random.default_rng(3)
    q = robot.configuration(np.deg2rad([0, -25, 55, 5, -35, 40]), base_quaternion=[0, 0.1, 0.2, 1])
    plant = Plant(robot, springs, step=STEP)
    plant.start(q, rng.normal(size=12), theta=q[-6:] + 0.05 * rng.normal(size=6),
                theta_dot=rng.normal(size=6))  # fmt: skip
    return plant


def test_a_step_against_an_adaptive_integrator(plant):
    """Eqs. (4)-(8) written out in coordinates about the beginning, without contacts."""
    robot, springs = plant.robot, plant.actuators
    K, B, D = springs.spring_stiffness, springs.shaped_inertia, springs.motor_damping
    tau = np.array([5.0, -20.0, 30.0, -5.0, 10.0, 15.0])
    x = np.concatenate([plant.now.v, plant.now.theta, plant.now.theta_dot])
    pieces, q = 20, plant.now.q.copy()

    def rate(t, x, q, v):
        there = robot.integrate(q, t * v + 0.5 * t * (x[:12] - v))  # the midpoint rule's place
        spring = K * (x[12:18] - there[-6:])
        push = np.concatenate([np.zeros(6), spring]) - robot.nonlinear_effects(there, x[:12])
        bend = np.linalg.solve(robot.mass_matrix(there), push)
        return np.concatenate([bend, x[18:], (tau - D * x[18:] - spring) / B])

    for _ in range(pieces):
        v = x[:12].copy()
        end = solve_ivp(
            rate, (0, STEP / pieces), x, args=(q, v), rtol=1e-10, atol=1e-12
        ).y[:, -1]  # fmt: skip
        q, x = robot.integrate(q, 0.5 * STEP / pieces * (v + end[:12])), end
    plant.advance(STEP, tau)
    np.testing.assert_allclose(plant.now.q, q, atol=1e-8)
    np.testing.assert_allclose(plant.now.v, x[:12], atol=1e-6)
    np.testing.assert_allclose(plant.now.theta, x[12:18], atol=1e-8)
    np.testing.assert_allclose(plant.now.theta_dot, x[18:], atol=1e-5)


def test_two_halves_are_the_step(plant):
    """Splitting a step changes nothing but what the integrator leaves, works included."""
    tau = np.full(6, 7.0)
    start = [part.copy() for part in plant.now]
    plant.advance(STEP, tau)
    whole, work = [part.copy() for part in plant.now], plant.ledger.joint.copy()
    for part, first in zip(plant.now, start):
        part[:] = first
    plant.time, plant.ledger.joint[:] = 0.0, 0.0
    for instant in (0.3 * STEP, STEP):
        plant.advance(instant, tau)
    for part, other in zip(plant.now, whole):
        np.testing.assert_allclose(part, other, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(plant.ledger.joint, work, rtol=1e-7, atol=1e-12)
    moving = work[[PORT, SHAFT, MOTOR_WORK, COMMAND, DAMPING]]
    assert (np.abs(moving).max(axis=1) > 0.0).all()
