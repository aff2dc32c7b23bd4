"""The derivative of the settled law against differences of what settles anew in every direction."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.design import load
from sealag.whole_body import Controller, Signal

HUME, ANYMAL = load("bundled:hume"), load(EXAMPLES / "anymal.toml")
STEP = 1e-4


def state(system):
    """Away from the posture, with springs that are bent by a tenth of a radian."""
    robot, rng = system.robot, np.random.default_rng(0)
    q = robot.integrate(system.posture, 0.02 * rng.normal(size=robot.nv))
    return q, robot.joint_positions(q) + 0.1 * rng.normal(size=robot.n)


def running(system, name):
    """The signal that a controller of the design runs."""
    controller = Controller(
        system.robot, replace(system.law, signal=Signal.named(name)), system.actuators,
        contacts=system.contacts, posture=system.posture,
    )  # fmt: skip
    return controller._signal


def by_differences(system, signal, q, theta):
    """Plain central differences of two bases, extrapolated, of the command once it has settled."""
    robot = system.robot
    out, found = np.zeros(robot.n), np.zeros((robot.n, robot.nv + robot.n))
    for k, way in enumerate(np.eye(robot.nv + robot.n)):
        for h, weight in ((STEP, 4.0 / 3.0), (2.0 * STEP, -1.0 / 6.0)):
            for sign in (h, -h):
                moved = robot.integrate(q, sign * way[: robot.nv])
                signal.settled(moved, theta + sign * way[robot.nv :], out)
                found[:, k] += np.sign(sign) * weight * out / (2.0 * STEP)
    return found


@pytest.mark.parametrize(
    ("system", "name"),
    [(HUME, "motor"), (HUME, "joint"), *((ANYMAL, s) for s in ("motor", "joint", "static_joint"))],
    ids=lambda one: getattr(one, "name", one),
)  # Hume's springs are too soft for q̄(θ)
def test_the_derivative_is_that_of_the_settled_command(system, name):
    """Feet that close loops: the configuration does not follow all that the motors do."""
    signal = running(system, name)
    q, theta = state(system)
    wanted = by_differences(system, signal, q, theta)
    size = np.abs(wanted).max()
    for rough, tolerance in ((False, 3e-7), (True, 3e-5)):
        found = signal.derivative(q, theta, rough=rough)
        np.testing.assert_allclose(
            np.hstack([found.C_q, found.C_theta]), wanted, atol=tolerance * size
        )
    # The control: the same posture with springs that are straight.
    straight = signal.derivative(q, system.robot.joint_positions(q))
    if name != "joint":
        assert np.abs(straight.C_theta - wanted[:, system.robot.nv :]).max() > 1e-3 * size
