"""The phase-space plan against integration, and its whole-body motion against the robot."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sealag.errors import InputError, RobotError
from sealag.robot import load_robot
from sealag.walking import GroundProfile, WalkPlan

HUME = load_robot("bundled:hume.urdf", floating_base=True)
FEET = ("left_foot", "right_foot")
VARIED = {"apex_speed": [0.6, 0.55, 0.62, 0.6], "step_length": [0.4, 0.46, 0.43]}
HEIGHTS = {**VARIED, "com_height": [0.86, 0.8, 0.9, 0.84]}
SETTINGS = [{"steps": 7}, {"steps": 3, **VARIED}, {"steps": 3, **HEIGHTS}]


@pytest.mark.parametrize("settings", SETTINGS)
def test_follows_the_pendulum_equation(settings):
    plan = WalkPlan.over(GroundProfile.paper(), **settings)
    for stance in plan.stances:
        start = np.concatenate(stance.horizontal(stance.start)[:2])

        def rate(t, state, stance=stance):
            return np.concatenate([state[2:], stance.omega**2 * (state[:2] - stance.foot[:2])])

        end = solve_ivp(rate, (stance.start, stance.end), start, rtol=1e-11, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(
            end, np.concatenate(stance.horizontal(stance.end)[:2]), atol=1e-8
        )


@pytest.mark.parametrize("settings", SETTINGS)
def test_switches_are_smooth_and_apexes_straight(settings):
    plan = WalkPlan.over(GroundProfile.paper(), **settings)
    for before, after in zip(plan.stances[:-1], plan.stances[1:], strict=True):
        assert before.end == after.start
        for left, right in zip(
            before.horizontal(before.end)[:2], after.horizontal(after.start)[:2], strict=True
        ):
            np.testing.assert_allclose(left, right, atol=1e-10)
        assert before.side != after.side
        v = [
            s.apex_speed**2 + s.omega**2 * (before.horizontal(before.end)[0][0] - s.foot[0]) ** 2
            for s in (before, after)
        ]
        assert v[0] == pytest.approx(v[1], rel=1e-10)
    for stance in plan.stances:
        assert abs(stance.horizontal(stance.apex_time)[1][1]) < 1e-9
        assert stance.foot[2] == pytest.approx(plan.ground.height(*stance.foot[:2]))
    for t in np.linspace(0, plan.duration - 1e-6, 300):
        ahead, here = plan.com(t + 5e-7), plan.com(t)
        assert np.abs(ahead[0] - here[0] - 5e-7 * here[1]).max() < 1e-9


def test_even_walk_keeps_its_width():
    plan = WalkPlan.over(GroundProfile.flat(), steps=20)
    y = np.array([stance.foot[1] for stance in plan.stances])
    np.testing.assert_allclose(np.abs(np.diff(y)), 0.2, atol=1e-9)


@pytest.mark.parametrize("steps", [2, 3])
def test_feet_alternate_to_the_last_foothold(steps):
    plan = WalkPlan.over(GroundProfile.flat(), steps=steps)
    feet = [plan.previous_foot, *(one.foot for one in plan.stances), plan.next_foot]
    for stance, before, after in zip(plan.stances, feet[:-2], feet[2:], strict=True):
        for other in (before, after):
            assert np.sign(other[1] - stance.foot[1]) == stance.side.other.lateral


def test_planes_of_the_com_rise_from_foothold_to_foothold():
    """On uneven stairs with uneven steps; at the end the CoM still moves along its plane."""
    ground = GroundProfile.stairs([0.1, 0.05, -0.08, 0.04], run=0.4)
    plan = WalkPlan.over(ground, steps=3, **VARIED)
    feet = [plan.previous_foot, *(one.foot for one in plan.stances), plan.next_foot]
    for stance, before, after in zip(plan.stances, feet[:-2], feet[2:], strict=True):
        assert stance.slope == pytest.approx((after[2] - before[2]) / (after[0] - before[0]))
        assert plan.com(stance.apex_time)[0][2] == pytest.approx(stance.foot[2] + stance.height)
    last = plan.stances[-1]
    assert abs(last.slope) > 0.01
    assert plan.com(plan.duration)[1][2] == pytest.approx(last.slope * last.apex_speed)


@pytest.mark.parametrize("height", [0.0, 0.2])
def test_the_swing_foot_passes_over_what_lies_between(height):
    """A ridge in the middle of the first whole step, higher than the clearance."""
    ground = GroundProfile(
        x=np.array([0.0, 0.18, 0.2, 0.25, 0.27, 9.0]), z=np.array([0, 0, height, height, 0, 0])
    )
    plan = WalkPlan.over(ground, steps=2)
    step = plan.stances[1]
    assert step.foot[0] == pytest.approx(0.45)
    over = WalkPlan.over(ground, steps=2, step_length=0.45).stances[1]
    heights, clear = [], np.inf
    for t in np.linspace(over.start, over.end, 200):
        (x, y, z), _ = plan.swing(t, clearance=0.06)
        heights.append(z)
        clear = min(clear, z - ground.height(x, y))
    assert clear > -1e-9
    assert max(heights) == pytest.approx(0.06, abs=1e-3) if height == 0.0 else max(heights) > 0.2


@pytest.fixture(scope="module")
def walk():
    plan = WalkPlan.over(GroundProfile.paper(), steps=7)
    return plan, plan.motion(HUME, rate=1000.0)


def test_feet_stand_on_the_ground_and_limits_are_kept(walk):
    plan, motion = walk
    joints = HUME.joint_positions(motion.q)
    assert (joints > HUME.position_lower).all()
    assert (joints < HUME.position_upper).all()
    lowest = np.inf
    for k in range(0, len(motion), 7):
        stance = plan.stances[plan.index(motion.time[k])]
        contact = motion.contact_sets[motion.contact_index[k]][0]
        assert contact.frame == FEET[stance.side]
        stand = HUME.frame_placement(contact.frame, motion.q[k])[1]
        assert np.abs(stand - stance.foot).max() < 1e-6
        other = FEET[stance.side.other]
        x, y, z = HUME.frame_placement(other, motion.q[k])[1]
        lowest = min(lowest, z - plan.ground.height(x, y))
        R, _ = HUME.frame_placement("torso", motion.q[k])
        assert np.abs(R - np.eye(3)).max() < 1e-6
    assert lowest > -1e-6


def test_velocities_are_the_rates_of_the_configurations(walk):
    _, motion = walk
    worst = []
    for k in range(1, len(motion) - 1, 5):
        if motion.contact_index[k - 1] == motion.contact_index[k + 1]:
            rate = HUME.difference(motion.q[k - 1], motion.q[k + 1]) / 2e-3
            worst.append(np.abs(rate - motion.v[k]).max())
    assert np.max(worst) < 2e-3
    assert np.median(worst) < 2e-4


@pytest.mark.parametrize(
    ("ground", "steps"),
    [
        (GroundProfile.paper(), 1),
        (GroundProfile.rough(3), 20),
        (GroundProfile.stairs([0.1, 0.1, -0.1, -0.1]), 6),
    ],
)
def test_other_walks_are_possible(ground, steps):
    motion = WalkPlan.over(ground, steps=steps).motion(HUME, rate=50.0)
    assert np.isfinite(motion.q).all()


def test_what_cannot_be_walked_is_named():
    with pytest.raises(InputError, match="do not meet"):
        WalkPlan.over(GroundProfile.flat(), steps=1, apex_speed=[0.2, 2.0], step_length=0.2)
    with pytest.raises(InputError, match="at least one step"):
        WalkPlan.over(GroundProfile.flat(), steps=0)
    with pytest.raises(InputError, match="increase"):
        GroundProfile(x=np.array([0.0, 0.0]), z=np.zeros(2))
    with pytest.raises(RobotError, match="stance"):
        WalkPlan.over(GroundProfile.flat(), steps=1, com_height=1.1).motion(HUME, rate=50.0)
