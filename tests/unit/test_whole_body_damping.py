"""Damping that the controller computes from rates: what ticks, what is frozen, what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.chains import wheel
from helpers.designs import EXAMPLES
from sealag.errors import InputError
from sealag.whole_body import LinkAngles, Measurement, MotorAngles, StaticJoint, Tank

SIGNALS = [MotorAngles(), LinkAngles(), StaticJoint(), Tank()]


def damped(system, damping=12.0, **changes):
    """The design with its first task damped by the controller."""
    first, *others = system.law.tasks
    tasks = (replace(first, damping=damping), *others)
    return replace(system, law=replace(system.law, tasks=tasks, **changes))


@pytest.fixture(scope="module")
def anymal():
    return sealag.load(EXAMPLES / "anymal.toml")


def measured(system, *, theta_dot=0.0, v=0.0):
    state = Measurement.allocate(
        nq=system.robot.nq, nv=system.robot.nv, n=system.robot.n, contacts=len(system.contacts)
    )
    rest = system.rest()
    state.q[:], state.theta[:] = rest.q, rest.theta
    state.theta_dot[:], state.v[:] = theta_dot, v
    return state


def command(system, state):
    controller, out = system.controller(), np.zeros(system.robot.n)
    controller.reset(0.0, state)
    controller.tick(0.0, state, out)
    return out


@pytest.mark.parametrize("signal", SIGNALS[:3], ids=lambda signal: signal.name)
def test_the_frozen_loop_is_the_derivative_of_what_ticks(anymal, signal):
    system = damped(anymal, signal=signal)
    rest = system.rest()
    ticked = sealag.freeze(
        system.controller(), system.robot, system.actuators, contacts=system.contacts,
        q=rest.q, theta=rest.theta,
    ).loop  # fmt: skip
    loop, size = system.frozen(rest=rest), np.abs(ticked.A_1).max()
    np.testing.assert_allclose(loop.A_1, ticked.A_1, atol=1e-7 * size)
    bare = replace(system, law=replace(system.law, tasks=anymal.law.tasks)).frozen(rest=rest)
    assert np.abs(bare.A_1 - ticked.A_1).max() > 1e-3 * size


def test_it_pulls_against_the_task_s_rate(anymal):
    """F = −D_x ẋ at the centre of mass: through the same J* as the stiffness."""
    system, rates = damped(anymal, 12.0), np.linspace(-1.0, 1.0, anymal.robot.n)
    J_star = anymal.spaces().J_star[0]
    rows = slice(0, 3)
    late = command(system, measured(system, theta_dot=rates))
    still = command(system, measured(system))
    wanted = -J_star[rows].T @ (12.0 * J_star[rows] @ rates)
    np.testing.assert_allclose(late - still, wanted, atol=1e-3 * np.abs(wanted).max())
    assert np.abs(wanted).max() > 1e-2


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda signal: signal.name)
def test_rates_are_those_of_the_signal_s_side(anymal, signal):
    system = damped(anymal, signal=signal)
    still = command(system, measured(system))
    links = command(system, measured(system, v=1.0))
    motors = command(system, measured(system, theta_dot=1.0))
    moved = [bool(np.abs(one - still).max() > 1e-6) for one in (links, motors)]
    assert moved == ([True, False] if signal.of_links else [False, True])


def test_a_rate_that_is_wanted_meets_no_damping(tmp_path):
    robot = wheel(tmp_path, inertia=0.3)
    motors = sealag.Actuators.of(
        robot.joints, spring_stiffness=300.0, rotor_inertia=0.1, motor_damping=5.0
    )
    joints = sealag.Task(name="joints", kind="posture", stiffness=40.0, damping=2.0)
    law = sealag.Law(tasks=(joints,), stiffness_form="force", velocity_feedforward=False)
    state = Measurement.allocate(nq=1, nv=1, n=1)
    state.theta_dot[:] = 3.0
    for wanted in (3.0, 0.0):
        controller = sealag.Controller(
            robot, law, motors, posture=np.zeros(1),
            reference=lambda t, wanted=wanted: (np.zeros(1), np.full(1, wanted)),
        )  # fmt: skip
        out = np.zeros(1)
        controller.reset(0.0, state)
        controller.tick(0.0, state, out)
        assert out[0] == pytest.approx(2.0 * (wanted - 3.0), abs=1e-12)


def test_no_passive_bound_covers_it_and_the_certificate_says_so(anymal):
    certificate = sealag.certify(damped(anymal))
    assert certificate.answer.max_delay_s == 0.0
    assert "damping of task" in certificate.answer.reasons[0]
    assert sealag.certify(damped(anymal, 0.0)).answer.max_delay_s > 0.0


def test_late_rates_cost_more_than_late_positions(anymal):
    """The paper's Section III: damping belongs into the drives."""
    late = damped(anymal, 600.0).local_margins()
    assert late.jitter_s <= late.delay_s
    assert late.channels_s["rates"] < 0.1 * late.channels_s["positions"]
    assert anymal.local_margins().channels_s == {}


def test_a_motion_is_not_taken_for_one_with_a_potential(anymal):
    """Its passive bound is no lower bound of the margin, so that every instant is decided."""
    system = damped(anymal, 600.0, signal=StaticJoint())
    motion = system.still()
    two = replace(
        motion, time=np.array([0.0, 1.0]), q=np.repeat(motion.q, 2, axis=0),
        v=np.repeat(motion.v, 2, axis=0), contact_index=np.repeat(motion.contact_index, 2),
    )  # fmt: skip
    assert system.local_margins(two).delay_s == pytest.approx(system.local_margins().delay_s)
    assert system.local_margins(two).exact == 2


@pytest.mark.parametrize(
    ("damping", "words"),
    [(-1.0, "negative"), ([1.0, 2.0], "shape"), (np.nan, "finite"), ("much", "numbers")],
)
def test_damping_that_is_none_is_refused(anymal, damping, words):
    with pytest.raises(InputError, match=words):
        damped(anymal, damping)
