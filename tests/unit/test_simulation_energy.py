"""The first law on Hume, with nothing lost and with everything on; and the passivity observer."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from helpers.chains import planar_arm, wheel
from helpers.controllers import Constant as ConstantTorque
from helpers.controllers import JointPD, StoringPD
from sealag.actuation import Actuators
from sealag.delay import Constant, Link, PacketOrder, Sinusoid
from sealag.robot import Contact
from sealag.simulation import (
    Clock,
    Foot,
    Network,
    Outcome,
    Push,
    Scene,
    closed_loop,
)
from sealag.walking import GroundProfile

FEET = ("left_foot", "right_foot")
ROTOR = np.array([0.1357, 0.093, 0.093] * 2)


def _standing(robot, clearance=0.0):
    q = robot.configuration(np.deg2rad([0, -25, 55, 0, -25, 55]))
    low = min(robot.frame_placement(foot, q)[1][2] for foot in FEET)
    q[2] += clearance - low
    return q


def _everything(robot):
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=1000.0,
        rotor_inertia=ROTOR,
        inertia_shaping=0.5,
        motor_damping=np.array([3.0, 20.0, 20.0] * 2),
        spring_damping=0.5,
        coulomb_friction=0.4,
        viscous_friction=0.3,
        torque_limit=60.0,
        velocity_limit=20.0,
        torque_bandwidth=1500.0,
    )
    link = Link(delay=Sinusoid(mean=4e-3, amplitude=2e-3, angular_frequency=3.0), jitter=2e-3)
    lossy = dataclasses.replace(link, loss=0.1, order=PacketOrder.NEWEST)
    short = Link(delay=Constant(value=1e-3))
    network = Network(central_up=link, central_down=lossy, embedded_down=short, embedded_up=short)
    feet = [
        Foot(
            contact=Contact(frame=foot),
            friction=0.4,
            torsional_damping=3.0,
            torsional_radius=0.01,
        )
        for foot in FEET
    ]
    pushes = [Push(frame="torso", force=(60.0, 20.0, 0.0), start=0.15, duration=0.1)]
    return springs, network, Scene(feet=feet, ground=GroundProfile.flat(0.1), pushes=pushes)


def test_nothing_lost_on_a_held_foot(hume):
    """No damping, friction, impact or delay: 1e-6 of the throughput, at fourth order."""
    springs = Actuators.of(
        hume.joints, spring_stiffness=1000.0, rotor_inertia=ROTOR, motor_damping=1e-12
    )
    q = _standing(hume)
    scene = Scene(feet=[Foot(contact=Contact(frame=FEET[0]), friction=np.inf)])
    closures = []
    for step in (2e-3, 1e-3):
        run = closed_loop(
            hume,
            springs,
            JointPD(q[-6:], stiffness=200.0, offset=5.0),
            q=q,
            theta=q[-6:],
            duration=0.3,
            clock=Clock(physics=step, central=2e-3),
            scene=scene,
        )
        assert run.outcome is Outcome.COMPLETED
        closures.append(run.audit.closure)
    assert closures[1] < 1e-7
    assert closures[0] / closures[1] > 8
    assert run.audit.throughput[-1] > 10
    for name in ("viscous", "coulomb", "spring_damping", "damping"):
        assert np.abs(run.audit.joint_flows[name]).max() < 1e-9


def test_rounding_of_stores_at_rest_is_no_open_book(hume):
    q = _standing(hume)
    springs = Actuators.of(
        hume.joints, spring_stiffness=1e3, rotor_inertia=ROTOR, motor_damping=1.0
    )
    run = closed_loop(hume, springs, JointPD(q[-6:], stiffness=200.0), q=q, duration=0.01)
    stored = np.abs(list(run.audit.stores.values())).sum(axis=0).max()
    ones = np.ones_like(run.time)
    for error, largest in ((1e-14, 1e-7), (1e-6, 2.0)):
        still = replace(run.audit, throughput=1e-13 * ones, residual=error * stored * ones)
        assert still.closure == pytest.approx(1e6 * error)
        assert still.closure < largest
    moved = replace(run.audit, throughput=stored * ones, residual=1e-14 * stored * ones)
    assert moved.closure == pytest.approx(1e-14)


def test_everything_on_closes(hume):
    springs, network, scene = _everything(hume)
    q = _standing(hume, clearance=0.11)
    run = closed_loop(
        hume,
        springs,
        JointPD(q[-6:], stiffness=300.0, damping=2.0),
        q=q,
        duration=0.5,
        clock=Clock(physics=5e-4, embedded=1e-3, central=2e-3),
        network=network,
        scene=scene,
        seed=3,
    )
    assert run.outcome is Outcome.COMPLETED
    assert run.audit.closure < 1e-4
    works = run.audit.scalar_flows | {k: v.sum(axis=1) for k, v in run.audit.joint_flows.items()}
    for name in ("damping", "viscous", "coulomb", "spring_damping", "impact"):
        assert works[name][-1] > 1e-3, name
        assert np.diff(works[name]).min() > -1e-12, name  # lost for good
    assert works["sliding"][-1] < -1e-6
    assert works["torsion"][-1] < -1e-6
    assert works["disturbance"][-1] > 1e-2
    # the books would not close without each of them
    for name in ("viscous", "coulomb", "spring_damping", "impact", "disturbance"):
        assert abs(works[name][-1]) > 5 * np.abs(run.audit.residual).max(), name


def test_motor_books_balance_by_themselves(hume):
    """Δ½ θ̇ᵀB θ̇ = motor work - shaft work - friction, all five from separate integrals."""
    springs, network, scene = _everything(hume)
    q = _standing(hume, clearance=0.1)
    run = closed_loop(
        hume,
        springs,
        JointPD(q[-6:], stiffness=300.0, damping=2.0),
        q=q,
        duration=0.2,
        network=network,
        scene=scene,
    )
    flows = {name: work.sum(axis=1) for name, work in run.audit.joint_flows.items()}
    motor = run.audit.stores["motor"]
    work = flows["motor_work"] - flows["shaft"] - flows["viscous"] - flows["coulomb"]
    np.testing.assert_allclose(motor - motor[0], work, atol=1e-9)
    spring = run.audit.stores["spring"]
    work = flows["shaft"] - flows["port"] - flows["spring_damping"]
    np.testing.assert_allclose(spring - spring[0], work, atol=1e-9)


class TestPassivityObserver:
    """One joint, motor-angle feedback: delay below and above the bound 0.1 s of Eq. (29)."""

    def _run(self, folder, delay, duration=1.0):
        robot = wheel(folder, inertia=1.0)
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=10.0
        )
        none = Link(delay=Constant(value=0.0))
        late = Link(delay=Constant(value=delay))
        return closed_loop(
            robot,
            springs,
            StoringPD(np.zeros(1), stiffness=100.0, motor=True),
            q=np.array([0.3]),
            theta=np.array([0.3]),
            duration=duration,
            network=Network(central_up=none, central_down=late, embedded_down=none),
        )

    def test_passive_below(self, tmp_path):
        audit = self._run(tmp_path, 0.06).audit
        assert audit.joint_side.passive
        assert audit.controller_side is not None
        assert audit.controller_side.passive
        assert audit.controller_side.first_violation is None
        assert audit.controller_storage[0] == pytest.approx(0.5 * 100 * 0.3**2)
        assert audit.delay_injection.max() > 0.1  # which the damping took
        assert audit.delay_side.passive
        # a law with a potential gives nothing, to the error of what is integrated from the log
        assert np.abs(audit.law_injection).max() < audit.delay_side.tolerance < 2e-3

    def test_without_delay_nothing_is_injected(self, tmp_path):
        audit = self._run(tmp_path, 0.0).audit
        late = self._run(tmp_path, 0.06).audit
        # the hold of the 1 kHz loop is all that is left
        assert np.abs(audit.delay_injection).max() < 0.02 * late.delay_injection.max()

    def test_not_passive_far_above(self, tmp_path):
        run = self._run(tmp_path, 0.3, duration=3.0)
        side = run.audit.controller_side
        assert side is not None
        assert not side.passive
        assert side.joint == "joint0"
        assert 0.1 < side.first_violation < 3.0
        assert not run.audit.delay_side.passive
        assert run.audit.joint_side.passive  # springs and motors are, whatever drives them

    @pytest.mark.parametrize(("delay", "passive"), [(0.06, True), (0.3, False)])
    def test_the_paper_s_ports_lie_at_the_links(self, tmp_path, delay, passive):
        """S_j = V_1 at (τ_sea, q̇), S_c at (q̇, −τ_sea): from the log alone, Eqs. (25)-(28)."""
        run = self._run(tmp_path, delay, duration=1.0 if passive else 3.0)
        audit, q_dot = run.audit, run.v[:, 0]
        given = np.append(0.0, np.cumsum(0.5 * np.diff(run.q[:, 0]) * (
            run.tau_sea[1:, 0] + run.tau_sea[:-1, 0])))  # fmt: skip
        V_1 = 0.5 * 1.0 * q_dot**2 + audit.stores["gravity"]
        V_2 = 0.5 * 0.09 * run.theta_dot[:, 0] ** 2 + run.tau_sea[:, 0] ** 2 / (2.0 * 350.0)
        S_c = V_2 + 0.5 * 100.0 * run.theta[:, 0] ** 2
        rough = 1e-3 * np.abs(given).max()
        np.testing.assert_allclose(audit.joint_port.slack, given - V_1 + V_1[0], atol=rough)
        np.testing.assert_allclose(audit.controller_port.slack, S_c[0] - S_c - given, atol=rough)
        assert audit.joint_port.passive  # links are, whatever drives them
        assert audit.controller_port.passive == passive
        # with ideal drives the springs only pass on what the other port lets through
        np.testing.assert_allclose(
            audit.controller_port.slack, audit.controller_side.slack, atol=1e-6
        )
        if not passive:
            assert audit.controller_port.joint == "joint0"

    def test_the_work_of_a_push_is_nobody_s_activity(self, tmp_path):
        """The joint side stores what a push gives; without that in its books it looks active."""
        robot = planar_arm(tmp_path, count=2, mass=1.0, inertia=0.05, length=0.4)
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=[10.0, 8.0]
        )
        push = Push(frame="link1", force=(0.0, 60.0, 60.0), start=0.1, duration=0.1)
        run = closed_loop(
            robot,
            springs,
            StoringPD(np.zeros(2), stiffness=20.0, motor=True),
            q=np.zeros(2),
            theta=np.zeros(2),
            duration=0.5,
            scene=Scene(pushes=[push]),
        )
        given = run.audit.scalar_flows["disturbance"]
        assert given.max() > 0.1
        assert run.audit.joint_side.passive
        assert run.audit.joint_side.slack[-1] < given[-1], "its slack holds the push's work"
        assert run.audit.joint_port.passive
        assert run.audit.joint_port.slack[-1] < given[-1]

    @pytest.mark.parametrize("guilty", [0, 1])
    def test_the_joint_that_delivers_is_named(self, tmp_path, guilty):
        """Two joints that hardly feel each other, one of them ten times too stiff for its delay."""
        robot = planar_arm(tmp_path, count=2, mass=1e-3, inertia=1.0, length=1e-3)
        stiffness = np.full(2, 5.0)
        stiffness[guilty] = 100.0
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=[10.0, 8.0]
        )
        none = Link(delay=Constant(value=0.0))
        run = closed_loop(
            robot,
            springs,
            StoringPD(np.zeros(2), stiffness=stiffness, motor=True),
            q=np.array([0.3, 0.3]),
            theta=np.array([0.3, 0.3]),
            duration=3.0,
            network=Network(
                central_up=none, central_down=Link(delay=Constant(0.3)), embedded_down=none
            ),
        )
        for side in (run.audit.controller_side, run.audit.delay_side):
            assert not side.passive
            assert side.joint == f"joint{guilty}"

    @pytest.mark.parametrize("weak", [0, 1])
    def test_a_motor_too_weak_to_brake_is_named(self, tmp_path, weak):
        """Both motors run and are told to stop; one cannot, so that its side keeps energy that the
        port says it has given: −∫(τ_osc − D_θ θ̇)ᵀθ̇ dt grows with its speed."""
        robot = planar_arm(tmp_path, count=2, mass=1e-3, inertia=1.0, length=1e-3)
        limit = np.full(2, 1e3)
        limit[weak] = 0.5
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=[10.0, 8.0]
        )
        speed = np.array([0.9, 0.9])
        speed[weak] = 1.3

        def side(limit):
            run = closed_loop(
                robot, replace(springs, torque_limit=limit),
                JointPD(np.zeros(2), stiffness=0.0, damping=5.0, motor=True),
                q=np.zeros(2), theta=np.zeros(2), v=speed, theta_dot=speed, duration=0.05,
            )  # fmt: skip
            return run.audit.joint_side

        assert side(np.full(2, 1e3)).passive
        assert not side(limit).passive
        assert side(limit).joint == f"joint{weak}"

    def test_no_statement_without_storage(self, tmp_path):
        robot = wheel(tmp_path)
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=10.0
        )
        run = closed_loop(robot, springs, ConstantTorque([1.0]), q=np.zeros(1), duration=0.05)
        assert run.audit.controller_side is None
        assert run.audit.delay_side is None
        assert run.audit.delay_injection is None

    @pytest.mark.parametrize(("share", "passive"), [(7e-11, True), (1e-7, False)])
    def test_rounding_of_large_energies_is_no_violation(self, tmp_path, share, passive):
        """A potential of 200 J that iterations know to 1.4e-8 J, of a robot that stands still; one
        that jumps by 2e-5 J is the control. Before the first tick, potential and motion agree."""

        class Jumping(StoringPD):
            def storage(self, t, measurement, command):
                return 200.0 * (1.0 + share * (t > 0.0)) + super().storage(t, measurement, command)

        robot = wheel(tmp_path, inertia=1.0)
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=10.0
        )
        run = closed_loop(
            robot, springs, Jumping(np.zeros(1), stiffness=100.0, motor=True),
            q=np.zeros(1), theta=np.zeros(1), duration=0.1,
        )  # fmt: skip
        side = run.audit.controller_side
        assert side.slack.min() == pytest.approx(-200.0 * share, rel=1e-3)
        assert side.passive is passive
        assert side.tolerance == pytest.approx(1e-9 * 200.0, rel=1e-6)
        assert run.audit.joint_side.tolerance < 1e-12, "nothing moves, and nothing is stored there"

    def test_a_law_without_a_potential_is_told_from_the_delay(self, tmp_path):
        """Stiffness that is said to be half of what it is: the law gives, the delay does not."""

        class Half(StoringPD):
            def storage(self, t, measurement, command):
                return 0.5 * super().storage(t, measurement, command)

        robot = wheel(tmp_path, inertia=1.0)
        springs = Actuators.of(
            robot.joints, spring_stiffness=350.0, rotor_inertia=0.09, motor_damping=10.0
        )
        run = closed_loop(
            robot, springs, Half(np.zeros(1), stiffness=100.0, motor=True),
            q=np.array([0.3]), theta=np.array([0.3]), duration=0.5,
        )  # fmt: skip
        assert run.audit.law_injection.max() > 1.0
        assert np.abs(run.audit.delay_injection).max() < 0.05
        assert run.audit.delay_side.passive
