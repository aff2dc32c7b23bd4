"""What the law is taken at: stiffness, refusals, and the derivative of what runs."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.small_systems import arm, arm_system
from sealag.whole_body import (
    Law,
    LinkAngles,
    Measurement,
    MotorAngles,
    StaticJoint,
    Tank,
    TankFlow,
    Task,
)

SIGNALS = {
    "motor": MotorAngles(),
    "joint": LinkAngles(),
    "static_joint": StaticJoint(),
    "tank": Tank(energy=1e9, rate=4.0),
    "empty tank": Tank(energy=0.0),
}
K = np.array([300.0, 120.0, 45.0])


def stiffness(seed, *, skew=0.0):
    """A joint stiffness (3, 3) that springs K can hold, not diagonal."""
    rng = np.random.default_rng(seed)
    X, Y = rng.normal(size=(2, 3, 3))
    F = X @ X.T + skew * (Y - Y.T)
    root = np.sqrt(K)
    return 0.5 * F / np.linalg.norm(F / np.outer(root, root), 2)


# Stiffness and refusals ------------------------------------------------------------------------
@pytest.mark.parametrize("skew", [0.0, 0.3])
def test_static_joint_with_unequal_springs_is_the_series_of_law_and_springs(skew):
    """(F⁻¹ − K⁻¹)⁻¹; with K⁻¹ on the other side it is another matrix."""
    F = np.stack([stiffness(seed, skew=skew) for seed in range(5)])
    found = StaticJoint().motor_stiffness(F, K)
    for F_q, F_theta in zip(F, found):
        expected = np.linalg.inv(np.linalg.inv(F_q) - np.diag(1.0 / K))
        np.testing.assert_allclose(F_theta, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
        wrong = F_q @ np.linalg.inv(np.eye(3) - F_q / K)
        assert np.abs(wrong - expected).max() > 1e-2 * np.abs(expected).max()
        if skew == 0.0:
            np.testing.assert_allclose(F_theta, F_theta.T, atol=1e-9 * np.abs(expected).max())


def test_other_signals_are_as_stiff_as_the_law():
    F = stiffness(1)
    for signal in (MotorAngles(), LinkAngles(), Tank()):
        np.testing.assert_array_equal(signal.motor_stiffness(F, K), F)
    assert np.abs(StaticJoint().motor_stiffness(F, K) - F).max() > 0.05 * np.abs(F).max()


def test_refusals_say_where_and_why():
    contraction = np.array([0.2, 0.999, 1.0, 3.0, np.nan])
    assert MotorAngles().refusal(contraction) is None
    everywhere = LinkAngles().refusal(contraction)
    assert everywhere.instants.all()
    assert "not collocated" in everywhere.reason
    for signal in (StaticJoint(), Tank()):
        soft = signal.refusal(contraction)
        assert soft.instants.tolist() == [False, False, True, True, True]
        assert "3 of 5 instants" in soft.reason
        assert signal.refusal(contraction[:2]) is None
    printed = Tank(flow=TankFlow.PUBLISHED).refusal(contraction[:2])
    assert printed.instants.all()
    assert "does not pay" in printed.reason


# What the controller ticks ---------------------------------------------------------------------
def hand(robot):
    """The hand's position in the plane, anisotropic, above a posture of all joints."""
    frame = Task(name="hand", kind="position", frame="link1", axes=(0,), stiffness=60.0)
    posture = Task(name="joints", kind="posture", stiffness=20.0, priority=2)
    return frame, posture


def system_of(folder, signal, gravity):
    robot = arm(folder)
    law = Law(tasks=hand(robot), signal=signal, gravity=gravity)
    return arm_system(folder, robot=robot, law=law)


def settled(system, rest, *, q, theta, ticks=40, period=0.0):
    """The command (n,) of a controller that is at rest, then sees q and θ for some ticks."""
    controller, out = system.controller(), np.zeros(2)
    measured = Measurement.allocate(nq=2, nv=2, n=2)
    measured.q[:], measured.theta[:] = rest.q, rest.theta
    controller.reset(0.0, measured)
    t = 0.0
    for _ in range(40):
        controller.tick(t, measured, out)
        t += 1.0
    measured.q[:], measured.theta[:] = q, theta
    t -= 1.0
    for _ in range(ticks):
        t += period
        controller.tick(t, measured, out)
    return out.copy()


def derivative(system, rest, **ticks):
    """∂τ/∂q and ∂τ/∂θ of the ticked controller, (n, n) each, by central differences."""
    by_q, by_theta, h = np.zeros((2, 2)), np.zeros((2, 2)), 1e-5
    for i, step in enumerate(h * np.eye(2)):
        for sign in (1.0, -1.0):
            moved = settled(system, rest, q=rest.q + sign * step, theta=rest.theta, **ticks)
            by_q[:, i] += sign * moved / (2.0 * h)
            moved = settled(system, rest, q=rest.q, theta=rest.theta + sign * step, **ticks)
            by_theta[:, i] += sign * moved / (2.0 * h)
    return by_q, by_theta


def parts(loop):
    """Columns of C that belong to q, to θ, and to the memory; and the memory's own rows."""

    def columns(begin):
        return [i for i, name in enumerate(loop.states) if name.startswith(begin)]

    return columns("z"), columns("theta:"), columns("d/dt theta:"), columns("tank:")


def at_once(loop):
    """∂τ/∂q and ∂τ/∂θ of a step that ξ had no time to follow but for J* Δθ."""
    q, theta, rate, memory = parts(loop)
    C_theta = loop.C[:, theta]
    if memory:
        C_theta = C_theta + loop.C[:, memory] @ loop.A_0[np.ix_(memory, rate)]
    return loop.C[:, q], C_theta


def in_the_end(loop):
    """The same once the memory has settled."""
    q, theta, _, memory = parts(loop)
    if not memory:
        return loop.C[:, q], loop.C[:, theta]
    gain = -loop.C[:, memory] @ np.linalg.inv(loop.A_0[np.ix_(memory, memory)])
    rows = loop.A_0[memory]
    return loop.C[:, q] + gain @ rows[:, q], loop.C[:, theta] + gain @ rows[:, theta]


def differ(found, expected):
    size = max(np.abs(part).max() for part in expected)
    return max(np.abs(a - b).max() for a, b in zip(found, expected)) / size


@pytest.mark.parametrize("gravity", ["feedback", "planned", "none"])
@pytest.mark.parametrize("signal", SIGNALS)
def test_frozen_command_is_the_derivative_of_what_runs(tmp_path, signal, gravity):
    system = system_of(tmp_path, SIGNALS[signal], gravity)
    rest = system.rest()
    assert rest.found
    loop = system.frozen(rest=rest)
    q, *_ = parts(loop)
    np.testing.assert_array_equal(np.abs(loop.A_0[q][:, [i + 4 for i in q]]), np.eye(2))
    if signal != "empty tank":
        assert differ(derivative(system, rest, period=1.0), in_the_end(loop)) < 1e-6
    if signal == "tank":
        assert differ(derivative(system, rest), at_once(loop)) < 1e-6
        assert differ(in_the_end(loop), at_once(loop)) > 1e-2, "u must show"
    other = system_of(tmp_path, SIGNALS["joint" if signal != "joint" else "motor"], gravity)
    assert differ(in_the_end(loop), in_the_end(other.frozen(rest=rest))) > 1e-2


@pytest.mark.parametrize("bent", [1e-3, -3e-3])
def test_the_derivative_is_exact_beside_a_singular_posture(tmp_path, bent):
    """An arm all but stretched, whose Λ changes within 1e-3 rad: Jᵀ Λ^½ K Λ^½ J at the posture, of
    which differences of second order leave 1e-6."""
    robot, gains = arm(tmp_path), np.array([2e-3, 5e-3])
    task = Task(name="com", kind="com", axes=(0, 2), stiffness=np.diag(gains))
    law = Law(tasks=(task,), signal=MotorAngles(), gravity="planned")
    q = np.array([0.4, bent])
    system = arm_system(tmp_path, robot=robot, law=law, posture=q)
    J = robot.com_jacobian(q)[[0, 2]]
    values, V = np.linalg.eigh(J @ np.linalg.inv(robot.mass_matrix(q)) @ J.T)
    root = V / np.sqrt(values) @ V.T
    expected = J.T @ root @ np.diag(gains) @ root @ J
    loop = system.frozen(rest=system.in_posture())
    found = -loop.C[:, parts(loop)[1]]
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def test_an_empty_tank_moves_with_the_motors(tmp_path):
    """u = 0: x̂ = J* θ, the stiffness of motor angles, and nothing remembered."""
    system = system_of(tmp_path, Tank(energy=0.0), "planned")
    rest = system.rest()
    loop = system.frozen(rest=rest)
    assert not parts(loop)[-1]
    assert differ(derivative(system, rest, period=1e-3, ticks=3), in_the_end(loop)) < 1e-6
    full = replace(system, law=replace(system.law, signal=Tank(energy=1.0)))
    assert len(parts(full.frozen(rest=rest))[-1]) == 3


def test_a_tank_follows_its_target_at_its_rate(tmp_path):
    """ξ̇ = rate (x(q̄) − ξ) + J* θ̇: after t the way left is e^(−rate t)."""
    system, t = system_of(tmp_path, Tank(energy=1e9, rate=4.0), "planned"), 0.1
    rest = system.rest()
    loop = system.frozen(rest=rest)
    *_, memory = parts(loop)
    np.testing.assert_allclose(loop.A_0[np.ix_(memory, memory)], -4.0 * np.eye(3))
    found = derivative(system, rest, ticks=100, period=t / 100)
    share = np.exp(-4.0 * t)
    expected = [
        share * now + (1.0 - share) * end for now, end in zip(at_once(loop), in_the_end(loop))
    ]
    assert differ(found, expected) < 1e-6
    assert differ(found, in_the_end(loop)) > 1e-2
