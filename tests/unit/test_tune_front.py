"""The front of delay, stiffness, damping and transparency: nothing beats it, and it holds."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.small_systems import arm, arm_system, joint_task
from sealag.errors import InputError
from sealag.passivity import Status
from sealag.robot import Motion
from sealag.tune import tune
from sealag.whole_body import Law, StaticJoint


@pytest.fixture(scope="module")
def system(tmp_path_factory):
    """An arm whose signal knows its springs."""
    folder = tmp_path_factory.mktemp("arm")
    robot = arm(folder)
    law = Law(
        tasks=(joint_task(robot, 40.0),), stiffness_form="force", signal=StaticJoint(),
        gravity="planned",
    )  # fmt: skip
    return arm_system(folder, robot=robot, law=law, posture=np.array([np.pi / 2, 0.0]))


@pytest.fixture(scope="module")
def front(system):
    """Its front in the posture."""
    return tune(system, aim="front")


def goods(point):
    """What is the better the larger it is."""
    return np.array([point.delay_s, point.scale, -point.cost, point.bandwidth_hz])


def test_no_point_beats_another(front):
    assert len(front.front) > 10
    assert [point.number for point in front.front] == list(range(1, len(front.front) + 1))
    for one in front.front:
        for other in front.front:
            if one is not other:
                assert (goods(one) < goods(other)).any()


def test_points_trade_all_four_quantities(front):
    for quantity in np.array([goods(point) for point in front.front]).T:
        assert quantity.max() != quantity.min()


@pytest.mark.parametrize("place", [0, 5, -1])
def test_a_picked_point_is_certified_and_sits_on_its_boundary(front, place):
    point = front.front[place]
    tuned = front.pick(point.number)
    assert tuned.found
    assert tuned.certificate.answer.status is Status.CERTIFIED
    assert tuned.reached_s == pytest.approx(point.delay_s, rel=1e-4)
    assert tuned.reached_s >= point.delay_s
    drives = tuned.system.actuators
    assert drives.transparency().bandwidth.min() == pytest.approx(point.bandwidth_hz)
    assert drives.motor_damping.sum() == pytest.approx(point.cost, rel=1e-5)
    less = replace(
        tuned.system, actuators=replace(drives, motor_damping=0.999 * drives.motor_damping)
    )
    assert sealag.certify(less).answer.max_delay_s < point.delay_s


def test_the_front_is_no_worse_than_the_two_steps_that_were_there(system, front):
    """Largest stiffness at a bandwidth, then the least damping for it."""
    some = front.front[-1]
    stiff = tune(system, limits={"bandwidth": some.bandwidth_hz})
    least = tune(stiff.system, aim="damping")
    two = np.array([
        system.delays.d_1, stiff.scale, -least.system.actuators.motor_damping.sum(),
        least.system.actuators.transparency().bandwidth.min(),
    ])  # fmt: skip
    assert not any((two > goods(point) * (1 + 1e-4 * np.sign(goods(point)))).all()
                   for point in front.front)  # fmt: skip


def test_along_a_motion_the_cost_is_drag(system):
    time = np.linspace(0.0, 1.0, 12)
    q = np.stack([np.pi / 2 + 0.2 * np.sin(6 * time), 0.3 * np.cos(6 * time)], axis=1)
    v = np.stack([1.2 * np.cos(6 * time), -1.8 * np.sin(6 * time)], axis=1)
    motion = Motion(
        time=time, q=q, v=v, contact_sets=((),), contact_index=np.zeros(12, dtype=np.int64)
    )
    front = tune(system, motion, aim="front")
    point = front.front[0]
    drag = np.trapezoid(v**2, time, axis=0) @ point.system.actuators.motor_damping
    assert point.cost == pytest.approx(drag, rel=1e-5)
    assert front.pick(1).found


def test_a_limit_of_the_bandwidth_is_the_least_of_the_points(system, front):
    least = 1.3 * min(point.bandwidth_hz for point in front.front)
    kept = tune(system, aim="front", limits={"bandwidth": least}).front
    assert min(point.bandwidth_hz for point in kept) >= least * (1.0 - 1e-6)


def test_a_point_that_is_none(front):
    with pytest.raises(InputError, match="The front has no point 0; it has 1"):
        front.pick(0)
