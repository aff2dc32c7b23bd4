"""Motions as others write them: names, units of time, order of quaternions, columns too many."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sealag
from helpers.certificates import half_a_step
from helpers.designs import EXAMPLES
from sealag.errors import InputError, MotionError

HELD = EXAMPLES / "hume_held.toml"


@pytest.fixture(scope="module")
def held():
    return sealag.load(HELD)


@pytest.fixture(scope="module")
def walk():
    system = sealag.load("bundled:hume")
    return system, half_a_step(system)


def table(system, count=30, step=0.01):
    """A motion of joints about the posture, as columns."""
    t = step * np.arange(count)
    swing = 0.05 * np.sin(7.0 * t)
    columns = {
        joint: value + swing * (1.0 + k)
        for k, (joint, value) in enumerate(zip(system.robot.joints, system.posture, strict=True))
    }
    return {"time_s": t, **columns}


def read(system, path, table, **choices):
    """The motion of an NPZ of these columns, and what was told."""
    np.savez(path, **table)
    told = []
    return system.load_motion(path, tell=told.append, **choices), told


def retimed(columns, name, times):
    return {name: times, **{key: value for key, value in columns.items() if key != "time_s"}}


@pytest.mark.parametrize(
    ("name", "scale"),
    [
        ("time_s", 1.0), ("t_s", 1.0), ("stamp_s", 1.0), ("time_ms", 1e3), ("t_ms", 1e3),
        ("time [ms]", 1e3), ("timestamp_us", 1e6), ("time_ns", 1e9), ("header.stamp_nsec", 1e9),
        ("Time (ns)", 1e9),
    ],
)  # fmt: skip
def test_a_time_is_read_in_the_unit_of_its_name(held, tmp_path, name, scale):
    columns = table(held)
    motion, told = read(held, tmp_path / "m.npz", retimed(columns, name, columns["time_s"] * scale))
    np.testing.assert_allclose(motion.time, columns["time_s"], atol=1e-12)
    assert told == []


@pytest.mark.parametrize("name", ["t", "time", "stamp", "%time", "timestamp"])
def test_a_time_without_unit_is_seconds_or_refused(held, tmp_path, name):
    columns = table(held)
    path = tmp_path / "m.npz"
    motion, told = read(held, path, retimed(columns, name, columns["time_s"]))
    np.testing.assert_array_equal(motion.time, columns["time_s"])
    assert len(told) == 1
    assert "seconds" in told[0]
    for scale, unit in ((1e3, "time_ms"), (1e9, "time_ns")):
        with pytest.raises(MotionError, match=f"--columns {name}={unit}"):
            read(held, path, retimed(columns, name, columns["time_s"] * scale))
    motion, _ = read(
        held, path, retimed(columns, name, columns["time_s"] * 1e9), columns=f"{name}=time_ns"
    )
    np.testing.assert_allclose(motion.time, columns["time_s"], atol=1e-12)


def test_a_date_in_ns_keeps_its_digits_and_begins_at_0(held, tmp_path):
    columns = table(held, step=1e-4)
    stamp = np.int64(1_760_000_000_123_456_789) + np.arange(30, dtype=np.int64) * 100_001
    motion, _ = read(held, tmp_path / "m.npz", retimed(columns, "stamp_ns", stamp))
    np.testing.assert_allclose(motion.time, np.arange(30) * 100_001e-9, rtol=1e-15)


def test_a_log_in_seconds_with_slow_rows_is_mentioned(held, tmp_path):
    columns = table(held)
    _, told = read(held, tmp_path / "m.npz", {**columns, "time_s": 10.0 * np.arange(30)})
    assert len(told) == 1
    assert "time_ms" in told[0]


def test_two_times_are_refused_unless_one_is_ours(held, tmp_path):
    columns = table(held)
    t = columns["time_s"]
    with pytest.raises(MotionError, match="both times"):
        read(held, tmp_path / "m.npz", {**retimed(columns, "t_ms", t * 1e3), "stamp": t})
    motion, _ = read(held, tmp_path / "m.npz", {**columns, "stamp": t})
    np.testing.assert_array_equal(motion.time, t)


def test_columns_too_many_are_named_and_left_out(held, tmp_path):
    columns = table(held)
    more = {**columns, "battery": np.ones(30), "mode": np.array(["walk"] * 30)}
    motion, told = read(held, tmp_path / "m.npz", more)
    assert told == [f"{tmp_path / 'm.npz'}: 2 columns are not read: battery, mode"]
    plain, _ = read(held, tmp_path / "n.npz", columns)
    np.testing.assert_array_equal(motion.q, plain.q)
    text = "time_s,who," + ",".join(held.robot.joints) + "\n"
    rows = zip(*columns.values(), strict=True)
    text += "".join(f"{row[0]},me,{','.join(map(repr, map(float, row[1:])))}\n" for row in rows)
    (tmp_path / "m.csv").write_text(text)
    with pytest.warns(UserWarning, match="1 column is not read: who"):
        motion = held.load_motion(tmp_path / "m.csv")
    np.testing.assert_array_equal(motion.q, plain.q)


def test_columns_are_mapped(held, tmp_path):
    columns = table(held)
    plain, _ = read(held, tmp_path / "n.npz", columns)
    theirs = {f"q{k}": joint for k, joint in enumerate(held.robot.joints)} | {"clock": "time_ms"}
    ours = {name: key for key, name in theirs.items()}
    renamed = {ours.get(name, name): value for name, value in columns.items() if name != "time_s"}
    renamed["clock"] = columns["time_s"] * 1e3
    (tmp_path / "map.json").write_text(json.dumps(theirs))
    (tmp_path / "map.toml").write_text("".join(f'"{a}" = "{b}"\n' for a, b in theirs.items()))
    text = ", ".join(f"{a}={b}" for a, b in theirs.items())
    for given in (theirs, text, tmp_path / "map.json", str(tmp_path / "map.toml")):
        motion, told = read(held, tmp_path / "m.npz", renamed, columns=given)
        np.testing.assert_array_equal(motion.q, plain.q)
        np.testing.assert_allclose(motion.time, plain.time)
        assert told == []


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ("a=b", "no column 'a'"),
        ("left_knee", "theirs=ours"),
        ("left_knee=right_knee=x", "theirs=ours"),
        ("left_knee=elbow", "no use for 'elbow'"),
        ("left_knee=right_knee", "both right_knee"),
        ("left_knee=left_hip,right_knee=left_hip", "two columns to one"),
        ("left_knee=left_hip,left_knee=right_hip", "twice"),
        ({"left_knee": 3}, "must map"),
        ("", "theirs=ours"),
    ],
)
def test_a_wrong_mapping_is_named(held, tmp_path, columns, word):
    with pytest.raises(InputError, match=word):
        read(held, tmp_path / "m.npz", table(held), columns=columns)


def test_what_is_missing_is_told_with_all_that_there_may_be(walk, tmp_path):
    system, motion = walk
    system.save_motion(motion, tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz") as data:
        columns = dict(data)
    columns["left_kne"] = columns.pop("left_knee")
    with pytest.raises(MotionError) as stop:
        read(system, tmp_path / "m.npz", columns)
    said = str(stop.value)
    assert (stop.value.file, stop.value.key) == (str(tmp_path / "m.npz"), "left_knee")
    assert "--columns left_kne=left_knee" in said
    for name in (*columns, "left_knee", "time_ns"):
        assert name in said or name == "left_kne"


def test_a_name_inside_a_longer_one_is_suggested(held, tmp_path):
    columns = {f"/joint_states/{name}/position" if name != "time_s" else name: values
               for name, values in table(held).items()}  # fmt: skip
    joint = held.robot.joints[0]
    with pytest.raises(MotionError, match=f"Then --columns /joint_states/{joint}/position={joint}"):
        read(held, tmp_path / "m.npz", columns)


def test_a_table_of_savetxt_is_read(held, tmp_path):
    columns, path = table(held), tmp_path / "m.csv"
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns))
    motion = held.load_motion(path)
    np.testing.assert_allclose(motion.time, columns["time_s"], atol=1e-12)


def test_a_column_without_a_name_is_mentioned(held, tmp_path):
    columns, path = table(held), tmp_path / "m.csv"
    rows = np.column_stack([np.arange(30), *columns.values()])
    np.savetxt(path, rows, delimiter=",", header="," + ",".join(columns), comments="")
    told = []
    held.load_motion(path, tell=told.append)
    assert told == [f"{path}: 1 column is not read: one without a name"]


def test_names_that_are_objects_are_told_how_to_be_saved(held, tmp_path):
    joints = np.array(held.robot.joints, dtype=object)
    states = {"name": joints, "position": np.zeros((30, len(joints)))}
    with pytest.raises(MotionError, match="dtype=str"):
        read(held, tmp_path / "m.npz", {"time_s": np.arange(30.0), **states})


def test_joint_states_of_ros_are_read_by_name(held, tmp_path):
    columns = table(held)
    joints = list(reversed(held.robot.joints))
    position = np.column_stack([columns[joint] for joint in joints])
    states = {"stamp_s": columns["time_s"], "name": np.array(joints), "position": position}
    states["effort"] = np.zeros((0, 0))
    plain, _ = read(held, tmp_path / "n.npz", columns)
    motion, told = read(held, tmp_path / "m.npz", states)
    np.testing.assert_array_equal(motion.q, plain.q)
    assert told == []
    motion, _ = read(held, tmp_path / "m.npz", {**states, "velocity": 2.0 + 0.0 * position})
    assert (motion.v == 2.0).all()
    with pytest.raises(MotionError, match="as a column and in name"):
        read(held, tmp_path / "m.npz", {**states, joints[0]: position[:, 0]})
    with pytest.raises(MotionError, match="position has shape"):
        read(held, tmp_path / "m.npz", {**states, "position": position[:, 1:]})


def with_orientation(system, motion, quaternions, path, **choices):
    system.save_motion(motion, path)
    with np.load(path) as data:
        columns = {key: data[key] for key in data if "base_v" not in key and "base_w" not in key}
    columns = {key: value for key, value in columns.items() if ":velocity" not in key}
    columns |= dict(zip(("base_qx", "base_qy", "base_qz", "base_qw"), quaternions.T, strict=True))
    return read(system, path, columns, **choices)


def test_a_quaternion_with_w_first_is_questioned(walk, tmp_path):
    system, motion = walk
    path, right = tmp_path / "m.npz", motion.q[:, 3:7]
    first = np.roll(right, 1, axis=1)
    with pytest.raises(MotionError, match="--quaternion wxyz"):
        with_orientation(system, motion, first, path)
    back, _ = with_orientation(system, motion, first, path, quaternion="wxyz")
    np.testing.assert_allclose(back.q, motion.q, atol=1e-12)
    kept, _ = with_orientation(system, motion, first, path, quaternion="xyzw")
    np.testing.assert_allclose(kept.q[:, 3:7], first, atol=1e-12)
    with pytest.raises(InputError, match="xyzw or wxyz"):
        with_orientation(system, motion, right, path, quaternion="zyxw")


def test_yaw_and_changes_of_sign_are_none_of_it(walk, tmp_path):
    system, motion = walk
    for yaw in (0.0, 1.5, 3.1, -2.0):
        turned = Rotation.from_euler("z", yaw) * Rotation.from_quat(motion.q[:, 3:7])
        quaternions = turned.as_quat()
        quaternions[1::2] *= -1.0
        back, told = with_orientation(system, motion, quaternions, tmp_path / "m.npz")
        assert len(back) == len(motion)
        assert told == []


def test_an_order_without_a_quaternion_is_refused(held, tmp_path):
    for order, word in (("wxyz", "leave --quaternion out"), ("zyxw", "xyzw or wxyz")):
        with pytest.raises(InputError, match=word):
            read(held, tmp_path / "m.npz", table(held), quaternion=order)


def test_a_base_that_jumps_is_questioned(walk, tmp_path):
    system, motion = walk
    quaternions = motion.q[:, 3:7].copy()
    yaw = Rotation.from_euler("z", 1.2)
    quaternions[4:] = (yaw * Rotation.from_quat(quaternions[4:])).as_quat()
    with pytest.raises(MotionError, match="from row 4 to row 5"):
        with_orientation(system, motion, quaternions, tmp_path / "m.npz")
    trusted, _ = with_orientation(
        system, motion, quaternions, tmp_path / "m.npz", quaternion="xyzw"
    )
    assert len(trusted) == len(motion)


def test_the_command_line_maps_and_says_what_it_did(held, tmp_path, cli):
    columns = table(held, count=3)
    np.savez(
        tmp_path / "m.npz",
        battery=np.ones(3), **retimed(columns, "clock", columns["time_s"] * 1e9),
    )  # fmt: skip
    out = tmp_path / "c.json"
    options = ("--motion", tmp_path / "m.npz", "--columns", "clock=time_ns")
    code, text, err = cli("certify", HELD, *options, "--out", out, "--json")
    assert code == 0
    assert json.loads(text)["instants"] == 3
    assert err == f"sealag: {tmp_path / 'm.npz'}: 1 column is not read: battery\n"
    assert cli("verify", out, "--project", HELD, *options)[0] == 0
    assert cli("margin", HELD, *options)[0] == 0
    code, _, err = cli("certify", HELD, "--columns", "clock=time_ns", "--out", out)
    assert code == 2
    assert "--motion" in err
    for command in (("verify", out), ("verify", out, "--second")):
        assert cli(*command, "--columns", "a=b")[0] == 2
