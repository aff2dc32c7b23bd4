"""Stability over all instants: a second instant decides, and what bounds decide agrees with all."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm, arm_system, joint_task
from sealag.design import load
from sealag.passivity import Basis
from sealag.robot import Motion
from sealag.whole_body import Law, MotorAngles, StaticJoint, Task

CASES = Path(__file__).resolve().parents[1] / "data" / "cases"


def second_instant():
    system = load(CASES / "s3_second_instant.toml")
    motion = system.load_motion(CASES / "s3_second_instant.csv")
    return system, motion


def one_instant(motion, k):
    """An instant of a motion as a motion."""
    return replace(motion.at([k]), time=motion.time[:1])


def test_the_second_instant_decides_although_its_bound_is_the_longer():
    system, motion = second_instant()
    first, second = (system.local_margins(one_instant(motion, k)) for k in (0, 1))
    assert second.delay_s == pytest.approx(0.597454, abs=1e-6)
    assert first.delay_s > 1.2 * second.delay_s
    both = system.local_margins(motion)
    assert both.instant == 1
    assert both.time_s == 1.0
    assert both.delay_s == pytest.approx(second.delay_s, rel=1e-9)
    certificate = sealag.certify(system, motion)
    assert certificate.answer.status == "not_certified"
    assert certificate.answer.critical.instant == 1
    assert certificate.answer.local_margin_s == pytest.approx(second.delay_s, rel=1e-9)
    assert certificate.answer.worst.instant == 0
    turned = replace(motion, contact_index=motion.contact_index[::-1].copy())
    assert system.local_margins(turned).instant == 0


def test_at_that_instant_alone_the_loop_in_the_posture_is_what_is_597_ms():
    """The tasks there have no error; what supports it does."""
    system, motion = second_instant()
    loop = system.frozen(motion, 1, rest=system.in_posture(motion, 1))
    assert loop.margin().delay == pytest.approx(0.597454, abs=1e-6)


def swinging(folder, *, count=40, signal=None, gravity="planned", tasks=None):
    """The arm, hanging, over a motion that folds it: its stiffness, and so its margins, spread."""
    robot = arm(folder)
    com = Task(name="com", kind="com", axes=(0, 2), stiffness=150.0)
    law = Law(
        tasks=(com,) if tasks is None else tasks(robot),
        signal=signal or StaticJoint(),
        gravity=gravity,
        stiffness_form="force",
    )
    system = arm_system(folder, robot=robot, law=law)
    t = np.linspace(0.0, 2.0, count)
    motion = Motion(
        time=t, q=np.column_stack([1.5 + 0.3 * np.sin(2 * t), 0.9 - 0.7 * np.cos(3 * t)]),
        v=np.zeros((count, 2)), contact_sets=((),), contact_index=np.zeros(count, dtype=np.int64),
    )  # fmt: skip
    return system, motion


def decided(system, motion, *, share=1.0, refuse=False):
    """What is known, with bounds that are scaled, or taken away."""
    bounds = system.certified_bounds(system.spaces(motion))
    delay = 0.0 * bounds.delay if refuse else share * bounds.delay
    return system.local(delay, motion), bounds


@pytest.mark.parametrize("gravity", ["feedback", "planned"])
def test_what_bounds_decide_agrees_with_deciding_all(tmp_path, gravity):
    system, motion = swinging(tmp_path, gravity=gravity)
    pruned, bounds = decided(system, motion)
    whole, _ = decided(system, motion, refuse=True)
    assert whole.count(Basis.EXACT) == len(motion)
    each = [system.frozen(motion, k).margin().delay for k in range(len(motion))]
    np.testing.assert_allclose(whole.delay, each, rtol=1e-9)
    assert 0 < pruned.count(Basis.EXACT) < len(motion) / 4
    assert pruned.count(Basis.SEARCHED) > 0
    assert (pruned.count(Basis.BOUND) > 0) == (gravity == "planned")
    assert pruned.count(Basis.OPEN) == 0
    assert pruned.margin_s == pytest.approx(whole.margin_s, rel=1e-6)
    assert pruned.critical == whole.critical == int(np.argmin(each))
    assert pruned.stable is whole.stable is True
    for basis, delay, bound, margin in zip(pruned.basis, pruned.delay, bounds.delay, each):
        if basis is Basis.BOUND:
            assert delay == bound <= margin
            assert bound >= pruned.margin_s, "else it had to be looked at"
        elif basis is Basis.SEARCHED:
            assert pruned.margin_s <= delay <= margin
        else:
            assert delay == pytest.approx(margin, rel=1e-6)


def test_bounds_that_are_too_long_hide_the_critical_instant(tmp_path):
    """Negative control: the comparison above sees a wrong bound."""
    system, motion = swinging(tmp_path)
    whole, bounds = decided(system, motion, refuse=True)
    wrong = bounds.delay.copy()
    wrong[whole.critical] *= 100.0
    hidden = system.local(wrong, motion)
    assert hidden.critical != whole.critical
    assert hidden.margin_s > whole.margin_s


def test_bounds_decide_nothing_where_the_law_sags_or_drives_are_slow(tmp_path):
    """Off the posture the potential is another one."""
    system, motion = swinging(tmp_path, count=8, signal=MotorAngles(), gravity="planned")
    local, _ = decided(system, motion)
    assert local.count(Basis.EXACT) == len(motion)
    system, motion = swinging(tmp_path, count=8)
    assert decided(system, motion)[0].count(Basis.BOUND) > 0
    slow = replace(system, actuators=replace(system.actuators, torque_bandwidth=np.full(2, 500.0)))
    assert decided(slow, motion)[0].count(Basis.EXACT) == len(motion)


@pytest.mark.parametrize("gain", [0.0, 1e-9])
def test_a_motion_whose_law_hardly_acts_is_decided(tmp_path, gain):
    """F = 0: no delay destabilises, at no instant."""

    def none(robot):
        return (joint_task(robot, gain),)

    system, motion = swinging(tmp_path, count=4, tasks=none)
    local, bounds = decided(system, motion)
    assert (bounds.delay > 1e6).all()
    assert np.isinf(bounds.delay).all() == (gain == 0.0)
    assert local.stable is True
    assert local.margin_s == np.inf


@pytest.mark.parametrize("share", [1.0, 1e-3])
def test_the_margin_of_a_posture_is_that_of_a_search_for_all_crossings(share):
    """It is searched up to some bounds first, also where it lies hundreds of bounds beyond: no
    bound relies on the motors' friction."""
    system = load(EXAMPLES / "hume_held.toml")
    D = system.actuators.motor_damping
    drives = replace(system.actuators, motor_damping=share * D, viscous_friction=(1.0 - share) * D)
    system = replace(system, actuators=drives)
    answer = sealag.certify(system).answer
    whole = system.frozen(rest=system.rest(system.still())).margin()
    still = system.frozen().margin()
    assert answer.local_margin_s == pytest.approx(min(whole.delay, still.delay), rel=1e-12)
    assert (answer.local_margin_s > 32.0 * answer.max_delay_s) == (share < 1.0)


def test_one_unstable_instant_makes_the_motion_unstable(tmp_path):
    """Upright, gravity turns a soft arm over; hanging it does not."""

    def soft(robot):
        return (joint_task(robot, 4.0),)

    system, motion = swinging(tmp_path, count=12, tasks=soft)
    hanging, _ = decided(system, motion)
    assert hanging.stable is True
    turning = motion.q.copy()
    turning[:, 0] = np.linspace(1.5, -1.5, 12)
    motion = replace(motion, q=turning)
    local, _ = decided(system, motion)
    each = [system.frozen(motion, k).margin().unstable_roots for k in range(len(motion))]
    assert 0 in each
    assert max(each) > 0
    assert local.unstable_roots.tolist() == each
    assert local.stable is False
    assert local.margin_s == 0.0
    assert local.unstable_modes == max(each)
    assert each[local.critical] == max(each)


def test_a_search_that_begins_at_the_last_instant_finds_the_same():
    """A motion whose margin moves by more than the search begins with, up and down."""
    system = sealag.load(EXAMPLES / "panda.toml")
    turn = np.zeros(system.robot.nv)
    turn[3] = 1.0
    places = [system.robot.integrate(system.posture, a * turn) for a in (0.5, -0.3, 0.0)]
    motion = Motion(
        time=0.1 * np.arange(3), q=np.array(places), v=np.zeros((3, system.robot.nv)),
        contact_sets=((),), contact_index=np.zeros(3, dtype=int),
    )  # fmt: skip
    alone = [
        min(
            system.frozen(motion, k, rest=rest).margin().delay
            for rest in (system.in_posture(motion, k), system.rest(motion, k))
        )
        for k in range(3)
    ]
    assert alone[1] > 1.06 * alone[0]
    found = sealag.certify(system, motion).evidence.instant_margins_s
    np.testing.assert_allclose(np.array(found, dtype=float), alone, rtol=1e-9)
