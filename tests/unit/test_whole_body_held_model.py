"""Matrices of the model at a rate of their own: what is held, what is not, and what it does."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.design import load, simulate
from sealag.errors import InputError
from sealag.whole_body import LinkAngles, Measurement, MotorAngles, StaticJoint, Tank

BAXTER = load(EXAMPLES / "baxter.toml")
PERIOD = 0.005


def of(signal, period):
    law = replace(BAXTER.law, signal=signal)
    return replace(BAXTER, law=law, program=None).controller(model_period=period)


def wandering(ticks, seed=5):
    """Measurements of a robot that moves on, one a millisecond."""
    rng, robot = np.random.default_rng(seed), BAXTER.robot
    measured = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n)
    measured.q[:] = BAXTER.posture
    for k in range(ticks):
        measured.data[0] = 1e-3 * k
        measured.q[:] = robot.integrate(measured.q, 0.01 * rng.normal(size=robot.nv))
        measured.theta[:] = measured.q_joint + 1e-3 * rng.normal(size=robot.n)
        yield 1e-3 * k, measured


@pytest.mark.parametrize("signal", [MotorAngles(), LinkAngles(), StaticJoint(iterations=20)])
def test_the_task_torque_is_that_of_the_last_update(signal):
    """Against a controller that updates at every tick, whose matrices are written down."""
    slow, fast = of(signal, PERIOD), of(signal, 0.0)
    out, expected, held = np.zeros(BAXTER.robot.n), np.zeros(BAXTER.robot.n), None
    changed = 0.0
    for tick, (t, measured) in enumerate(wandering(12)):
        if tick == 0:
            slow.reset(t, measured)
            fast.reset(t, measured)
        slow.tick(t, measured, out)
        fast.tick(t, measured, expected)
        law = fast._law
        J, S, error = law.space.J_star.copy(), law.space.stiffness.copy(), law.error.copy()
        if tick % 5 == 0:
            held = J, S
        wanted = expected - J.T @ S @ error + held[0].T @ held[1] @ error
        np.testing.assert_allclose(out, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
        changed = max(changed, float(np.abs(out - expected).max()))
        if tick % 5 == 0:
            np.testing.assert_allclose(out, expected, rtol=1e-9)
    assert changed > 1e-3  # and without the held matrices it is another torque


def test_storage_is_that_of_the_held_matrices():
    slow = of(MotorAngles(), 1.0)
    out, now = np.zeros(BAXTER.robot.n), np.zeros(BAXTER.robot.n)
    for tick, (t, measured) in enumerate(wandering(4)):
        if tick == 0:
            slow.reset(t, measured)
        slow.tick(t, measured, out)
    law = slow._law
    half = 0.5 * law.error @ law.space.stiffness @ law.error
    stored = slow.storage(t, measured, now)
    np.testing.assert_allclose(now, out, rtol=1e-9)
    fresh = of(MotorAngles(), 0.0)
    fresh.reset(t, measured)
    fresh.tick(t, measured, out)
    law = fresh._law
    half -= 0.5 * law.error @ law.space.stiffness @ law.error
    assert stored - fresh.storage(t, measured, now) == pytest.approx(half, rel=1e-6)
    assert abs(half) > 1e-6


def test_a_reset_forgets_the_update():
    slow, out, again = of(MotorAngles(), 1.0), np.zeros(BAXTER.robot.n), np.zeros(BAXTER.robot.n)
    places = [(t, m.data.copy(), m) for t, m in wandering(3)]
    _, data, measured = places[2]
    measured.data[:] = data
    fast = of(MotorAngles(), 0.0)
    fast.reset(0.0, measured)
    fast.tick(0.0, measured, again)
    measured.data[:] = places[0][1]
    slow.reset(0.0, measured)
    slow.tick(0.0, measured, out)
    measured.data[:] = data
    slow.tick(0.001, measured, out)
    assert np.abs(out - again).max() > 1e-6
    slow.reset(0.0, measured)
    slow.tick(0.0, measured, out)
    np.testing.assert_allclose(out, again, rtol=1e-12)


def with_period(system, ms):
    setting = system.simulation.model_copy(update={"model_period_ms": ms})
    return replace(system, simulation=setting)


def test_a_tracking_arm_feels_a_slow_model_and_less_of_a_faster_one():
    """The deviation from a model of every tick grows with the period."""
    runs = {
        ms: simulate(with_period(BAXTER, ms), scenario="track", duration=0.6)
        for ms in (0.0, 50.0, 300.0)
    }
    away = {ms: np.abs(run.q - runs[0.0].q).max() for ms, run in runs.items()}
    assert 0.0 < away[50.0] < 0.7 * away[300.0]


def test_what_cannot_hold_a_model_says_so():
    tank = replace(BAXTER, law=replace(BAXTER.law, signal=Tank()))
    with pytest.raises(InputError, match=r"simulation\.model_period_ms"):
        simulate(with_period(tank, 20.0), duration=0.01)
    simulate(tank, duration=0.01)
    hume = with_period(load("bundled:hume"), 20.0)
    with pytest.raises(InputError, match=r"simulation\.model_period_ms.*\[walking\]"):
        simulate(hume, scenario="walk", duration=0.01)
