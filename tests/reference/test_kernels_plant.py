"""The plant's step against an adaptive integrator, and its irregular form against the regular."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sealag.actuation import actuators
from sealag.robot import load_robot
from sealag.simulation._plant import Plant

STEP = 1e-4


@pytest.fixture
def plant():
    """Hume in the air, moving, its springs loaded."""
    robot = load_robot("bundled:hume.urdf", floating_base=True)
    springs = actuators(
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
    x = np.concatenate([plant.v, plant.theta, plant.theta_dot])
    pieces, q = 20, plant.q.copy()

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
    np.testing.assert_allclose(plant.q, q, atol=1e-8)
    np.testing.assert_allclose(plant.v, x[:12], atol=1e-6)
    np.testing.assert_allclose(plant.theta, x[12:18], atol=1e-8)
    np.testing.assert_allclose(plant.theta_dot, x[18:], atol=1e-5)


def test_irregular_steps_are_the_same_steps(plant):
    """Exponentials and works made for one step equal those of the tables."""
    tau, measured = np.full(6, 7.0), np.zeros(6)
    plant._try(STEP, True, tau, measured)
    regular, work = plant._next.data.copy(), plant._work.copy()
    plant._try(STEP, False, tau, measured)
    plant._kernel.book_step(
        plant._now.data, plant._next.data, plant._sizes, plant._memory,
        plant._motors(tau, measured), STEP,
    )  # fmt: skip
    np.testing.assert_allclose(plant._next.data, regular, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(plant._work, work, rtol=1e-9, atol=1e-12)
    assert (np.abs(work).max(axis=0) > 0.0).all()
