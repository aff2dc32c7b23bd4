"""Long runs and motions say what short ones say: on disk as in memory, in blocks as in one."""

from dataclasses import fields, replace

import numpy as np
import pytest

import sealag
from helpers.small_systems import arm_system
from sealag.design import load
from sealag.errors import InputError
from sealag.passivity import Certificate
from sealag.report import read_recording, write_run
from sealag.robot import Motion
from sealag.simulation import Clock, Network
from sealag.store import blocks
from sealag.whole_body import Law, StaticJoint, Task


def _arrays(record):
    for entry in fields(record):
        value = getattr(record, entry.name)
        parts = value if isinstance(value, dict) else {"": value}
        for name, part in parts.items():
            if isinstance(part, np.ndarray):
                yield f"{entry.name}{name}", part


def test_a_run_on_disk_is_the_run_in_memory(tmp_path, monkeypatch):
    system = load("bundled:hume")
    short = sealag.simulate(system, scenario="balance", duration=0.2)
    monkeypatch.setattr("sealag.store.LARGEST_IN_MEMORY", 0)
    long = sealag.simulate(system, scenario="balance", duration=0.2)
    assert isinstance(long.theta.base, np.ndarray)
    for one, other in ((short, long), (short.audit, long.audit)):
        for (name, here), (_, there) in zip(_arrays(one), _arrays(other), strict=True):
            np.testing.assert_array_equal(here, there, err_msg=name)
    for name, run in (("short", short), ("long", long)):
        write_run(run, system.robot, tmp_path / f"{name}.mcap", project="", version="")
    one, other = (read_recording(tmp_path / f"{name}.mcap") for name in ("short", "long"))
    assert set(one.signals) == set(other.signals)
    for topic, signal in one.signals.items():
        np.testing.assert_array_equal(signal.values, other.signals[topic].values, err_msg=topic)


def test_blocks_of_a_run_are_its_rows():
    run = sealag.simulate(load("bundled:hume"), scenario="balance", duration=0.05)
    rows = np.concatenate([run.time[block] for block in run.blocks(7)])
    np.testing.assert_array_equal(rows, run.time)


def test_too_many_packets_are_refused_before_their_ways_are_planned():
    with pytest.raises(InputError, match=r"1e\+09 packets.*simulate for at most 20000 s"):
        Network.ideal().plan(Clock(), duration=1e6, seed=0)
    system = load("bundled:hume")
    with pytest.raises(InputError, match="packets"):
        sealag.simulate(system, scenario="balance", duration=1e6, log_period=1e3)


@pytest.fixture
def swinging(tmp_path, monkeypatch):
    """The arm over a motion that folds it, of three blocks; its bounds and margins vary."""
    monkeypatch.setattr("sealag.store.BLOCK", 50)
    com = Task(name="com", kind="com", axes=(0, 2), stiffness=150.0)
    law = Law(tasks=(com,), signal=StaticJoint(), gravity="planned", stiffness_form="force")
    system, t = arm_system(tmp_path, law=law), np.linspace(2.0, 0.0, 120)
    motion = Motion(
        time=2.0 - t, q=np.column_stack([1.5 + 0.3 * np.sin(2 * t), 0.9 - 0.7 * np.cos(3 * t)]),
        v=np.zeros((120, 2)), contact_sets=((),), contact_index=np.zeros(120, dtype=np.int64),
    )  # fmt: skip
    assert len(list(blocks(len(motion)))) == 3
    return system, motion


@pytest.mark.parametrize("criterion", ["certified", "published"])
def test_a_motion_of_several_blocks_is_certified_as_in_one(
    swinging, tmp_path, monkeypatch, criterion
):
    system, motion = swinging
    parted = sealag.certify(system, motion, criterion=criterion)
    path = tmp_path / "parted.json"
    parted.write(path)
    assert Certificate.verify(path).valid
    monkeypatch.setattr("sealag.store.BLOCK", 1000)
    whole = sealag.certify(system, motion, criterion=criterion)
    assert np.ptp(whole.evidence.bounds_s) > 0.01 * whole.answer.max_delay_s
    assert whole.answer.worst.instant > 50 or criterion == "published"
    assert parted.to_json_dict() == whole.to_json_dict()


def test_a_margin_of_several_blocks_is_that_of_one(swinging, monkeypatch):
    system, motion = swinging
    parted = system.local_margins(motion)
    monkeypatch.setattr("sealag.store.BLOCK", 1000)
    assert parted == system.local_margins(motion)


def test_what_fails_in_a_later_block_is_counted_over_all(swinging):
    """A motor that is too weak at instants of the second and third block."""
    system, motion = swinging
    loads = np.abs([system.robot.gravity(q) for q in motion.q])[:, 0]
    limit = float(np.median(loads))
    weak = loads > limit
    assert weak[50:].any()
    drives = replace(system.actuators, torque_limit=np.array([limit, np.inf]))
    answer = sealag.certify(replace(system, actuators=drives), motion).answer
    assert answer.max_delay_s == 0.0
    assert f"at {weak.sum()} of 120 instants" in answer.reasons[0]


def test_more_instants_than_a_certificate_holds_are_refused_at_once(swinging):
    system, motion = swinging
    count = 1_400_001
    endless = Motion(
        time=np.arange(count) * 1e-3, q=np.broadcast_to(motion.q[0], (count, 2)),
        v=np.zeros((count, 2)), contact_sets=((),), contact_index=np.zeros(count, dtype=np.int64),
    )  # fmt: skip
    with pytest.raises(InputError, match="1400001 instants; a certificate holds 1400000 at most"):
        sealag.certify(system, endless)
