"""Damping of joints and springs: what it does, where its energy goes, how long a step may be."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from helpers.chains import Damped, chain, planar_arm, wheel
from helpers.controllers import Constant as ConstantTorque
from helpers.controllers import JointPD
from helpers.designs import EXAMPLES
from sealag.actuation import Actuators
from sealag.design import load, simulate
from sealag.errors import InputError
from sealag.simulation import Clock, Outcome, closed_loop


def _springs(robot, **changes):
    values = {"spring_stiffness": 350.0, "rotor_inertia": 0.1, "motor_damping": 1.0}
    return Actuators.of(robot.joints, **{**values, **changes})


@pytest.mark.parametrize("damping", [0.0, 3.0, 60.0])
def test_a_damped_link_on_a_held_spring(tmp_path, damping):
    """A rotor too heavy to move: I q̈ + c q̇ + K q = 0 has a closed form."""
    robot = Damped(wheel(tmp_path, inertia=1.0), np.array([damping]))
    run = closed_loop(
        robot,
        _springs(robot, rotor_inertia=1e12),
        ConstantTorque([0.0]),
        q=np.array([0.3]),
        theta=np.zeros(1),
        duration=0.5,
    )
    roots = np.roots([1.0, damping, 350.0])
    a = np.linalg.solve([[1, 1], roots], [0.3, 0.0])
    exact = (np.exp(np.outer(run.time, roots)) @ a).real
    np.testing.assert_allclose(run.q[:, 0], exact, atol=2e-8)
    lost = run.audit.joint_flows["joint_damping"][-1, 0]
    kept = 0.5 * run.v[-1, 0] ** 2 + 175.0 * run.q[-1, 0] ** 2
    assert lost == pytest.approx(175.0 * 0.3**2 - kept, abs=1e-6)
    assert (lost > 1.0) == (damping > 0.0)


def test_each_joint_s_own_damping_is_in_the_books(tmp_path):
    damping = np.array([0.7, 0.2])
    robot = Damped(chain(tmp_path, count=2), damping)
    springs = _springs(robot, spring_damping=[0.3, 0.5], inertia_shaping=0.6)
    run = closed_loop(
        robot,
        springs,
        JointPD(np.array([0.4, -0.2]), stiffness=40.0, motor=True),
        q=np.array([0.9, -0.5]),
        v=np.array([1.0, -3.0]),
        duration=0.3,
        clock=Clock(physics=2.5e-4, central=1e-3, log=2.5e-4),
    )
    dense = np.trapezoid(damping * run.v**2, run.time, axis=0)
    booked = run.audit.joint_flows["joint_damping"]
    np.testing.assert_allclose(booked[-1], dense, rtol=1e-4)
    assert np.abs(run.audit.residual).max() < 1e-7
    assert np.diff(booked, axis=0).min() >= 0.0
    assert booked[-1].min() > 1e3 * np.abs(run.audit.residual).max()
    assert run.audit.joint_side.passive


@pytest.mark.parametrize(("spring", "joint"), [(0.0, 0.0), (2.0, 1.0), (70.0, 30.0), (0.0, 400.0)])
def test_the_fastest_link_is_that_of_its_closed_form(tmp_path, spring, joint):
    robot = Damped(wheel(tmp_path, inertia=0.5), np.array([joint]))
    rate, name = _springs(robot, spring_damping=spring).fastest_link(robot, np.zeros(1))
    assert rate == pytest.approx(np.abs(np.roots([0.5, spring + joint, 350.0])).max())
    assert name == "joint0"


def test_the_fastest_link_is_named(tmp_path):
    robot = planar_arm(tmp_path, count=3, mass=1.0, inertia=0.02, length=0.3)
    for k, name in enumerate(robot.joints):
        K = np.full(3, 50.0)
        K[k] = 5e4
        assert _springs(robot, spring_stiffness=K).fastest_link(robot, np.zeros(3))[1] == name
        damped = _springs(robot, spring_stiffness=50.0, spring_damping=K / 10)
        assert damped.fastest_link(robot, np.zeros(3))[1] == name


class TestStiffDamping:
    """A spring damper that is faster than the step: refused, or the step follows it."""

    def test_a_step_that_is_too_long_is_refused(self, tmp_path):
        robot = wheel(tmp_path, inertia=5e-3)
        springs = _springs(robot, spring_damping=50.0)  # 10,000 1/s
        options = {"q": np.array([0.1]), "theta": np.zeros(1), "duration": 0.01}
        with pytest.raises(InputError, match=r"step of 1 ms is too long: the link of joint0 .*0.1"):
            closed_loop(robot, springs, ConstantTorque([0.0]), **options)
        run = closed_loop(
            robot, springs, ConstantTorque([0.0]), clock=Clock(physics=1e-4, central=1e-3),
            **options,
        )  # fmt: skip
        assert run.outcome is Outcome.COMPLETED
        assert run.audit.closure < 1e-2
        soft = _springs(robot, spring_damping=1e-3)
        assert closed_loop(robot, soft, ConstantTorque([0.0]), **options).outcome == "completed"

    def test_the_step_of_a_design_follows_its_dampers(self):
        system = load(EXAMPLES / "baxter.toml")
        stiff = replace(
            system, actuators=replace(system.actuators, spring_damping=np.full(14, 50.0))
        )
        rates = [s.actuators.fastest_link(s.robot, s.posture)[0] for s in (system, stiff)]
        assert rates[1] > 3 * rates[0]
        assert rates[1] * 1e-3 > 2.0, "1 ms, which the springs alone would allow, must not do"
        run = simulate(stiff, scenario="balance", duration=0.3)
        assert run.outcome is Outcome.COMPLETED
        assert run.audit.closure < 1e-4

    def test_a_step_that_becomes_too_long_is_not_told_as_the_robots_fall(self, tmp_path):
        """The arm unfolds into a posture in which its links are too light for the step."""
        robot = planar_arm(tmp_path, count=2, mass=1.0, inertia=1e-3, length=0.5)
        springs = _springs(robot, spring_stiffness=[4000.0, 4000.0], motor_damping=5.0)
        slow, fast = np.array([0.0, np.pi / 2]), np.array([0.0, 0.0])
        rates = [springs.fastest_link(robot, q)[0] for q in (slow, fast)]
        print(rates)
        assert rates[1] > 1.5 * rates[0]
        step = 1.9 / rates[0]
        options = {"q": slow, "theta": slow, "duration": 600 * step}
        controller = JointPD(fast, stiffness=200.0, motor=True)
        with (
            warnings.catch_warnings(),
            pytest.raises(InputError, match=r"step of .* ms is too long"),
        ):
            warnings.simplefilter("ignore")
            closed_loop(robot, springs, controller,
                        clock=Clock(physics=step, central=step), **options)  # fmt: skip
        run = closed_loop(robot, springs, controller,
                          clock=Clock(physics=step / 4, central=step), **options)  # fmt: skip
        assert run.outcome is Outcome.COMPLETED

    def test_a_robot_that_diverges_is_told_so(self, tmp_path):
        """Negative control: a command that tears it apart is no matter of the step."""
        robot = wheel(tmp_path, inertia=1.0)
        run = closed_loop(
            robot, _springs(robot), JointPD(np.zeros(1), stiffness=-3000.0), q=np.array([0.1]),
            theta=np.array([0.1]), duration=3.0,
        )  # fmt: skip
        assert run.outcome is Outcome.DIVERGED
