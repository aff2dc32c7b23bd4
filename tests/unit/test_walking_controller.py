"""Walking under the paper's delays: the start, the placement, and that it walks."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.kernels import from_python
from humanoids2016 import NoisySensors, SensorNoise, WalkCase, simulate_walk, wrong_robot
from sealag.design import load
from sealag.errors import InputError
from sealag.kernels import walking as kernel
from sealag.simulation import Outcome
from sealag.walking import GroundProfile, WalkingGait, WalkingOptions
from sealag.whole_body import Measurement

PENDULUM = from_python(kernel.pendulum)


@pytest.fixture(scope="module")
def hume():
    """The bundled project."""
    return load("bundled:hume")


@pytest.mark.parametrize("change", [{}, {"step_time": 0.5, "transfer_time": 0.12}])
def test_periodic_gait_is_periodic(change):
    """From the apex to the apex over the next foot: same speed, mirrored place."""
    gait = WalkingGait(**change)
    plan = gait.periodic()
    height = np.array([gait.com_height, 0, 0, 0, 0, 0.0])
    old, new = np.array([-1.0, 0.0, 0.0]), np.zeros(3)
    x, v = np.array([0.0, plan.apex_outward]), np.array([gait.apex_speed, 0.0])
    middle = 0.5 * (gait.step_time + gait.transfer_time)
    T, d = gait.step_time, gait.transfer_time
    PENDULUM(x, v, middle, T, d, old, new, height, 0.0, 4000)
    foot = np.array([plan.step_length, gait.step_width, 0.0])
    PENDULUM(x, v, 0.0, middle, d, new, foot, height, 0.0, 4000)
    np.testing.assert_allclose(x, [foot[0], foot[1] - plan.apex_outward], atol=1e-5)
    np.testing.assert_allclose(v, [gait.apex_speed, 0.0], atol=1e-5)


def test_start_is_the_apex(hume):
    """Feet, CoM, speed and vertical angular momentum of the first state."""
    walking, robot = replace(hume.walking, ground=GroundProfile.flat(0.1)), hume.robot
    gait, start = walking.gait, walking.begin(robot, hume.actuators)
    q, v = start.q, start.v
    np.testing.assert_allclose(start.theta_dot, v[-robot.n :])
    at = robot.workspace()
    at.update(q, v)
    np.testing.assert_allclose(at.com, [0.0, 0.0, 0.1 + gait.com_height], atol=1e-9)
    np.testing.assert_allclose(at.com_velocity, [gait.apex_speed, 0.0, 0.0], atol=1e-9)
    assert at.frame_placement("right_foot")[1][2] == pytest.approx(0.1 + gait.foot_radius)
    np.testing.assert_allclose(at.frame_velocity("right_foot")[:3], 0.0, atol=1e-9)
    assert (at.centroidal_map() @ v)[5] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(InputError, match="com_height"):
        replace(walking, gait=replace(gait, com_height=1.2)).begin(robot, hume.actuators)


def test_refusals(hume):
    """Gaits, options and starts that cannot be."""
    with pytest.raises(InputError, match="step_time"):
        WalkingGait(step_time=-1.0)
    with pytest.raises(InputError, match="60 %"):
        WalkingGait(transfer_time=0.3)
    with pytest.raises(InputError, match="swing_stiffness"):
        WalkingOptions(swing_stiffness=float("nan"))
    with pytest.raises(InputError, match=r"lead_time is 0\.0; it must lie in 1e-06"):
        WalkingOptions(lead_time=0.0)
    with pytest.raises(InputError, match=r"walking\.options\.feedback is 'static_joint_tank'; it"):
        WalkingOptions(feedback="static_joint_tank")
    with pytest.raises(
        InputError, match=r"walking\.options\.preview is 1; it must be true or false"
    ):
        WalkingOptions(preview=1)
    controller = hume.walking.begin(hume.robot, hume.actuators).controller
    robot = hume.robot
    both = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=2)
    both.contact[:] = 1.0
    with pytest.raises(InputError, match="one of two feet"):
        controller.reset(0.0, both)


def test_walks_rough_ground_under_delay(hume):
    """Seven steps over ±5 cm with the paper's delays, noise and 5 % errors: a gait."""
    rough = replace(hume.walking, ground=GroundProfile.rough(0), steps=7)
    walk = simulate_walk(hume, WalkCase(walking=rough, noise=SensorNoise(), model_error=0.05))
    gait = walk.gait
    assert gait.is_gait, (gait.cause, gait.speed_deviation, gait.width_deviation)
    assert walk.run.measurement_age.max() > 9e-3
    assert (walk.run.contact_force[:, :, 2] >= -1e-6).all()


@pytest.mark.parametrize(
    ("options", "falls"),
    [
        (WalkingOptions().published(), True),
        (WalkingOptions(prediction="none"), True),
        (WalkingOptions(lead=False), False),
    ],
)
def test_no_gait_without_the_means(hume, options, falls):
    """Negative control: the published law, and ours without prediction, fall; without lead there is
    no gait, and whether it falls within eight steps hangs on the last digits."""
    rough = replace(hume.walking, ground=GroundProfile.rough(0), options=options, steps=8)
    walk = simulate_walk(hume, WalkCase(walking=rough))
    assert walk.run.outcome is Outcome.FELL or not falls
    assert not walk.gait.is_gait


def test_too_short_a_walk_is_no_gait(hume):
    """Two steps say nothing about a gait; three do."""
    three = replace(hume.walking, ground=GroundProfile.flat(), steps=3)
    gait = simulate_walk(hume, WalkCase(walking=three)).gait
    assert gait.is_gait
    early = gait.apex_step < 2
    cut = replace(
        gait,
        walking=replace(three, steps=2),
        step_width=gait.step_width[:2],
        apex_speed=gait.apex_speed[early],
        apex_step=gait.apex_step[early],
    )
    assert cut.walked
    assert np.isnan([cut.speed_deviation, cut.width_deviation]).all()
    assert not cut.is_gait


def test_gait_needs_the_angular_momentum(hume):
    """Negative control of the gait's measures: footsteps by the CoM's velocity are too narrow."""
    case = WalkCase(walking=replace(hume.walking, ground=GroundProfile.flat(), steps=6))
    options = WalkingOptions(momentum_placement=False, bias_gain=0.0)
    good = simulate_walk(hume, case).gait
    poor = simulate_walk(hume, case.walks(options=options)).gait
    assert good.is_gait
    assert poor.width_deviation > 1.3 * good.width_deviation


def test_noise_withholds_the_base(hume):
    """What the noisy controller sees has no base position, and is not the measurement."""

    class Spy:
        def reset(self, t, measurement):
            """Nothing to forget."""

        def tick(self, t, measurement, out):
            """Keep what was seen."""
            self.row = measurement.data.copy()

    robot, spy = hume.robot, Spy()
    true = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=2)
    true.q[:] = robot.neutral()
    true.q[:3] = 1.0, 2.0, 3.0
    before = true.data.copy()
    NoisySensors(spy, robot, noise=SensorNoise(), seed=1).tick(0.0, true, np.zeros(robot.n))
    assert (spy.row[1:4] == 0.0).all()
    assert np.abs(spy.row[8:14]).max() < 2e-3
    assert (spy.row[8:14] != 0.0).all()
    np.testing.assert_array_equal(true.data, before)


def test_wrong_robot_is_wrong_by_as_much(hume):
    """Masses differ, by no more than asked for; the feet are where they were."""
    wrong = wrong_robot(hume.robot, error=0.05, seed=3)
    ratio = wrong.mass / hume.robot.mass
    assert 0.95 < ratio < 1.05
    assert ratio != pytest.approx(1.0, abs=1e-4)
    q = hume.robot.neutral()
    for foot in hume.walking.feet:
        np.testing.assert_allclose(
            wrong.frame_placement(foot, q)[1], hume.robot.frame_placement(foot, q)[1]
        )
