"""Gains that follow a motion: the largest at a bounded rate, certified while matrices move."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

import sealag
from helpers.small_systems import arm, arm_system, joint_task
from sealag.errors import InputError, MotionError
from sealag.passivity import Certificate, Status
from sealag.robot import Motion
from sealag.tune import tune
from sealag.whole_body import Law, StaticJoint, Task

INSTANTS = 60
RATE = 1.5


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    """An arm whose hand task is soft or stiff for its joints as it folds, and its motion."""
    folder = tmp_path_factory.mktemp("arm")
    robot = arm(folder)
    hand = Task(
        name="hand", kind="pose", stiffness=(200.0, 200.0, 30.0), frame="link1", axes=(0, 2, 4)
    )
    law = Law(tasks=(hand, joint_task(robot, 5.0)), stiffness_form="symmetric", gravity="planned")
    system = arm_system(folder, robot=robot, law=law, posture=np.array([np.pi / 2, 0.3]))
    time = np.linspace(0.0, 1.0, INSTANTS)
    q = np.stack([np.pi / 2 + 0.3 * np.sin(6 * time), 0.2 + 1.2 * np.sin(3 * time) ** 2], axis=1)
    motion = Motion(
        time=time, q=q, v=np.gradient(q, time, axis=0), contact_sets=((),),
        contact_index=np.zeros(INSTANTS, dtype=np.int64),
    )  # fmt: skip
    return system, motion


@pytest.fixture(scope="module")
def tuned(swinging):
    """Its schedule."""
    return tune(*swinging, aim="schedule", limits={"rate": RATE})


def largest(system, motion):
    """The factor that each instant alone allows."""
    D, d = system.actuators.motor_damping, system.delays.d_1
    root = np.sqrt(d / D)
    return 1.0 / np.array(
        [np.linalg.eigvalsh(root[:, None] * F * root)[-1] for F in system.spaces(motion).F_task]
    )


def test_no_schedule_within_limit_and_rate_is_stiffer(swinging, tuned):
    """A linear program in log s knows nothing of passes; the schedule lies a share below it."""
    system, motion = swinging
    log = np.log(largest(system, motion))
    step = np.diff(motion.time)
    moves = np.eye(INSTANTS, k=1)[:-1] - np.eye(INSTANTS)[:-1]
    best = linprog(
        -np.ones(INSTANTS), A_ub=np.vstack([moves, -moves]), b_ub=RATE * np.tile(step, 2),
        bounds=list(zip(np.full(INSTANTS, -50.0), log)),
    ).x  # fmt: skip
    factors = tuned.schedule.stiffness
    share = factors / np.exp(best)
    assert np.ptp(share) < 1e-5
    assert 0.9 < share.mean() <= 1.0
    rate = np.diff(np.log(factors)) / step
    assert np.abs(rate).max() == pytest.approx(RATE, rel=1e-3)
    assert factors.max() > 1.1 * factors.min()


def test_a_schedule_is_certified_while_its_matrices_move(swinging, tuned, tmp_path):
    system, motion = swinging
    assert tuned.found
    answer = tuned.certificate.answer
    assert answer.status is Status.CERTIFIED
    assert answer.time_varying_delay_s >= system.delays.d_1
    certificate = tuned.certificate
    path = tmp_path / "c.json"
    certificate.write(path)
    assert Certificate.verify(path, exact=True).valid
    assert "stiffness_factor" in next(
        one.text for one in answer.assumptions if one.key == "schedule"
    )
    for constant in (tuned.schedule.stiffness.max(), tuned.schedule.stiffness.mean()):
        held = replace(motion, stiffness=np.full(INSTANTS, constant))
        assert system.certified_bounds(system.spaces(held)).delay.min() < system.delays.d_1


@pytest.mark.parametrize("softness", [1.0, 20.0])
def test_a_schedule_sits_on_its_boundary(swinging, softness):
    """Also where springs have most of the compliance, so that a little gain is much delay."""
    system, motion = swinging
    drives = system.actuators
    soft = replace(
        system, actuators=replace(drives, spring_stiffness=drives.spring_stiffness / softness)
    )
    soft = replace(soft, law=replace(soft.law, signal=StaticJoint()))
    found = tune(soft, motion, aim="schedule", limits={"rate": RATE})
    assert found.found
    more = replace(found.schedule, stiffness=1.001 * found.schedule.stiffness)
    answer = sealag.certify(soft, more, time_varying=True).answer
    assert min(answer.max_delay_s, answer.time_varying_delay_s) < soft.delays.d_1


def test_one_instant_of_a_schedule_is_the_design_with_its_gains(swinging, tuned):
    """Matrices, bounds and frozen loops of an instant are those of the law with that factor."""
    system = swinging[0]
    k = int(tuned.schedule.stiffness.argmax())
    factor = tuned.schedule.stiffness[k]
    tasks = tuple(
        replace(one, stiffness=factor * np.asarray(one.stiffness)) for one in system.law.tasks
    )
    still = replace(system, posture=tuned.schedule.q[k], law=replace(system.law, tasks=tasks))
    there, here = system.spaces(tuned.schedule), still.spaces()
    assert there.F_theta[k] == pytest.approx(here.F_theta[0], rel=1e-12)
    loops = (
        system.frozen(tuned.schedule, k, rest=system.in_posture(tuned.schedule, k)),
        still.frozen(rest=still.in_posture()),
    )
    assert pytest.approx(loops[1].A_1, rel=1e-9, abs=1e-9) == loops[0].A_1
    assert pytest.approx(loops[1].A_0, rel=1e-9, abs=1e-9) == loops[0].A_0
    assert system.rest(tuned.schedule, k).q == pytest.approx(still.rest().q, abs=1e-9)


@pytest.mark.parametrize("ending", ["csv", "npz", "parquet"])
def test_a_schedule_is_a_column_of_its_motion(swinging, tuned, tmp_path, ending):
    path = tmp_path / f"s.{ending}"
    system = swinging[0]
    system.save_motion(tuned.schedule, path)
    again = system.load_motion(path)
    assert again.stiffness.tolist() == tuned.schedule.stiffness.tolist()
    assert again.at([3, 5]).stiffness.tolist() == tuned.schedule.stiffness[[3, 5]].tolist()


def test_factors_that_are_none_are_refused(swinging, tmp_path):
    system, motion = swinging
    with pytest.raises(MotionError, match="60 positive factors"):
        replace(motion, stiffness=np.zeros(INSTANTS))
    path = tmp_path / "s.csv"
    system.save_motion(replace(motion, stiffness=np.ones(INSTANTS)), path)
    path.write_text(path.read_text().replace(",1\n", ",-1\n"))
    with pytest.raises(MotionError, match=r"stiffness_factor is -1 in row 1; it must be a factor"):
        system.load_motion(path)
    scheduled = replace(motion, stiffness=np.ones(INSTANTS))
    with pytest.raises(InputError, match="gains that stay"):
        sealag.certify(system, scheduled, criterion="published")
    with pytest.raises(InputError, match="give both"):
        tune(system, motion, aim="schedule")
    with pytest.raises(InputError, match="give both"):
        tune(system, aim="schedule", limits={"rate": 1.0})


def test_a_motion_that_is_too_coarse_for_polytopes_is_not_scheduled(swinging):
    system, motion = swinging
    coarse = tune(system, motion.at(list(range(0, INSTANTS, 29))), aim="schedule",
                  limits={"rate": 100.0})  # fmt: skip
    factors = coarse.schedule.stiffness
    if coarse.found:
        assert coarse.certificate.answer.time_varying_delay_s >= system.delays.d_1
    else:
        assert "more instants" in coarse.reasons[0]
    assert factors.max() < largest(system, motion).max()
