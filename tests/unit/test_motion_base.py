"""A base's pose from contacts, and runs and their recordings as motions."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import sealag
from helpers.designs import EXAMPLES
from sealag.errors import InputError, MotionError
from sealag.report import McapRecorder, write_run


@pytest.fixture(scope="module")
def anymal():
    return sealag.load(EXAMPLES / "anymal.toml")


def feet(system, q):
    at = system.robot.workspace_at(q)
    return np.array([at.frame_placement(contact.frame)[1] for contact in system.contacts])


def swaying(system, count=6, lifted=None):
    """(N, nq): the base sways and turns, joints are found so that the feet stay; a lifted foot
    rises meanwhile by some cm."""
    posture = system.posture
    stand = feet(system, posture)
    rows = []
    for k in range(count):
        q = posture.copy() if not rows else rows[-1].copy()
        q[:3] = posture[:3] + 0.01 * k * np.array([1.0, -0.5, -0.3])
        turn = Rotation.from_rotvec(0.02 * k * np.array([0.3, 1.0, -0.7]))
        q[3:7] = (turn * Rotation.from_quat(posture[3:7])).as_quat()
        goal = stand.copy()
        if lifted is not None and 0 < k < count - 1:
            goal[lifted, 2] += 0.06

        def apart(joints, q=q, goal=goal):
            return (feet(system, np.concatenate([q[:7], joints])) - goal).ravel()

        q[7:] = least_squares(apart, q[7:], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        assert np.abs(apart(q[7:])).max() < 1e-8
        rows.append(q)
    return np.array(rows)


def read(system, path, q, **columns):
    joints = dict(zip(system.robot.joints, q[:, 7:].T, strict=True))
    np.savez(path, time_s=0.1 * np.arange(len(q)), **joints, **columns)
    told = []
    return system.load_motion(path, tell=told.append), told


def test_the_base_is_where_the_feet_stay(anymal, tmp_path):
    q = swaying(anymal)
    motion, told = read(anymal, tmp_path / "m.npz", q)
    np.testing.assert_allclose(motion.q[:, :3], q[:, :3], atol=1e-6)
    turned = Rotation.from_quat(motion.q[:, 3:7]) * Rotation.from_quat(q[:, 3:7]).inv()
    assert turned.magnitude().max() < 1e-6
    assert len(told) == 1
    assert all(contact.frame in told[0] for contact in anymal.contacts)


def test_a_lifted_foot_does_not_count_while_it_is_lifted(anymal, tmp_path):
    q = swaying(anymal, lifted=1)
    frame = anymal.contacts[1].frame
    down = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    motion, _ = read(anymal, tmp_path / "m.npz", q, **{f"contact:{frame}": down})
    np.testing.assert_allclose(motion.q[:, :3], q[:, :3], atol=1e-6)
    with pytest.raises(MotionError, match="contradict each other"):
        read(anymal, tmp_path / "m.npz", q)


def test_a_stance_of_its_own_is_where_the_posture_puts_it(anymal, tmp_path):
    q = np.tile(anymal.posture, (2, 1))
    q[:, 7:] += 0.05
    motion, _ = read(anymal, tmp_path / "m.npz", q)
    np.testing.assert_allclose(motion.q[0], motion.q[1], atol=1e-12)
    shift = feet(anymal, motion.q[0]) - feet(anymal, anymal.posture)
    assert np.abs(shift.mean(axis=0)).max() < 1e-12


def test_a_surface_fixes_the_base_alone(anymal, tmp_path):
    one = replace(
        anymal, contacts=(sealag.Contact(frame=anymal.contacts[0].frame, kind="surface"),)
    )
    q = np.tile(anymal.posture, (3, 1))
    motion, _ = read(one, tmp_path / "m.npz", q)
    np.testing.assert_allclose(motion.q, q, atol=1e-9)


def test_too_few_contacts_leave_the_base_free(anymal, tmp_path):
    q = np.tile(anymal.posture, (3, 1))
    for kept in (anymal.contacts[:2], anymal.contacts[:1], ()):
        with pytest.raises(MotionError, match="do not fix the base"):
            read(replace(anymal, contacts=kept), tmp_path / "m.npz", q)
    off = {f"contact:{contact.frame}": np.array([1.0, 0.0, 1.0]) for contact in anymal.contacts}
    with pytest.raises(MotionError, match="row 2"):
        read(anymal, tmp_path / "m.npz", q, **off)
    with pytest.raises(MotionError, match="base_y"):
        read(anymal, tmp_path / "m.npz", q, base_x=np.zeros(3))


@pytest.fixture(scope="module")
def walked():
    system = sealag.load("bundled:hume")
    return system, sealag.simulate(system, scenario="walk", duration=0.5, log_period=0.01)


def test_a_run_and_its_recording_are_the_same_motion(walked, tmp_path):
    system, run = walked
    path = tmp_path / "walk.mcap"
    write_run(run, system.robot, path, project="", version="")
    told = []
    recorded = system.load_motion(path, tell=told.append)
    motion = system.motion_of(run)
    np.testing.assert_allclose(recorded.time, run.time, atol=1e-9)
    motions = [motion, recorded]
    with suppress(InputError):  # where pandas is not installed
        run.to_pandas().to_csv(tmp_path / "run.csv")
        motions.append(system.load_motion(tmp_path / "run.csv", tell=lambda _: None))
    for one in motions:
        np.testing.assert_allclose(one.q, run.q, atol=1e-12)
        np.testing.assert_allclose(one.v, run.v, atol=1e-12)
        for k in range(len(run.time)):
            held = {contact.frame for contact in one.contact_sets[one.contact_index[k]]}
            stuck = {foot for foot in run.feet if run.contact_mode[k, run.feet.index(foot)] == 1}
            assert held == stuck
    assert told == []
    assert len({tuple(frames) for frames in motion.contact_sets}) > 1


def test_a_run_is_certified(tmp_path, cli):
    system = sealag.load(EXAMPLES / "hume_held.toml")
    out = tmp_path / "r.mcap"
    assert cli("simulate", EXAMPLES / "hume_held.toml", "--scenario", "track",
               "--duration", "0.1", "--log-ms", "20", "--out", out)[0] == 0  # fmt: skip
    run = sealag.simulate(system, scenario="track", duration=0.1, log_period=0.02)
    found = sealag.certify(system, run)
    assert found.question.instants == len(run.time)
    code, _, err = cli("certify", EXAMPLES / "hume_held.toml", "--motion", out,
                       "--out", tmp_path / "c.json")  # fmt: skip
    assert (code, err) == (0, "")
    written = sealag.Certificate.read(tmp_path / "c.json")
    assert written.answer.max_delay_s == pytest.approx(found.answer.max_delay_s, rel=1e-9)
    assert cli("certify", EXAMPLES / "hume_held.toml", "--motion", out, "--out", out)[0] == 2


def test_a_run_of_another_robot_is_refused(walked, anymal):
    with pytest.raises(InputError, match="run of this design"):
        anymal.motion_of(walked[1])


def test_a_run_that_stood_on_something_else_is_refused(walked):
    system, run = walked
    barefoot = replace(system, contacts=())
    with pytest.raises(MotionError, match="no contact of the"):
        barefoot.motion_of(run)


def test_a_contact_of_which_a_recording_says_nothing_did_not_hold(walked, tmp_path):
    system, run = walked
    path = tmp_path / "own.mcap"
    with McapRecorder(path=path, joints=run.joints) as recorder:
        joints = system.robot.joint_positions(run.q)
        recorder.write_joint_states(run.time, joints, run.v[:, 6:], effort=run.tau_sea)
        base = run.signals()["/base"]
        values = np.column_stack(list(base.values()))
        recorder.write_signal("/base", list(base), run.time, values=values)
    assert system.load_motion(path).contact_sets == ((),)
    empty = tmp_path / "empty.mcap"
    with McapRecorder(path=empty, joints=run.joints) as recorder:
        recorder.write_signal("/x", ["x"], run.time, values=run.time[:, None])
    with pytest.raises(sealag.SealagError, match="no joint states"):
        system.load_motion(empty)
