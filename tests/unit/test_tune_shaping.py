"""The least inertia shaping: damping that a loop computes, and noise, run tick by tick."""

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system, constant_delays
from sealag.passivity import Status
from sealag.tune import tune

PERIOD = 1e-3
BESIDE = 1e-3


def late_arm(folder, **springs):
    """An arm whose drives have a period of 1 ms."""
    delays = constant_delays(0.002, 0.002, embedded_period=PERIOD)
    return arm_system(folder, springs=springs, delays=delays, posture=np.array([np.pi / 2, 0.0]))


def speed_after(ticks, D, B, shaping, period):
    """Speed of a free motor whose drive damps once in each period."""
    speed = np.ones_like(B)
    for _ in range(ticks):
        torque = -D * speed / shaping
        speed = speed + period * torque / B
    return np.abs(speed)


def test_damping_that_is_computed_once_a_period_is_stable_from_there_on(tmp_path):
    tuned = tune(late_arm(tmp_path), aim="shaping")
    drives = tuned.system.actuators
    D, B, shaping = drives.motor_damping, drives.rotor_inertia, drives.inertia_shaping
    assert tuned.binding.kind == "period"
    assert (speed_after(20_000, D, B, (1.0 + BESIDE) * shaping, PERIOD) < 1e-3).all()
    assert (speed_after(20_000, D, B, (1.0 - BESIDE) * shaping, PERIOD) > 1e3).all()


def test_safety_stretches_the_period(tmp_path):
    """Twice the period at the edge is one period to rest."""
    drives = tune(late_arm(tmp_path), aim="shaping", safety=2.0).system.actuators
    D, B, shaping = drives.motor_damping, drives.rotor_inertia, drives.inertia_shaping
    assert (speed_after(1, D, B, shaping, PERIOD) < 1e-5).all()


def test_noise_of_the_torque_comes_back_as_large_as_is_allowed(tmp_path):
    tuned = tune(late_arm(tmp_path, motor_damping=0.1), aim="shaping", limits={"noise": 3.0})
    drives = tuned.system.actuators
    ratio = drives.rotor_inertia / drives.shaped_inertia
    noise = np.random.default_rng(0).normal(size=(10_000, 2))
    gain = ((1.0 - ratio) * noise).std(axis=0) / noise.std(axis=0)
    assert gain == pytest.approx([3.0, 3.0], rel=1e-5)
    assert (gain <= 3.0 + 1e-9).all()
    assert tuned.binding.kind == "noise"


def test_period_and_noise_can_exclude_each_other(tmp_path):
    tuned = tune(late_arm(tmp_path, motor_damping=400.0), aim="shaping", limits={"noise": 0.2})
    assert not tuned.found
    assert "joint1" in tuned.reasons[0]


def test_what_is_written_is_what_was_found(tmp_path):
    text = (EXAMPLES / "anymal.toml").read_text()
    text = text.replace("[delays]", "[delays]\nembedded_period_ms = 0.5")
    system = sealag.load(EXAMPLES / "anymal.toml", text=text)
    tuned = tune(system, aim="shaping", limits={"noise": 10.0})
    again = sealag.load(EXAMPLES / "anymal.toml", text=tuned.system.text)
    assert tuned.found
    assert again.actuators.inertia_shaping == pytest.approx(1.0 / 11.0, rel=1e-6)
    assert sealag.certify(again).answer.status is Status.CERTIFIED
