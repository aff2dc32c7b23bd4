"""`margin` refuses what `certify` refuses: a motor that gravity overloads where the loop rests."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.chains import chain


@pytest.fixture(scope="module")
def sagging(tmp_path_factory):
    """A link that nothing holds up but its task: it rests lower, where gravity has a longer arm."""
    robot = chain(tmp_path_factory.mktemp("chain"), axis="0 1 0", mass=1.0, inertia=0.02)
    drives = sealag.Actuators.of_robot(
        robot, spring_stiffness=300.0, rotor_inertia=0.1, inertia_shaping=0.5, motor_damping=20.0
    )
    task = sealag.Task(name="rest", kind="posture", stiffness=50.0)
    return sealag.System(
        robot=robot,
        actuators=drives,
        law=sealag.Law(tasks=(task,), signal=sealag.MotorAngles(), gravity="none"),
        posture=robot.configuration(np.array([2.2])),
        delays=sealag.Delays(central=sealag.Constant(0.002), embedded=sealag.Constant(0.001)),
    )


def test_an_overload_at_rest_is_refused_by_both(sagging):
    posture = abs(sagging.robot.gravity(sagging.posture)[0])
    resting = abs(sagging.rest().tau_sea[0])
    assert abs(resting - posture) > 0.05 * posture
    assert resting > posture
    for limit, refused in ((1.1 * resting, False), ((posture + resting) / 2.0, True)):
        system = replace(
            sagging, actuators=replace(sagging.actuators, torque_limit=np.array([limit]))
        )
        bound, margins = sealag.certify(system).answer.max_delay_s, system.local_margins()
        assert (bound == 0.0) is refused
        assert margins.passive_s == bound
        assert ("gives at most" in margins.not_passive) is refused
