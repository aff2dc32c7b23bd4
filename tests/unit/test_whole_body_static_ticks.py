"""q̄(θ) from tick to tick: one evaluation a tick follows moving motors."""

from dataclasses import replace

import numpy as np

from helpers.designs import EXAMPLES
from sealag.design import load
from sealag.whole_body import Controller, Measurement, StaticJoint, Tank

ANYMAL = load(EXAMPLES / "anymal.toml")


def errors(signal, *, forget=False, motion=2e-3):
    """|q̄ − q̄(θ)| (ticks,), rad, where motors move by up to `motion` a tick."""
    rng = np.random.default_rng(4)
    robot, K = ANYMAL.robot, ANYMAL.actuators.spring_stiffness
    made = [
        Controller(
            robot, replace(ANYMAL.law, signal=one), ANYMAL.actuators,
            contacts=ANYMAL.contacts, posture=ANYMAL.posture, delay_bound=0.01,
        )
        for one in (signal, replace(signal, iterations=40))
    ]  # fmt: skip
    measurement = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n)
    measurement.q[:] = ANYMAL.posture
    start, direction = robot.joint_positions(ANYMAL.posture), rng.uniform(-1.0, 1.0, robot.n)
    measurement.theta[:] = start
    for controller in made:
        controller.reset(0.0, measurement)
    found, torques = [], np.zeros((2, robot.n))
    for k in range(40):
        measurement.theta[:] = start + motion * (5.0 * np.sin(0.2 * k)) * direction
        if forget:
            measurement.q[-robot.n :] = measurement.theta
            made[0].reset(0.0, measurement)
        for controller, out in zip(made, torques, strict=True):
            controller.tick(1e-3 * k, measurement, out)
        found.append(np.abs((torques[0] - torques[1]) / K).max())
    return np.array(found[20:])  # a tank forgets its start


def test_one_evaluation_follows_to_an_encoder_s_resolution():
    left = errors(StaticJoint())
    assert 0.0 < left.max() < 1e-7
    assert errors(StaticJoint(iterations=2)).max() < 2e-9


def test_without_the_last_tick_more_is_left():
    """Negative control: a search that begins anew misses more."""
    assert errors(StaticJoint(), forget=True).max() > 10.0 * errors(StaticJoint()).max()


def test_the_tank_follows_the_same_q_bar():
    assert errors(Tank(rate=1e3, energy=1e3)).max() < 1e-7
