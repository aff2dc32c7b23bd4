"""Terrain, contact frames, and soles that share load between their corners."""

import numpy as np
import pytest

from helpers.controllers import JointPD
from sealag.actuation import Actuators
from sealag.errors import InputError
from sealag.robot import Contact, ContactKind, load_robot
from sealag.simulation import Clock, Foot, Outcome, Push, Scene, closed_loop
from sealag.walking import GroundProfile


class Slope:
    """A plane that rises along x."""

    def __init__(self, rise):
        self.rise = rise

    def height(self, x, y):
        """Return the height."""
        return self.rise * x


class SlopeWithNormal(Slope):
    """The same with its own normal, of some length, turned by an angle about y."""

    def __init__(self, rise, turned=0.0):
        super().__init__(rise)
        self.angle = np.arctan(rise) + turned

    def normal(self, x, y):
        """Return the normal."""
        return 3.0 * np.array([-np.sin(self.angle), 0.0, np.cos(self.angle)])


def _run(robot, ground, friction, duration=0.2):
    springs = Actuators.of(
        robot.joints,
        spring_stiffness=1000.0,
        rotor_inertia=0.1,
        inertia_shaping=0.5,
        motor_damping=20.0,
    )
    q = robot.configuration(np.deg2rad([0, -25, 55, 0, -25, 55]))
    feet = ("left_foot", "right_foot")
    places = [robot.frame_placement(foot, q)[1] for foot in feet]
    q[2] += max(ground.height(x, y) - z for x, y, z in places)
    scene = Scene(
        feet=[Foot(contact=Contact(frame=foot), friction=friction) for foot in feet],
        ground=ground,
        fall=None,
    )
    controller = JointPD(q[-6:], stiffness=300.0, damping=2.0)
    run = closed_loop(robot, springs, controller, q=q, duration=duration, scene=scene)
    assert run.outcome is Outcome.COMPLETED
    return run


def test_feet_hold_on_a_slope_only_with_enough_friction(hume):
    steep = Slope(0.3)
    held, slid = _run(hume, steep, 1.5), _run(hume, steep, 0.05)
    foot = [
        np.array([hume.frame_placement("left_foot", q)[1] for q in run.q])[60:]
        for run in (held, slid)
    ]
    assert np.ptp(foot[0], axis=0).max() < 1e-7
    assert np.ptp(foot[1][:, 0]) > 0.01
    closed = slid.contact_mode[60:, 0] > 0
    np.testing.assert_allclose(foot[1][closed, 2], 0.3 * foot[1][closed, 0], atol=1e-6)
    for run in (held, slid):
        assert run.audit.closure < 1e-5


def test_a_slope_s_own_normal_is_that_of_its_heights(hume):
    """The control turns it by a tenth of a degree: a frictionless foot then slides elsewhere."""
    heights, own, turned = (
        _run(hume, ground, 1e-9)
        for ground in (Slope(0.3), SlopeWithNormal(0.3), SlopeWithNormal(0.3, np.deg2rad(0.1)))
    )
    apart = [np.abs(run.q - heights.q).max() for run in (own, turned)]
    assert apart[0] < 1e-7
    assert apart[1] > 1e-4


def test_a_level_ground_is_a_slope_that_does_not_rise(hume):
    flat, high = _run(hume, GroundProfile.flat(2.0), 0.5), _run(hume, Slope(0.0), 0.5)
    down = np.zeros(flat.q.shape[1])
    down[2] = 2.0
    np.testing.assert_allclose(flat.q - down, high.q, atol=1e-7)


class TestSoles:
    """Talos on two rectangular soles, eight redundant corners."""

    soles = ("left_sole_link", "right_sole_link")

    def _run(self, push):
        robot = load_robot("example-robot-data:talos_data/robots/talos_reduced.urdf",
                           floating_base=True)  # fmt: skip
        knees = {
            f"leg_{side}_{k}_joint": angle
            for side in ("left", "right")
            for k, angle in ((3, -0.4), (4, 0.8), (5, -0.4))
        }
        q = robot.configuration(knees)
        q[2] -= min(robot.frame_placement(sole, q)[1][2] for sole in self.soles)
        strong = np.array(["leg" in joint or "torso" in joint for joint in robot.joints])
        springs = Actuators.of(
            robot.joints,
            spring_stiffness=np.where(strong, 3000.0, 50.0),
            rotor_inertia=0.1,
            inertia_shaping=0.5,
            motor_damping=np.where(strong, 30.0, 3.0),
        )
        feet = [
            Foot(
                contact=Contact(frame=sole, kind=ContactKind.SURFACE),
                half_length=0.1,
                half_width=0.06,
            )
            for sole in self.soles
        ]
        J = robot.contact_jacobian([foot.contact for foot in feet], q)
        g = robot.gravity(q)
        hold = (g - J.T @ np.linalg.lstsq(J[:, :6].T, g[:6], rcond=None)[0])[6:]
        controller = JointPD(
            q[7:],
            stiffness=np.where(strong, 800.0, 10.0),
            damping=np.where(strong, 10.0, 0.02),
            offset=hold,
        )
        shove = Push(frame="torso_2_link", force=(push, 0.0, 0.0), start=0.05, duration=0.1)
        scene = Scene(feet=feet, pushes=[shove])
        run = closed_loop(robot, springs, controller, q=q, duration=0.25, scene=scene)
        assert run.outcome is Outcome.COMPLETED
        return robot, run

    def test_standing_shares_the_weight(self):
        robot, run = self._run(1e-9)
        assert (run.contact_mode == 1).all()
        normal = run.contact_force[-1, :, 2]
        assert normal.sum() == pytest.approx(robot.mass * 9.81, rel=1e-4)
        assert normal.min() > 50.0
        assert not run.events

    def test_a_push_lifts_the_heels(self):
        _, run = self._run(500.0)
        opened = {event.point for event in run.events}
        assert opened <= {2, 3, 6, 7}  # the corners behind
        assert opened
        assert (run.contact_mode[:, [0, 1, 4, 5]] > 0).all()
        assert run.audit.closure < 1e-4


def test_a_step_too_long_for_a_light_link_is_refused(hume):
    springs = Actuators.of(hume.joints, spring_stiffness=1e6, rotor_inertia=0.1, motor_damping=20.0)
    controller = JointPD(np.zeros(6), stiffness=0.0)
    options = {"q": hume.neutral(), "duration": 0.01}
    with pytest.raises(InputError, match=r"step of 1 ms is too long.*simulation\.physics_step_ms"):
        closed_loop(hume, springs, controller, **options)
    fine = Clock(physics=1e-4, central=1e-3)
    closed_loop(hume, springs, controller, scene=Scene(), clock=fine, **options)
