"""Motors that are too weak for the load or too slow for the motion are not certified, just so."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.small_systems import arm_system, joint_task
from sealag.whole_body import GravityCompensation, Law, MotorAngles

PLANNED, NONE = GravityCompensation.PLANNED, GravityCompensation.NONE


def held(folder, gravity):
    arm = arm_system(folder)
    task = joint_task(arm.robot, 80.0)
    law = Law(tasks=(task,), stiffness_form="force", gravity=gravity, signal=MotorAngles())
    return replace(arm, law=law)


def refusals(system, motion=None, **limits):
    limited = replace(system, actuators=replace(system.actuators, **limits))
    rest = limited.rest() if motion is None else None
    return limited.certified_bounds(limited.spaces(motion), rest, motion).refusals


@pytest.mark.parametrize("gravity", [PLANNED, NONE])
def test_a_motor_must_carry_what_gravity_puts_on_it(gravity, tmp_path):
    """In the posture and where the loop sags to: the larger load counts."""
    system = held(tmp_path, gravity)
    rest = system.rest()
    assert rest.found
    loads = np.abs([system.spaces().gravity[0], rest.tau_sea])
    assert (loads[1] > 1.012 * loads[0]).any(), "where it rests a joint carries more"
    load = loads.max(axis=0)
    for weak, joint in enumerate(system.robot.joints):
        limit = np.full(2, 1e3)
        limit[weak] = 1.01 * load[weak]
        assert refusals(system, torque_limit=limit) == ()
        limit[weak] = 0.99 * load[weak]
        (words,) = refusals(system, torque_limit=limit)
        assert f"the motor of {joint} gives at most" in words


def test_a_motor_must_reach_the_speed_of_the_motion(tmp_path):
    system = held(tmp_path, PLANNED)
    still = system.still()
    motion = replace(
        still,
        time=np.array([0.0, 0.1]),
        q=np.vstack([still.q, still.q]),
        v=np.array([[0.1, -0.2], [-0.5, 0.3]]),
        contact_index=np.zeros(2, dtype=np.int64),
    )
    for slow, speed in enumerate((0.5, 0.3)):
        limit = np.full(2, 1e3)
        limit[slow] = 1.01 * speed
        assert refusals(system, motion, velocity_limit=limit) == ()
        limit[slow] = 0.99 * speed
        (words,) = refusals(system, motion, velocity_limit=limit)
        assert f"the motor of {system.robot.joints[slow]} reaches at most" in words
        assert "at 1 of 2 instants" in words
