"""The simulator against closed forms and a delay differential equation solver."""

import jitcdde
import numpy as np
import pytest

from helpers.chains import chain, wheel
from helpers.controllers import Constant as ConstantTorque
from helpers.controllers import JointPD
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.simulation import Clock, Network, Outcome, Scene, closed_loop


def _springs(robot, **changes):
    values = {"spring_stiffness": 350.0, "rotor_inertia": 0.1, "motor_damping": 1e-12}
    return Actuators.of(robot.joints, **{**values, **changes})


def test_free_spring_and_masses(tmp_path):
    """Two inertias on a spring: the relative angle is a cosine, the mean angle moves evenly."""
    robot = wheel(tmp_path, inertia=1.0)
    springs = _springs(robot)
    run = closed_loop(
        robot,
        springs,
        ConstantTorque([0.0]),
        q=np.zeros(1),
        v=np.array([0.3]),
        theta=np.array([0.1]),
        theta_dot=np.array([0.3]),
        duration=2.0,
    )
    omega = np.sqrt(350.0 * (1 / 1.0 + 1 / 0.1))
    stretch = 0.1 * np.cos(omega * run.time)
    centre = 0.1 * 0.1 / 1.1 + 0.3 * run.time
    np.testing.assert_allclose(run.theta[:, 0] - run.q[:, 0], stretch, atol=1e-6)
    np.testing.assert_allclose((run.q + 0.1 * run.theta)[:, 0] / 1.1, centre, atol=1e-9)


@pytest.mark.parametrize("damping", [0.5, 11.0, 100.0])
def test_locked_joint(tmp_path, damping):
    """A link too heavy to move: B_s θ̈ + D θ̇ + K θ = u has a closed form at every step."""
    robot = wheel(tmp_path, inertia=1e12)
    springs = _springs(robot, motor_damping=damping, inertia_shaping=0.5)
    run = closed_loop(
        robot,
        springs,
        ConstantTorque([20.0]),
        q=np.zeros(1),
        theta=np.zeros(1),
        duration=0.5,
        clock=Clock(physics=5e-3, central=5e-3),
    )
    roots = np.roots([0.05, damping, 350.0])
    a = np.linalg.solve([[1, 1], roots], [-20.0 / 350.0, 0.0])
    exact = (20.0 / 350.0 + np.exp(np.outer(run.time, roots)) @ a).real
    np.testing.assert_allclose(run.theta[:, 0], exact, atol=1e-12)


def test_delayed_feedback_against_jitcdde(tmp_path):
    """One joint, motor-angle feedback 60 ms late, close to its margin of 77.3 ms."""
    import symengine

    K, B_s, D, K_q, d, T = 350.0, 0.09, 10.0, 100.0, 0.06, 1.0
    y, t = jitcdde.y, jitcdde.t
    spring = K * (y(2) - y(0))
    f = [y(1), spring, y(3), (-spring - D * y(3) - K_q * y(2, t - d)) / B_s]
    dde = jitcdde.jitcdde([symengine.sympify(e) for e in f], verbose=False, delays=[0, d])
    dde.constant_past([0.3, 0.0, 0.3, 0.0])
    dde.compile_C(simplify=False, extra_compile_args=["-O1"])
    dde.set_integration_parameters(rtol=1e-7, atol=1e-9, min_step=1e-12)
    dde.step_on_discontinuities()
    begun = dde.t
    instants = np.linspace(begun + 0.02, T, 20)
    exact = np.array([dde.integrate(instant) for instant in instants])

    robot = wheel(tmp_path, inertia=1.0)
    springs = _springs(robot, rotor_inertia=B_s, motor_damping=D)
    errors = []
    for period in (2e-3, 1e-3, 5e-4):
        none = Link(delay=Constant(value=0.0))
        late = Link(delay=Constant(value=d - period / 2))  # the hold adds half a period
        run = closed_loop(
            robot,
            springs,
            JointPD(np.zeros(1), stiffness=K_q, motor=True),
            q=np.array([0.3]),
            theta=np.array([0.3]),
            duration=T,
            clock=Clock(physics=period / 2, central=period),
            network=Network(central_up=none, central_down=late, embedded_down=none),
        )
        mine = np.interp(instants, run.time, run.q[:, 0])
        errors.append(np.abs(mine - exact[:, 0]).max())
    assert errors[-1] < 2e-6
    assert errors[0] / errors[1] > 3  # second order in the period: 4
    assert np.abs(exact[:, 0]).max() < 1.0


def _pendulum(folder, step):
    """A minute of a double pendulum with rotors so light that their springs carry next to nothing:
    it swings as if it had none."""
    robot = chain(folder, count=2)
    springs = _springs(robot, spring_stiffness=30.0, rotor_inertia=1e-4)
    return closed_loop(
        robot,
        springs,
        ConstantTorque([0.0, 0.0]),
        q=np.array([1.0, 0.5]),
        theta=np.array([1.0, 0.5]),
        duration=60.0,
        clock=Clock(physics=step, central=step, log=20 * step),
        scene=Scene(),
    )


@pytest.mark.slow
def test_passive_double_pendulum_keeps_its_energy_for_a_minute(tmp_path):
    run = _pendulum(tmp_path, 1e-3)
    assert run.outcome is Outcome.COMPLETED
    lost, swing = np.abs(run.audit.residual).max(), np.ptp(run.audit.stores["kinetic"])
    assert lost < 5e-8 * swing
    assert np.abs(run.tau_sea).max() < 0.01 * swing  # of the same size as its weight's torque, Nm
    coarse = _pendulum(tmp_path, 4e-3)
    assert np.abs(coarse.audit.residual).max() > 30 * lost
