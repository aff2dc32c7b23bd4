"""Pushes act for exactly the declared interval, wherever the steps lie."""

import numpy as np
import pytest

from helpers.controllers import Constant as ConstantTorque
from helpers.designs import EXAMPLES
from sealag.actuation import Actuators
from sealag.design import load
from sealag.simulation import Clock, Push, Scene, closed_loop

END = 0.2
PUSHES = (
    Push(frame="base", force=(100.0, 0.0, 0.0), start=0.0, duration=0.1),
    Push(frame="base", force=(0.0, -70.0, 0.0), start=0.01234567, duration=0.0345678),
    Push(frame="LF_FOOT", force=(0.0, 0.0, 50.0), start=0.02, duration=0.00029),  # inside a step
    Push(frame="base", force=(20.0, 10.0, 0.0), start=0.15, duration=1.0),  # to the end
)


@pytest.fixture(scope="module")
def anymal():
    system = load(EXAMPLES / "anymal.toml")
    rng, n = np.random.default_rng(0), system.robot.n
    springs = Actuators.of(
        system.robot.joints, spring_stiffness=rng.uniform(100, 300, n),
        rotor_inertia=rng.uniform(0.05, 0.1, n), inertia_shaping=0.5,
        motor_damping=rng.uniform(5, 20, n), spring_damping=0.1,
    )  # fmt: skip
    return system.robot, springs, system.posture


def _run(anymal, pushes, step=1e-3):
    robot, springs, q = anymal
    return closed_loop(
        robot, springs, ConstantTorque(np.zeros(robot.n)), q=q, theta=robot.joint_positions(q),
        duration=END, clock=Clock(physics=step, central=0.01),
        scene=Scene(pushes=pushes, fall=None),
    )  # fmt: skip


def _moved(anymal, run):
    robot, _, q = anymal
    weight = np.array([0.0, 0.0, -9.81]) * run.time[:, None] ** 2 / 2
    return np.array([robot.center_of_mass(row) - robot.center_of_mass(q) for row in run.q]) - weight


def _declared(robot, time, push):
    """∫∫ F / m of a push."""
    since = np.clip(time - push.start, 0.0, None)
    after = np.clip(time - push.start - push.duration, 0.0, None)
    return np.outer(since**2 - after**2, push.force) / (2 * robot.mass)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_free_flight(anymal, count):
    """The centre of mass moves as the declared forces say, of one push and of several at once."""
    pushes = PUSHES[count - 1 :] if count > 1 else PUSHES
    run = _run(anymal, pushes, step=5e-4)
    exact = sum(_declared(anymal[0], run.time, push) for push in pushes)
    wrong = np.abs(_moved(anymal, run) - exact).max()
    print(count, wrong, np.abs(exact).max())
    assert wrong < 1e-12
    # negative control: one step later
    late = [Push(frame=p.frame, force=p.force, start=p.start + 5e-4, duration=p.duration)
            for p in pushes]  # fmt: skip
    shifted = sum(_declared(anymal[0], run.time, push) for push in late)
    assert np.abs(_moved(anymal, run) - shifted).max() > 1000 * wrong


def test_fourth_order(anymal):
    """A push that no step divides leaves the order as it is."""
    fine = _run(anymal, PUSHES[1:2], 1.25e-4).q[-1]
    errors = np.array(
        [np.abs(_run(anymal, PUSHES[1:2], step).q[-1] - fine).max() for step in (2e-3, 1e-3, 5e-4)]
    )
    print(errors, errors[:-1] / errors[1:])
    assert (errors[:-1] / errors[1:] > 12).all()


def test_the_declared_force_does_the_booked_work(anymal):
    """∫F·v from a finely logged motion, and a first law that closes with it."""
    robot, *_ = anymal
    push = PUSHES[1]
    booked = _run(anymal, [push]).audit.scalar_flows["disturbance"]
    fine = closed_loop(
        robot, anymal[1], ConstantTorque(np.zeros(robot.n)), q=anymal[2],
        theta=robot.joint_positions(anymal[2]), duration=END,
        clock=Clock(physics=2.5e-5, central=0.01, log=2.5e-5),
        scene=Scene(pushes=[push], fall=None),
    )  # fmt: skip
    inside = (fine.time >= push.start) & (fine.time <= push.start + push.duration)
    place = np.array(
        [robot.frame_placement("base", q)[1] for q in fine.q[np.flatnonzero(inside)[[0, -1]]]]
    )
    # what the grid leaves out at both ends, at the speeds there
    speed = np.array(
        [robot.frame_jacobian("base", q)[:3] @ v
         for q, v in ((fine.q[k], fine.v[k]) for k in np.flatnonzero(inside)[[0, -1]])]
    )  # fmt: skip
    ends = fine.time[inside][[0, -1]]
    way = place[1] - place[0] + speed[0] * (ends[0] - push.start)
    way += speed[1] * (push.start + push.duration - ends[1])
    work = float(np.array(push.force) @ way)
    assert booked[-1] == pytest.approx(work, rel=1e-6)
    assert np.abs(fine.audit.residual).max() < 1e-8 * fine.audit.throughput[-1]
