"""Where the loop rests: equilibria solved by hand, balance, and what the simulator keeps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

import sealag
from helpers.small_systems import arm, arm_system, joint_task
from sealag.design import load
from sealag.robot import Contact
from sealag.simulation import Outcome
from sealag.whole_body import GravityCompensation, Law, MotorAngles, Signal

HUME = load("bundled:hume")
GAIN = 30.0


def system_of(folder, signal, gravity, **changes):
    robot = arm(folder)
    law = Law(
        tasks=(joint_task(robot, GAIN),),
        signal=Signal.named(signal),
        gravity=gravity,
        stiffness_form="force",
    )
    return arm_system(folder, robot=robot, law=law, **changes)


def by_hand(system, signal, gravity):
    """Solve g(q) = K (θ − q) = F (q_d − x) + ḡ(x) with x the fed-back angles; the tank's is q̄."""
    robot, K, q_d = system.robot, system.actuators.spring_stiffness, system.posture

    def compensation(x):
        if gravity is GravityCompensation.NONE:
            return np.zeros(2)
        return robot.gravity(q_d if gravity is GravityCompensation.PLANNED else x)

    def residual(state):
        q, theta, q_bar = np.split(state, 3)
        springs = K * (theta - q)
        static = GAIN * (q_d - q_bar) + compensation(q_bar)
        match signal:
            case "motor":
                law = GAIN * (q_d - theta) + compensation(theta)
            case "joint":
                law = GAIN * (q_d - q) + compensation(q)
            case "static_joint":
                law = static
            case _:  # x̂ has come to q̄; compensation that is fed back is taken at θ
                law = static - compensation(q_bar) + compensation(theta)
        return np.concatenate(
            [robot.gravity(q) - springs, springs - law, K * (theta - q_bar) - static]
        )

    found = root(residual, np.tile(q_d, 3), tol=1e-13).x
    assert np.abs(residual(found)).max() < 1e-10
    return np.split(found, 3)[:2]


@pytest.mark.parametrize("gravity", list(GravityCompensation))
@pytest.mark.parametrize("signal", Signal.names())
def test_rest_is_the_equilibrium_written_out(tmp_path, signal, gravity):
    system = system_of(tmp_path, signal, gravity)
    rest = system.rest()
    q, theta = by_hand(system, signal, gravity)
    assert rest.found, rest.reason
    np.testing.assert_allclose(rest.q, q, atol=1e-9)
    np.testing.assert_allclose(rest.theta, theta, atol=1e-9)
    np.testing.assert_allclose(rest.tau_sea, system.robot.gravity(q), atol=1e-7)
    assert rest.moved == pytest.approx(np.abs(q - system.posture).max(), abs=1e-9)
    sags = signal == "motor" or gravity is GravityCompensation.NONE
    sags = sags or (signal, gravity) == ("static_joint_tank", GravityCompensation.FEEDBACK)
    assert (rest.moved > 1e-3) == sags
    assert not (sags and system.law.rests_at_posture)
    stiffer = replace(
        system,
        actuators=replace(
            system.actuators, spring_stiffness=1.2 * system.actuators.spring_stiffness
        ),
    )
    assert np.abs(stiffer.rest().theta - theta).max() > 1e-4


@pytest.mark.parametrize("gravity", list(GravityCompensation))
@pytest.mark.parametrize("signal", Signal.names())
def test_in_the_posture_the_tasks_have_no_error_and_springs_carry_gravity(
    tmp_path, signal, gravity
):
    """What a controller commands there is its compensation alone."""
    system = system_of(tmp_path, signal, gravity)
    there = system.in_posture()
    assert there.found
    assert there.moved == 0.0
    np.testing.assert_array_equal(there.q, system.posture)
    carried = system.robot.gravity(system.posture)
    np.testing.assert_allclose(there.tau_sea, carried, atol=1e-12)
    K = system.actuators.spring_stiffness
    at_links = signal == "joint" or (
        signal.startswith("static") and gravity is not GravityCompensation.NONE
    )
    expected = system.posture + (carried / K if at_links else 0.0)
    np.testing.assert_allclose(there.theta, expected, atol=1e-12)


@pytest.mark.parametrize("signal", ["motor", "static_joint"])
def test_a_run_that_begins_where_the_loop_rests_stays_there(tmp_path, signal):
    system = system_of(tmp_path, signal, GravityCompensation.FEEDBACK)
    rest = system.rest()
    run = sealag.simulate(system, scenario="regulate", duration=0.5)
    assert run.outcome is Outcome.COMPLETED
    np.testing.assert_allclose(run.q, np.tile(rest.q, (len(run.q), 1)), atol=1e-7)
    if signal == "motor":
        assert np.abs(run.q[-1] - system.posture).max() > 1e-2, "it sags"


def test_a_biped_rests_only_where_its_feet_carry_it():
    """On both feet; on none it falls, and is told to give contacts."""
    assert HUME.rest().found
    flying = replace(HUME, contacts=())
    assert not flying.rest().found
    assert not flying.in_posture().found
    assert "give contacts" in flying.rest().reason
    np.testing.assert_array_equal(flying.rest().q, HUME.posture)


def test_on_one_foot_the_centre_of_mass_comes_above_it():
    one = replace(HUME, contacts=(Contact(frame="right_foot"),))
    rest, robot = one.rest(), HUME.robot
    foot = robot.frame_placement("right_foot", rest.q)[1]
    away = robot.center_of_mass(rest.q)[:2] - foot[:2]
    if rest.found:
        np.testing.assert_allclose(away, 0.0, atol=1e-8)
        assert rest.moved > 1e-3
    else:
        assert rest.reason
    before = robot.center_of_mass(HUME.posture)[:2]
    assert np.abs(before - robot.frame_placement("right_foot", HUME.posture)[1][:2]).max() > 1e-2


def test_a_softer_law_sags_more(tmp_path):
    system = system_of(tmp_path, "motor", GravityCompensation.NONE)
    soft = replace(system, law=replace(system.law, tasks=(joint_task(system.robot, 0.5 * GAIN),)))
    assert soft.rest().moved > 1.2 * system.rest().moved


def test_a_task_far_stiffer_than_the_springs_is_an_answer_and_no_failure(tmp_path):
    """Motor angles that hold the links are searched in steps that grow without bound there."""
    robot = arm_system(tmp_path, count=2).robot
    law = Law(
        tasks=(joint_task(robot, 1e9 * np.eye(2)),),
        stiffness_form="force",
        signal=MotorAngles(),
        gravity="none",
    )
    system = arm_system(
        tmp_path, robot=robot, law=law, count=2, springs={"spring_stiffness": 50.0},
        posture=np.array([0.3, 0.4]),
    )  # fmt: skip
    rest = system.rest(system.still())
    assert np.isfinite(rest.theta).all()
    assert rest.found or rest.reason
