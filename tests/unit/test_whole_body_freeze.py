"""Any controller frozen from outside: what ticks is differentiated, and closed as it runs."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.chains import planar_arm, wheel
from helpers.controllers import JointPD
from helpers.designs import EXAMPLES
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.errors import InputError
from sealag.simulation import Clock, Network, closed_loop
from sealag.whole_body import Controller, LinkAngles, MotorAngles, StaticJoint


def design(name, signal):
    system = sealag.load(EXAMPLES / f"{name}.toml")
    return replace(system, law=replace(system.law, signal=signal))


def whole_body(system):
    return Controller(
        system.robot, system.law, system.actuators, contacts=system.contacts,
        posture=system.posture,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("anymal", MotorAngles()),
        ("anymal", LinkAngles()),
        ("anymal", StaticJoint(iterations=20)),
        ("baxter", LinkAngles()),
    ],
)
def test_the_whole_body_law_is_found_from_outside(name, signal):
    """It knows nothing of tasks or Jacobians: `FrozenLoop.of` differentiates the law itself."""
    system = design(name, signal)
    rest = system.rest()
    found = sealag.freeze(
        whole_body(system), system.robot, system.actuators, contacts=system.contacts,
        q=rest.q, theta=rest.theta, embedded_delay=system.delays.torque_feedback_delay,
    )  # fmt: skip
    inside = system.frozen(rest=rest)
    size = np.abs(inside.A_1).max()
    np.testing.assert_allclose(found.loop.A_1, inside.A_1, rtol=0.0, atol=2e-6 * size)
    np.testing.assert_allclose(found.loop.A_0, inside.A_0, rtol=0.0, atol=1e-10 * size)
    assert found.memory < 2e-2  # the base follows the joints from tick to tick
    assert found.bend < 1e-3
    one, other = (loop.margin() for loop in (found.loop, inside))
    assert one.unstable_roots == other.unstable_roots
    if not one.unstable_roots:
        assert one.delay == pytest.approx(other.delay, rel=1e-4)


def stiff(joints, *, inertia, damping):
    return Actuators.of(
        joints, spring_stiffness=1e5, rotor_inertia=inertia, inertia_shaping=1.0,
        motor_damping=damping,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("inertia", "damping", "k", "margin"),
    [(0.1357, 10.0, 100.0, 0.14500478), (0.093, 5.0, 400.0, 0.01382096)],
)
def test_textbook_margins_of_joint_pd(inertia, damping, k, margin, tmp_path):
    """B θ̈ + D θ̇ + k θ(t − d) = 0: a light link on a stiff spring moves with its motor."""
    robot = wheel(tmp_path, inertia=0.01)
    motors = stiff(robot.joints, inertia=inertia - 0.01, damping=damping)
    pd = JointPD(np.zeros(1), stiffness=k, motor=True)
    loop = sealag.freeze(pd, robot, motors, q=np.zeros(1)).loop
    assert loop.margin().delay == pytest.approx(margin, rel=1e-2)


class Feeling(JointPD):
    """PD on link positions and rates that also feeds back the spring's torque."""

    def tick(self, t, measurement, out):
        super().tick(t, measurement, out)
        out -= 0.3 * measurement.tau_sea


@pytest.fixture
def arm(tmp_path):
    """Two joints in a horizontal plane."""
    robot = planar_arm(tmp_path, count=2, mass=1.0, inertia=0.05, length=0.3)
    motors = Actuators.of(
        robot.joints, spring_stiffness=np.array([300.0, 200.0]),
        rotor_inertia=np.array([0.1, 0.07]), inertia_shaping=0.5,
        motor_damping=np.array([8.0, 5.0]),
    )  # fmt: skip
    return robot, motors, Feeling(np.zeros(2), stiffness=np.array([30.0, 20.0]), damping=1.0)


def test_every_measured_quantity_has_its_column(arm):
    """K_p on links, K_d on their rates and 0.3 on the spring torque, at their places."""
    robot, motors, pd = arm
    loop = sealag.freeze(pd, robot, motors, q=np.zeros(2)).loop
    names, K = list(loop.states), motors.spring_stiffness
    z, theta, z_rate = (
        [names.index(name) for name in part]
        for part in (["z0", "z1"], [f"theta:{j}" for j in robot.joints], ["d/dt z0", "d/dt z1"])
    )
    Z = np.eye(2)  # an arm without contacts: z are its joints up to a rotation
    C_z, C_rate = loop.C[:, z], loop.C[:, z_rate]
    np.testing.assert_allclose(np.abs(np.linalg.det(C_rate)), 1.0, rtol=1e-6)
    turn = -C_rate @ Z
    np.testing.assert_allclose(C_z, (np.diag([-30.0, -20.0]) + 0.3 * np.diag(K)) @ turn, atol=1e-5)
    np.testing.assert_allclose(loop.C[:, theta], -0.3 * np.diag(K), atol=1e-5)


@pytest.mark.parametrize("share", [0.93, 1.07])
def test_the_simulator_agrees_just_below_and_just_above(share, arm):
    robot, motors, pd = arm
    loop = sealag.freeze(pd, robot, motors, q=np.zeros(2)).loop
    margin = loop.margin().delay
    assert loop.jitter_margin().delay < margin
    period = 1e-4
    way = Link(delay=Constant(value=share * margin))
    run = closed_loop(
        robot, motors, pd, q=np.array([1e-3, -1e-3]), duration=60.0 * margin,
        network=replace(Network.ideal(), central_down=way),
        clock=Clock(physics=period, central=period, log=1e-3),
    )  # fmt: skip
    size = np.abs(run.v).max(axis=1)
    n = len(size) // 4
    assert (size[-n:].max() > size[n : 2 * n].max()) == (share > 1.0)


def test_a_law_that_bends_says_so(arm):
    class Cubic(JointPD):
        def tick(self, t, measurement, out):
            out[:] = -10.0 * measurement.theta - 1e7 * measurement.theta**3

    robot, motors, _ = arm
    straight = sealag.freeze(JointPD(np.zeros(2), stiffness=10.0), robot, motors, q=np.zeros(2))
    bent = sealag.freeze(Cubic(np.zeros(2), stiffness=0.0), robot, motors, q=np.zeros(2))
    assert straight.bend < 1e-8
    assert bent.bend > 1e-3


class Creeping(JointPD):
    """PD whose position follows no faster than 3e-7 rad a tick."""

    def reset(self, t, measurement):
        self.seen = measurement.theta.copy()

    def tick(self, t, measurement, out):
        self.seen += np.clip(measurement.theta - self.seen, -3e-7, 3e-7)
        out[:] = -self.stiffness * self.seen


class Integral(JointPD):
    def reset(self, t, measurement):
        self.sum = np.zeros(2)

    def tick(self, t, measurement, out):
        self.sum += 0.01 * (0.1 + self.target - measurement.theta)
        out[:] = self.sum


@pytest.mark.parametrize(
    ("controller", "changes", "words"),
    [
        (Creeping(np.zeros(2), stiffness=10.0), {}, "remembers"),
        (Integral(np.zeros(2), stiffness=10.0), {}, "does not settle"),
        (JointPD(np.array([0.5, 0.0]), stiffness=10.0), {"theta": np.zeros(2)}, "does not hold"),
        (JointPD(np.full(2, np.nan), stiffness=10.0), {}, "not finite"),
        (JointPD(np.zeros(2), stiffness=10.0), {"q": np.zeros(3)}, "q must be"),
        (JointPD(np.zeros(2), stiffness=10.0), {"theta": np.zeros(3)}, "theta must be"),
    ],
)
def test_what_cannot_be_frozen_is_named(controller, changes, words, arm):
    robot, motors, _ = arm
    with pytest.raises(InputError, match=words):
        sealag.freeze(controller, robot, motors, **{"q": np.zeros(2), **changes})


def test_gravity_that_nothing_carries_is_named():
    system = design("baxter", MotorAngles())
    pd = JointPD(system.robot.joint_positions(system.posture), stiffness=50.0)
    with pytest.raises(InputError, match="of gravity is left"):
        sealag.freeze(pd, system.robot, system.actuators, q=system.posture)
