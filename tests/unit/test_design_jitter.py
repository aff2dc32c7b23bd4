"""Delays that vary, over a design's motion: between the passive bound and the constant margin."""

from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.certificates import half_a_step
from helpers.designs import EXAMPLES
from sealag.actuation import Actuators
from sealag.robot import Motion
from sealag.whole_body import LinkAngles, MotorAngles


def passive(system, motion=None):
    return sealag.certify(system, motion).answer.max_delay_s


@pytest.mark.parametrize("name", ["anymal", "anymal_crawl", "baxter", "talos", "hume_held"])
def test_one_posture_lies_between_its_two_other_numbers(name):
    system = sealag.load(EXAMPLES / f"{name}.toml")
    found = system.local_margins()
    assert passive(system) <= found.jitter_s * (1.0 + 1e-8)
    assert found.jitter_s <= found.delay_s


def reaching(system, count):
    """Arms that move through a few postures."""
    rng = np.random.default_rng(7)
    turn = rng.normal(size=system.robot.nv)
    q = [
        system.robot.integrate(system.posture, 0.3 * np.sin(k) * turn / np.abs(turn).max())
        for k in range(count)
    ]
    return Motion(
        time=0.1 * np.arange(count), q=np.array(q), v=np.zeros((count, system.robot.nv)),
        contact_sets=((),), contact_index=np.zeros(count, dtype=int),
    )  # fmt: skip


def test_a_motion_has_the_smallest_of_its_instants():
    system = sealag.load(EXAMPLES / "baxter.toml")
    motion = reaching(system, 3)
    whole = system.local_margins(motion)
    alone = [system.local_margins(motion.at(slice(k, k + 1))).jitter_s for k in range(3)]
    assert whole.jitter_s == pytest.approx(min(alone), rel=1e-6)
    assert max(alone) > 1.01 * min(alone)


def test_a_long_motion_has_at_least_its_passive_bound():
    """Bounds that differ by little: a hundred instants are computed, and the next bound answers."""
    one = sealag.load(EXAMPLES.parent / "tests" / "data" / "cases" / "s7_static_joint_gravity.toml")
    count = 130
    motion = Motion(
        time=1e-3 * np.arange(count), q=1e-4 * np.arange(count)[:, None], v=np.zeros((count, 1)),
        contact_sets=((),), contact_index=np.zeros(count, dtype=int),
    )  # fmt: skip
    found = one.local_margins(motion)
    smallest = passive(one, motion)
    assert smallest <= found.jitter_s <= found.delay_s
    whole = jitter_margin_of(one, motion, range(0, count, 10))
    assert found.jitter_s <= whole * (1.0 + 1e-9)
    assert found.jitter_s == pytest.approx(whole, rel=0.05)


def jitter_margin_of(system, motion, instants):
    return min(system.local_margins(motion.at(slice(k, k + 1))).jitter_s for k in instants)


def test_what_falls_without_delay_has_none():
    system = sealag.load("bundled:hume")
    found = system.local_margins(half_a_step(system))
    assert found.unstable_modes > 0
    assert found.jitter_s == 0.0


def test_link_angles_have_no_passive_bound_and_a_jitter_margin():
    """Any law: what is computed is the loop that runs, not a stiffness."""
    system = sealag.load(EXAMPLES / "baxter.toml")
    system = replace(system, law=replace(system.law, signal=LinkAngles()))
    assert passive(system) == 0.0
    found = system.local_margins()
    if not found.unstable_modes:
        assert 0.0 < found.jitter_s < found.delay_s


def test_a_drive_with_a_bandwidth_has_one_too():
    system = sealag.load(EXAMPLES / "anymal.toml")
    ideal = system.local_margins().jitter_s
    drives: Actuators = replace(
        system.actuators, torque_bandwidth=np.full(system.robot.n, 2.0 * np.pi * 60.0)
    )
    slow = replace(system, actuators=drives)
    assert passive(slow) == 0.0
    found = slow.local_margins()
    assert 0.0 < found.jitter_s < ideal
    assert found.jitter_s < found.delay_s


def test_a_law_that_sags_has_the_smaller_of_posture_and_rest():
    system = sealag.load(EXAMPLES / "anymal.toml")
    system = replace(system, law=replace(system.law, signal=MotorAngles(), gravity="none"))
    motion = system.still()
    loops = [
        system.frozen(motion, 0, rest=rest)
        for rest in (system.in_posture(motion, 0), system.rest(motion, 0))
    ]
    alone = [loop.jitter_margin().delay for loop in loops]
    assert max(alone) > 1.0001 * min(alone)
    assert system.local_margins().jitter_s == pytest.approx(min(alone), rel=1e-7)


def test_late_torque_feedback_costs():
    system = sealag.load(EXAMPLES / "anymal.toml")
    late = replace(system, delays=replace(system.delays, delayed_torque_feedback=True))
    found, ideal = late.local_margins(), system.local_margins()
    assert 0.0 < found.jitter_s < 0.999 * ideal.jitter_s
    assert found.jitter_s < found.delay_s
