"""Scenes that cannot be simulated end in a sentence; runs that go wrong end in a named outcome."""

import signal

import numpy as np
import pytest

from helpers.chains import chain, wheel
from helpers.controllers import Constant as ConstantTorque
from helpers.controllers import JointPD
from sealag.actuation import Actuators
from sealag.delay import Constant, Link
from sealag.errors import ContractionError, InputError, SolverError, UnknownNameError
from sealag.robot import Contact, ContactKind
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


@pytest.fixture(scope="module")
def springs(hume):
    return Actuators.of(
        hume.joints,
        spring_stiffness=1000.0,
        rotor_inertia=0.1,
        inertia_shaping=0.5,
        motor_damping=20.0,
    )


class _FailsAfterStart(JointPD):
    """Answers while the rest is sought, fails in the loop's first tick."""

    answers = 2

    def tick(self, t, measurement, out):
        self.answers -= 1
        if self.answers < 0:
            raise ContractionError("the task is stiffer than the springs")
        super().tick(t, measurement, out)


def _posture(robot, clearance=0.0, knee=55):
    q = robot.configuration(np.deg2rad([0, -25, knee, 0, -25, knee]))
    low = min(robot.frame_placement(foot, q)[1][2] for foot in FEET)
    q[2] += clearance - low
    return q


def _feet(**options):
    return [Foot(contact=Contact(frame=foot), **options) for foot in FEET]


def _run(robot, springs, q, controller=None, **options):
    options.setdefault("scene", Scene(feet=_feet()))
    options.setdefault("duration", 0.2)
    controller = controller or JointPD(q[-6:], stiffness=300.0, damping=2.0)
    return closed_loop(robot, springs, controller, q=q, **options)


class TestStart:
    def test_rounded_joint_angles_are_led_to_the_ground(self, hume):
        q = _posture(hume)
        q[-3:] += [2e-3, -1e-3, 3e-3]
        gaps = [hume.frame_placement(foot, q)[1][2] for foot in FEET]
        assert abs(gaps[0] - gaps[1]) > 1e-4  # without help one foot is in the air
        stands = Scene(feet=_feet()).touching_posture(hume, q)
        heights = [hume.frame_placement(foot, stands)[1][2] for foot in FEET]
        assert np.abs(heights).max() < 1e-9
        assert np.abs(hume.difference(q, stands)).max() < 2 * abs(gaps[0] - gaps[1])

    def test_a_touching_posture_stays(self, hume):
        stands = Scene(feet=_feet()).touching_posture(hume, _posture(hume))
        again = Scene(feet=_feet()).touching_posture(hume, stands)
        np.testing.assert_allclose(again, stands, rtol=0, atol=1e-9)

    def test_a_foot_in_the_air_is_named(self, hume):
        q = _posture(hume)
        q[-1] += 0.3
        with pytest.raises(InputError, match=r"foot right_foot is .* mm above .* left_foot"):
            Scene(feet=_feet()).touching_posture(hume, q)

    def test_springs_at_rest_under_a_command_stiffer_than_they_are(self, hume, springs):
        q = _posture(hume)
        controller = JointPD(q[-6:] + 0.01, stiffness=3000.0, offset=5.0, motor=True)
        run = _run(hume, springs, q, controller, duration=2e-3)
        carried = springs.spring_stiffness * (run.theta[0] - q[-6:])
        np.testing.assert_allclose(carried, run.tau_osc[0], rtol=0, atol=1e-6)
        assert np.abs(carried).max() > 1.0

    def test_a_controller_that_fails_at_once_leaves_the_first_instant(self, hume, springs):
        q = _posture(hume)
        run = _run(hume, springs, q, _FailsAfterStart(q[-6:], stiffness=1.0))
        assert run.outcome is Outcome.CONTROLLER_FAILED
        assert run.time.tolist() == [0.0]
        np.testing.assert_array_equal(run.q[0], q)


class TestRefused:
    def test_foot_inside_the_ground(self, hume, springs):
        with pytest.raises(InputError, match=r"left_foot begins 20 mm inside the ground"):
            _run(hume, springs, _posture(hume, clearance=-0.02))

    def test_foot_inside_raised_ground(self, hume, springs):
        scene = Scene(feet=_feet(), ground=GroundProfile.flat(0.05))
        with pytest.raises(InputError, match="inside the ground"):
            _run(hume, springs, _posture(hume), scene=scene)

    @pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf, 1e-4])
    def test_no_duration(self, hume, springs, duration):
        with pytest.raises(InputError, match="duration"):
            _run(hume, springs, _posture(hume), duration=duration)

    @pytest.mark.parametrize(
        "changes", [{"q": np.zeros(5)}, {"q": np.full(13, np.nan)}, {"v": np.zeros(3)}]
    )
    def test_shapes_and_numbers(self, hume, springs, changes):
        options = {"q": _posture(hume), "duration": 0.1, **changes}
        with pytest.raises(InputError, match="finite numbers"):
            closed_loop(hume, springs, ConstantTorque(np.zeros(6)), **options)

    def test_actuators_of_another_robot(self, hume, tmp_path):
        robot = wheel(tmp_path)
        other = Actuators.of(["x"], spring_stiffness=1, rotor_inertia=1, motor_damping=1)
        with pytest.raises(InputError, match="actuators are for joints"):
            closed_loop(robot, other, ConstantTorque([0.0]), q=np.zeros(1), duration=0.1)

    def test_unknown_foot(self, hume, springs):
        scene = Scene(feet=[Foot(contact=Contact(frame="left_fot"))])
        with pytest.raises(UnknownNameError, match="left_foot"):
            _run(hume, springs, _posture(hume), scene=scene)

    def test_periods_that_do_not_fit(self):
        with pytest.raises(InputError, match="whole multiple"):
            Clock(physics=1e-3, central=1.5e-3)
        with pytest.raises(InputError, match="> 0 s"):
            Clock(physics=-1e-3)

    def test_values_of_feet_and_pushes(self):
        with pytest.raises(InputError, match="friction"):
            Foot(contact=Contact(frame="f"), friction=-0.1)
        with pytest.raises(InputError, match="half_length"):
            Foot(contact=Contact(frame="f", kind=ContactKind.SURFACE))
        with pytest.raises(InputError, match="force"):
            Push(frame="torso", force=(np.inf, 0, 0), start=0, duration=1)
        with pytest.raises(InputError, match="duration"):
            Push(frame="torso", force=(1, 0, 0), start=0, duration=0)

    def test_torque_limits_that_cannot_hold(self, hume):
        q = _posture(hume)
        scene = Scene(feet=_feet())
        hold = scene.require_hold(hume, q, torque_limit=np.full(6, 100.0))
        assert hold.use < 1
        assert hold.force[:, 2].sum() == pytest.approx(hume.mass * 9.81, rel=0.2)
        with pytest.raises(InputError, match=r"cannot hold .* left_knee needs at least 40.5 Nm"):
            scene.require_hold(hume, q, torque_limit=np.full(6, 5.0))
        with pytest.raises(InputError, match="no foot touches"):
            above = _posture(hume, clearance=0.1)
            scene.require_hold(hume, above, torque_limit=np.full(6, 100.0))

    def test_the_weak_joint_is_named_and_not_the_loaded_one(self, tmp_path):
        """Two links held out: 9.81 (0.5 + 1) Nm and 9.81 * 0.5 Nm."""
        arm = chain(tmp_path, count=2, along="x")
        scene = Scene()
        limit = np.array([16.0, 4.0])
        with pytest.raises(InputError, match=r"joint joint1 needs at least 4.91 Nm and has 4 Nm"):
            scene.require_hold(arm, np.zeros(2), torque_limit=limit)
        with pytest.raises(InputError, match=r"joint joint0 needs at least 14.7 Nm and has 14 Nm"):
            scene.require_hold(arm, np.zeros(2), torque_limit=np.array([14.0, 5.0]))
        hold = scene.require_hold(arm, np.zeros(2), torque_limit=np.array([16.0, 5.0]))
        np.testing.assert_allclose(np.abs(hold.torque), 9.81 * np.array([1.5, 0.5]))


class TestNamedEnds:
    def test_fall(self, hume, springs):
        q = _posture(hume)
        run = _run(hume, springs, q, ConstantTorque(np.zeros(6)), theta=q[-6:], duration=2.0)
        assert run.outcome is Outcome.FELL
        assert "above the ground" in run.message
        assert 0.2 < run.time[-1] < 1.0
        assert len(run.time) == len(run.q) == len(run.audit.residual)
        assert np.isfinite(run.q).all()

    def test_divergence(self, hume, springs):
        controller = JointPD(np.zeros(6), stiffness=-3000.0)
        run = _run(hume, springs, _posture(hume), controller, theta=np.zeros(6), duration=3.0,
                   scene=Scene(fall=None))  # fmt: skip
        assert run.outcome is Outcome.DIVERGED
        assert run.time[-1] < 3.0

    def test_controller_that_gives_up(self, hume, springs):
        class GivesUp(ConstantTorque):
            def tick(self, t, measurement, out):
                super().tick(t, measurement, out)
                if t > 0.05:
                    raise ContractionError("no fixed point")

        run = _run(hume, springs, _posture(hume), GivesUp(np.zeros(6)))
        assert run.outcome is Outcome.CONTROLLER_FAILED
        assert "no fixed point" in run.message
        assert run.time[-1] == pytest.approx(0.05)

    def test_controller_whose_arithmetic_breaks_down(self, hume, springs):
        class Singular(ConstantTorque):
            def tick(self, t, measurement, out):
                super().tick(t, measurement, out)
                if t > 0.05:
                    np.linalg.inv(np.zeros((2, 2)))

        run = _run(hume, springs, _posture(hume), Singular(np.zeros(6)))
        assert run.outcome is Outcome.CONTROLLER_FAILED
        assert "controller cannot be evaluated: Singular matrix" in run.message
        assert run.time[-1] == pytest.approx(0.05)

    def test_controller_whose_arithmetic_breaks_down_before_the_run(self, hume, springs):
        class Overflows(ConstantTorque):
            def tick(self, t, measurement, out):
                out[:] = 10.0**400

        with pytest.raises(SolverError, match="controller cannot be evaluated"):
            _run(hume, springs, _posture(hume), Overflows(np.zeros(6)))

    @pytest.mark.parametrize("error", [np.linalg.LinAlgError("Singular matrix"), OverflowError()])
    def test_plant_whose_arithmetic_breaks_down(self, hume, springs, error):
        class Breaks(ConstantTorque):
            late = False

            def tick(self, t, measurement, out):
                super().tick(t, measurement, out)
                self.late = t > 0.05

        controller = Breaks(np.zeros(6))

        class Ground:
            def height(self, x, y):
                if controller.late:
                    raise error
                return 0.0

        scene = Scene(feet=_feet(), ground=Ground())
        run = _run(hume, springs, _posture(hume), controller, scene=scene)
        assert run.outcome is Outcome.DIVERGED
        assert "cannot be computed after t = 0.05" in run.message
        assert 0.04 < run.time[-1] < 0.06
        assert np.isfinite(run.q).all()

    def test_an_error_of_the_program_is_not_hidden(self, hume, springs):
        """Negative control: what is no arithmetic stays an exception."""

        class Wrong(ConstantTorque):
            def tick(self, t, measurement, out):
                out[:] = np.zeros(5)

        with pytest.raises(ValueError, match="broadcast"):
            _run(hume, springs, _posture(hume), Wrong(np.zeros(6)))

    def test_command_that_is_no_number(self, hume, springs):
        class Broken(ConstantTorque):
            def tick(self, t, measurement, out):
                out[:] = np.nan if t > 0.05 else 0.0

        run = _run(hume, springs, _posture(hume), Broken(np.zeros(6)))
        assert run.outcome is Outcome.CONTROLLER_FAILED
        assert "not finite" in run.message

    def test_interrupt_keeps_what_was_simulated(self, hume, springs):
        def stop(t):
            if t > 0.09:
                raise KeyboardInterrupt

        run = _run(hume, springs, _posture(hume), progress=stop)
        assert run.outcome is Outcome.INTERRUPTED
        assert run.time[-1] == pytest.approx(0.1)
        assert np.isfinite(run.q).all()

    @pytest.mark.parametrize("method", ["reset", "tick"])
    def test_ctrl_c_before_the_first_step_keeps_the_first_instant(self, hume, springs, method):
        """A run is set up by compiled calls too, inside which nothing may be raised."""

        class Pressed(ConstantTorque):
            def reset(self, t, measurement):
                if method == "reset":
                    signal.raise_signal(signal.SIGINT)

            def tick(self, t, measurement, out):
                if method == "tick" and t == 0.0:
                    signal.raise_signal(signal.SIGINT)
                super().tick(t, measurement, out)

        signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background
        run = _run(hume, springs, _posture(hume), Pressed(np.zeros(6)))
        assert run.outcome is Outcome.INTERRUPTED
        np.testing.assert_array_equal(run.time, [0.0])
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


class TestContact:
    def test_touchdown_is_located_inside_the_step(self, hume, springs):
        """Free fall from rest with springs at rest: the foot lands at sqrt(2 h / g)."""
        height = 0.02
        q = _posture(hume, clearance=height)
        run = _run(hume, springs, q, ConstantTorque(np.zeros(6)), theta=q[-6:], duration=0.07,
                   clock=Clock(physics=5e-3, central=5e-3))  # fmt: skip
        hit = next(e for e in run.events if e.kind == "touchdown")
        assert hit.time == pytest.approx(np.sqrt(2 * height / 9.81), abs=1e-7)
        assert hit.impulse[2] > 0.0

    def test_foot_stays_where_it_landed(self, hume, springs):
        q = _posture(hume, clearance=0.01)
        run = _run(hume, springs, q, duration=0.3)
        closed = run.contact_mode.all(axis=1)
        assert not (run.contact_mode[closed] == 2).any()
        places = np.array([hume.frame_placement(FEET[0], row)[1] for row in run.q[closed]])
        assert closed.sum() > 100
        assert np.ptp(places, axis=0).max() < 3e-5  # what friction needs to stop it
        assert np.ptp(places[30:], axis=0).max() < 1e-8  # and then it stays
        assert np.abs(places[:, 2]).max() < 1e-7

    def test_forces_stay_in_the_cone(self, hume, springs):
        q = _posture(hume, clearance=0.01)
        scene = Scene(feet=_feet(friction=0.15), fall=None)
        run = _run(hume, springs, q, v=np.r_[1.0, np.zeros(11)], theta_dot=np.zeros(6),
                   scene=scene, duration=0.3)  # fmt: skip
        tangent = np.linalg.norm(run.contact_force[..., :2], axis=-1)
        normal = run.contact_force[..., 2]
        sliding = run.contact_mode == 2
        assert sliding.any()
        assert normal.min() >= -1e-6 * hume.mass * 9.81
        assert (tangent <= 0.15 * normal + 1e-6).all()
        np.testing.assert_allclose(tangent[sliding], 0.15 * normal[sliding], rtol=1e-6)

    def test_contact_forces_are_what_changes_the_momentum(self, hume, springs):
        run = _run(hume, springs, _posture(hume), duration=0.15)
        assert max(event.time for event in run.events) < 0.02
        speed = np.array([hume.com_jacobian(q) @ v for q, v in zip(run.q, run.v)])[20:]
        force = run.contact_force[20:].sum(axis=1) - [0.0, 0.0, hume.mass * 9.81]
        impulse = np.sum(0.5 * (force[1:] + force[:-1]) * 1e-3, axis=0)
        np.testing.assert_allclose(hume.mass * (speed[-1] - speed[0]), impulse, atol=2e-3)
        assert np.abs(impulse).max() > 0.1

    def test_push_moves_the_base_as_momentum_says(self, hume, springs):
        """In free flight a push of F dt changes the momentum by F dt."""
        q = _posture(hume, clearance=1.0)
        push = Push(frame="torso", force=(30.0, 0.0, 0.0), start=0.02, duration=0.05)
        scene = Scene(feet=_feet(), pushes=[push], fall=None)
        run = _run(hume, springs, q, scene=scene, duration=0.1)
        before, after = (
            hume.com_jacobian(run.q[k])[0] @ run.v[k] * hume.mass for k in (0, len(run.time) - 1)
        )
        assert after - before == pytest.approx(30.0 * 0.05, rel=1e-5)
        assert run.audit.scalar_flows["disturbance"][-1] > 0


class TestNetwork:
    def test_the_command_arrives_as_late_as_the_links_say(self, hume, springs):
        late = {"central_up": 3e-3, "central_down": 4e-3, "embedded_down": 2e-3}
        network = Network(**{k: Link(delay=Constant(value=v)) for k, v in late.items()})
        run = _run(hume, springs, _posture(hume), network=network, duration=0.1)
        inside = run.time[20:-1] > 0
        np.testing.assert_allclose(run.measurement_age[20:-1][inside], 3e-3, atol=1e-12)
        np.testing.assert_allclose(run.command_age[20:-1][inside], 6e-3, atol=1e-12)

    def test_a_seed_repeats_a_run_and_another_does_not(self, hume, springs):
        link = Link(delay=Constant(value=3e-3), jitter=4e-3, loss=0.2)
        network = Network(
            central_up=link, central_down=link, embedded_down=Link(delay=Constant(value=0.0))
        )
        runs = [
            _run(hume, springs, _posture(hume), network=network, seed=seed, duration=0.1)
            for seed in (7, 7, 8)
        ]
        np.testing.assert_array_equal(runs[0].q, runs[1].q)
        assert np.abs(runs[0].q - runs[2].q).max() > 0
        assert 0.4 * network.delay_bound(Clock()) < runs[0].ages.total
        assert runs[0].ages.total <= network.delay_bound(Clock())
