"""Rows of motors and drives in a frozen loop are those that the file's own numbers give."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.certificates import failures, plain
from helpers.designs import EXAMPLES
from sealag.delay import Constant, Delays
from sealag.design import verify_design
from sealag.second_verifier import claims
from sealag.whole_body import LinkAngles, MotorAngles, StaticJoint, Tank

MOTORS = "frozen loop: motors"
SIGNALS = {one.name: one for one in (MotorAngles(), LinkAngles(), StaticJoint(), Tank())}
DRIVES = {
    "friction": {},
    "bandwidth": {"torque_bandwidth": [300.0] * 6},
    "one drive": {"torque_bandwidth": [300.0, *[np.inf] * 5]},
}


@functools.cache
def design(drive, late, signal="static_joint"):
    """Hume held by its torso, with friction and damping beside springs and B_s = B/2."""
    system = sealag.load(EXAMPLES / "hume_held.toml")
    changed = {"viscous_friction": [0.7] * 6, "spring_damping": [0.3] * 6} | DRIVES[drive]
    drives = replace(system.actuators, **{key: np.array(v) for key, v in changed.items()})
    embedded = Constant(value=2e-3 if late == "late" else 0.0)
    delays = Delays(
        central=Constant(value=4e-3), embedded=embedded, delayed_torque_feedback=late != "at once"
    )
    law = replace(system.law, signal=SIGNALS[signal])
    return replace(system, actuators=drives, delays=delays, law=law)


@functools.cache
def certificate(drive, late, signal="static_joint"):
    return plain(sealag.certify(design(drive, late, signal)))


@pytest.mark.parametrize("late", ["at once", "late"])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("signal", SIGNALS)
def test_every_drive_holds_in_both_verifiers(signal, drive, late):
    data = certificate(drive, late, signal)
    assert failures(data, exact=True) == []
    assert not [name for name, holds, _ in claims(data) if holds is False]
    drives = sum(name.startswith("drive:") for name in data["local_loop"]["states"])
    assert drives == {"friction": 0, "bandwidth": 6, "one drive": 1}[drive]
    assert (data["local_loop"]["A_e"] is not None) is (late == "late")


def test_feedback_that_is_late_by_nothing_is_at_once():
    """A connection without delay: the same loop, and no second delay in it."""
    assert design("friction", "late by 0").delays.torque_feedback_delay == 0.0
    data = certificate("friction", "late by 0")
    assert data["local_loop"]["A_e"] is None
    assert failures(data) == []


NUMBERS = ("viscous_friction", "spring_damping", "motor_inertia", "rotor_inertia", "D_theta")


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize(("drive", "late"), [("friction", "at once"), ("one drive", "late")])
def test_another_number_of_the_drives_is_found(drive, late, key):
    data = dict(certificate(drive, late))
    data[key] = [1.001 * data[key][0], *data[key][1:]]
    assert MOTORS in failures(data)


def test_another_bandwidth_is_found():
    data = dict(certificate("bandwidth", "late"))
    data["torque_bandwidth"] = [301.0, *data["torque_bandwidth"][1:]]
    assert MOTORS in failures(data)


@pytest.mark.parametrize("part", ["A_0", "A_e"])
def test_another_drive_in_the_loop_is_found(part):
    data = dict(certificate("bandwidth", "late"))
    loop = data["local_loop"]
    states = loop["states"]
    row, column = (
        states.index(f"drive:{data['joints'][2]}"),
        states.index(f"theta:{data['joints'][2]}"),
    )
    if part == "A_0":
        column = states.index(f"d/dt theta:{data['joints'][2]}")
    changed = [list(values) for values in loop[part]]
    assert changed[row][column] != 0.0
    changed[row][column] *= 1.001
    data["local_loop"] = {**loop, part: changed}
    assert MOTORS in failures(data)


def test_a_posture_that_nothing_rests_in_says_so_and_no_more():
    """ANYmal on two point feet falls: no equilibrium, and q̄(θ) has no loop there."""
    system = sealag.load(EXAMPLES / "anymal.toml")
    data = plain(sealag.certify(replace(system, contacts=system.contacts[:2])))
    assert (data["status"], data["stable"]) == ("not_certified", False)
    assert failures(data) == []
    rests = {**data, "equilibrium": {"found": True, "moved_rad": 0.0}}
    assert failures(rests) != []


def test_the_frozen_loop_is_compared_with_the_designs():
    """Whatever z is: turned coordinates hold, another loop does not."""
    system = design("friction", "at once")
    data = dict(certificate("friction", "at once"))

    def bad(loop):
        from helpers.certificates import resealed

        checks = verify_design(resealed({**data, "local_loop": loop}), system).checks
        return [check.name for check in checks if not check.ok]

    loop = data["local_loop"]
    k = sum(name.startswith("z") for name in loop["states"])
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((k, k)))[0]
    T = np.eye(len(loop["states"]))
    T[:k, :k] = turn
    half = (len(T)) // 2
    T[half : half + k, half : half + k] = turn
    turned = {key: (T @ np.array(loop[key]) @ T.T) for key in ("A_0", "A_1")}
    A_0 = turned["A_0"]
    A_0[:half] = np.eye(half, len(T), k=half)
    P = T @ np.array(loop["jitter"]["P"]) @ T.T
    proof = {**loop["jitter"], "P": ((P + P.T) / 2.0).tolist()}
    same = {**loop, "A_0": A_0.tolist(), "A_1": turned["A_1"].tolist()}
    assert bad({**same, "jitter": proof}) == []
    assert bad(same) == ["jitter margin: matrix inequality"]
    assert "design: local_loop" in bad({**loop, "at": "rest"})
