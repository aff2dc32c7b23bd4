"""Scaled units, repeated eigenvalues, tasks without stiffness, straight legs: nothing false.

Each design goes through `certify` and `verify`, in doubles and rationals, and the same certificate
with a delay 1e-5 longer, multipliers scaled along, has to fail.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.certificates import failures, plain, resealed
from sealag.delay import Constant, Delays, Table
from sealag.passivity import Certificate, Criterion
from sealag.robot import Contact, ContactKind
from sealag.whole_body import MotorAngles, StiffnessForm, Task

K_REPEATED, D_REPEATED = 200.0, 25.0


def standing():
    """Hume screwed down by one foot, motor angles fed back: one short certificate an instant."""
    system = sealag.load("bundled:hume")
    return replace(
        system,
        law=replace(system.law, signal=MotorAngles()),
        contacts=(Contact(frame="right_foot", kind=ContactKind.SURFACE),),
        actuators=replace(system.actuators, spring_stiffness=np.full(6, 2e4)),
        delays=Delays(central=Constant(value=1e-3), embedded=Constant(value=0.0)),
    )


def gains(system, *factors):
    tasks = tuple(
        replace(task, stiffness=factor * task.stiffness)
        for task, factor in zip(system.law.tasks, factors, strict=True)
    )
    return replace(system, law=replace(system.law, tasks=tasks))


def torque_unit(factor):
    """Springs, damping and gains as if torques were counted in another unit: the same delay."""
    system = standing()
    springs = replace(
        system.actuators,
        spring_stiffness=factor * system.actuators.spring_stiffness,
        motor_damping=factor * system.actuators.motor_damping,
    )
    return gains(replace(system, actuators=springs), *[factor] * len(system.law.tasks))


def time_unit(factor):
    """Only the damping: the delay times the factor."""
    system = standing()
    damping = factor * system.actuators.motor_damping
    none = Constant(value=0.0)
    delay = Delays(central=none, embedded=none, sample_time=1e-9)
    springs = replace(system.actuators, motor_damping=damping)
    return replace(system, actuators=springs, delays=delay)


def repeated():
    """One stiffness and one damping for all joints: every eigenvalue is K/D."""
    system = standing()
    posture = Task(name="posture", kind="posture", stiffness=np.array(K_REPEATED))
    return replace(
        system,
        law=replace(system.law, tasks=(posture,), stiffness_form=StiffnessForm.FORCE),
        actuators=replace(system.actuators, motor_damping=np.full(6, D_REPEATED)),
    )


def straight():
    """Both knees 1e-7 rad off the stretched leg: J* all but loses a rank."""
    system = standing()
    q = system.posture.copy()
    q[[-4, -1]] = 1e-7
    return replace(system, posture=q)


DESIGNS = {
    "torque in 1e-3 Nm": functools.partial(torque_unit, 1e3),
    "torque in 1e3 Nm": functools.partial(torque_unit, 1e-3),
    "time in 1e-6 s": functools.partial(time_unit, 1e6),
    "time in 1e6 s": functools.partial(time_unit, 1e-6),
    "repeated eigenvalues": repeated,
    "second task without stiffness": lambda: gains(standing(), 1.0, 0.0),
    "one axis without stiffness": lambda: gains(standing(), np.diag([1.0, 0.0, 1.0]), 1.0),
    "one part in 1e12": lambda: gains(standing(), 1.0, 1e-12),
    "straight legs": straight,
}


@functools.cache
def bound(name, criterion):
    return plain(sealag.certify(DESIGNS[name](), criterion=criterion))


@pytest.mark.parametrize("criterion", list(Criterion))
@pytest.mark.parametrize("name", DESIGNS)
def test_holds_and_no_longer_delay_does(name, criterion):
    data = bound(name, criterion)
    if name == "straight legs":  # proven, but no equilibrium is found where J* loses a rank
        assert "has no equilibrium" in data["reasons"][0]
    else:
        stable = "certified" if data["stable"] else "passive_only"
        assert data["status"] == stable, data["reasons"]
    assert data["max_delay_upper_s"] <= data["max_delay_s"] * (1.0 + 2e-6)
    assert failures(data, exact=True) == []
    checks = Certificate.verify(resealed(data)).checks
    doubtful = [check for check in checks if not check.ok]
    assert not doubtful or name == "straight legs"
    assert all("in doubt: --exact decides" in check.detail for check in doubtful)
    factor = 1.00001
    longer = {**data, "max_delay_s": factor * data["max_delay_s"], "bounds_s": []}
    longer["bounds_s"] = [longer["max_delay_s"]]
    longer["max_delay_upper_s"] = factor * data["max_delay_upper_s"]
    proof = {**data["proofs"][0], "delay_s": longer["max_delay_s"]}
    proof["W"] = [(factor * np.array(block)).tolist() for block in proof["W"]]
    longer["proofs"] = [proof]
    for exact in (False, True):
        assert "instant 0: matrix inequality" in failures(longer, exact=exact)


def test_bounds_are_those_that_are_known():
    base = sealag.certify(standing()).answer.max_delay_s
    certified = {name: bound(name, Criterion.CERTIFIED)["max_delay_s"] for name in DESIGNS}
    for unit in ("1e-3", "1e3"):
        assert certified[f"torque in {unit} Nm"] == pytest.approx(base, rel=1e-6)
    assert certified["time in 1e-6 s"] == pytest.approx(1e6 * base, rel=1e-6)
    assert certified["time in 1e6 s"] == pytest.approx(1e-6 * base, rel=1e-6)
    known = D_REPEATED / K_REPEATED
    assert known * (1.0 - 1e-6) < certified["repeated eigenvalues"] < known
    alone = certified["second task without stiffness"]
    assert alone > 1.1 * base
    assert certified["one part in 1e12"] == pytest.approx(alone, rel=1e-6)


def test_what_the_delay_stands_for_is_said():
    system = standing()
    late = replace(system, delays=replace(system.delays, delayed_torque_feedback=True))
    for design, said in ((system, True), (late, False)):
        keys = {one.key for one in sealag.certify(design).answer.assumptions}
        assert {"delay_bound", "one_delay"} <= keys
        assert ("torque_feedback" in keys) is said


def test_two_ways_with_a_quantile_are_one_assumption():
    """Keys of assumptions are not repeated, or no check of the certificate would hold."""
    samples = Table.measured([1e-3] * 9 + [5e-3], period=0.01, quantile=0.8)
    system = replace(standing(), delays=Delays(central=samples, embedded=samples))
    data = plain(sealag.certify(system))
    said = [one["text"] for one in data["assumptions"] if one["key"] == "delay_quantile"]
    assert len(said) == 1
    assert all(way in said[0] for way in ("central_up", "central_down", "embedded_down"))
    assert failures(data) == []
