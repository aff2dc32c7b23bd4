"""A recording comes back as it went in, also when it was cut off or the disk filled up."""

import builtins
import errno
import io
import json
import os
import resource
import tempfile
from contextlib import contextmanager

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.cli import main
from sealag.errors import FileError, InputError
from sealag.report import McapRecorder, read_recording

JOINTS = ("hip", "knee")


def _write(path, count=500, **options):
    rng = np.random.default_rng(3)
    time = np.arange(count) * 1e-3
    data = {"q": rng.normal(size=(count, 2)), "poses": rng.normal(size=(count, 7))}
    with McapRecorder(path=path, joints=JOINTS, **options) as recorder:
        recorder.write_joint_states(time, data["q"], 2 * data["q"], effort=3 * data["q"])
        recorder.write_transforms(["base"], time, data["poses"])
        recorder.write_signal("/energy", ["kinetic_j", "spring_j"], time, values=data["q"])
    return time, data


def test_round_trip_is_exact(tmp_path):
    path = tmp_path / "run.mcap"
    time, data = _write(path, metadata={"seed": "7"}, attachments={"project.toml": b"[robot]"})
    recording = read_recording(path)
    assert recording.complete
    assert recording.metadata["seed"] == "7"
    assert recording.attachments["project.toml"] == b"[robot]"
    joints = recording.signals["/joint_states"]
    np.testing.assert_allclose(joints.time, time, rtol=1e-15)  # to the nanosecond, 0.029 s too
    np.testing.assert_array_equal(joints.column("knee:velocity"), 2 * data["q"][:, 1])
    np.testing.assert_array_equal(joints.column("hip:effort"), 3 * data["q"][:, 0])
    np.testing.assert_array_equal(recording.signals["/tf"].values, data["poses"])
    np.testing.assert_array_equal(recording.signals["/energy"].values, data["q"])
    assert os.listdir(tmp_path) == ["run.mcap"]


def test_an_independent_reader_sees_foxglove_messages(tmp_path):
    from mcap.reader import make_reader

    path = tmp_path / "run.mcap"
    _write(path, count=3)
    with open(path, "rb") as file:
        found = [
            (s.name, c.topic, json.loads(m.data)) for s, c, m in make_reader(file).iter_messages()
        ]
    names = {name for name, _, _ in found}
    assert {"foxglove.JointStates", "foxglove.FrameTransforms", "sealag.energy"} == names
    assert len(found) == 9
    _, _, joints = next(item for item in found if item[1] == "/joint_states")
    assert joints["timestamp"] == {"sec": 0, "nsec": 0}
    assert [joint["name"] for joint in joints["joints"]] == list(JOINTS)
    assert set(joints["joints"][0]) == {"name", "position", "velocity", "effort"}
    last = [message for _, topic, message in found if topic == "/tf"][-1]["transforms"][0]
    assert last["timestamp"] == {"sec": 0, "nsec": 2_000_000}
    assert (last["parent_frame_id"], last["child_frame_id"]) == ("world", "base")
    assert set(last["rotation"]) == {"x", "y", "z", "w"}


def test_ctrl_c_keeps_the_recording_before(tmp_path):
    path = tmp_path / "run.mcap"
    _write(path, count=3)
    with pytest.raises(KeyboardInterrupt), McapRecorder(path=path, joints=JOINTS) as recorder:
        recorder.write_signal("/x", ["a"], [0.0, 1.0], values=[[1.0], [2.0]])
        raise KeyboardInterrupt
    assert len(read_recording(path).signals["/energy"].time) == 3
    assert os.listdir(tmp_path) == ["run.mcap"]
    with pytest.raises(RuntimeError), McapRecorder(path=path, joints=JOINTS) as recorder:
        recorder.write_signal("/x", ["a"], [0.0, 1.0], values=[[1.0], [2.0]])
        raise RuntimeError
    assert len(read_recording(path).signals["/energy"].time) == 3
    beside = read_recording(tmp_path / "run.incomplete.mcap")
    np.testing.assert_array_equal(beside.signals["/x"].values[:, 0], [1.0, 2.0])


def test_names_and_numbers_that_json_spells_otherwise(tmp_path):
    """Quotes, percent signs and letters in names; the least and the largest of numbers."""
    names = ['a "b"', "100 %s", "é\\n"]
    values = np.array([[1e-300, -0.0, 1e300], [np.inf, 0.1, 12345678901234567.0]])
    path = tmp_path / "run.mcap"
    with McapRecorder(path=path, joints=JOINTS) as recorder:
        recorder.write_signal("/x", names, [0.0, 1.5], values=values)
    signal = read_recording(path).signals["/x"]
    assert signal.names == tuple(names)
    np.testing.assert_array_equal(signal.values, values)
    np.testing.assert_array_equal(signal.time, [0.0, 1.5])


def test_damage_ends_a_recording_or_is_told(tmp_path):
    """A changed byte gives what lies before it, or a FileError; never a changed number."""
    path, damaged = tmp_path / "run.mcap", tmp_path / "damaged.mcap"
    _write(path, count=1000)
    good, whole = path.read_bytes(), read_recording(path).signals
    rng = np.random.default_rng(5)
    spots = [*rng.integers(5, len(good), 12), *(len(good) - rng.integers(1, 2000, 24))]
    seen = set()
    for spot, byte in zip(spots, rng.integers(0, 256, len(spots))):
        damaged.write_bytes(good[:spot] + bytes([byte]) + good[spot + 1 :])
        try:
            found = read_recording(damaged)
        except FileError:
            continue
        seen.add(found.complete)
        for name, signal in found.signals.items():
            part = whole[name].values[: len(signal.time)]
            np.testing.assert_array_equal(signal.values, part)
    assert seen == {True, False}


def test_recordings_of_others_are_refused(tmp_path):
    from mcap.writer import Writer

    for content in (b"\x00\x01", b"{}"):
        path = tmp_path / "other.mcap"
        with open(path, "wb") as file:
            writer = Writer(file)
            writer.start()
            schema = writer.register_schema("a", "jsonschema", b"{}")
            channel = writer.register_channel("/a", "cdr", schema)
            writer.add_message(channel, log_time=0, publish_time=0, data=content)
            writer.finish()
        with pytest.raises(FileError, match=r"other\.mcap is an MCAP file, but no recording"):
            read_recording(path)


def test_truncated_file_gives_what_it_holds(tmp_path):
    path = tmp_path / "run.mcap"
    _write(path, count=6000)
    whole = read_recording(path).signals["/joint_states"]
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 5])
    recording = read_recording(path)
    part = recording.signals["/joint_states"]
    assert not recording.complete
    assert 0 < len(part.time) < len(whole.time)
    np.testing.assert_array_equal(part.values, whole.values[: len(part.time)])


class _OnSmallDisk(io.FileIO):
    """A file on a disk of 0.25 MB, and 1 MB more once the reserve is given back."""

    reserves = ()

    def write(self, data):
        """Write as much as there is room for."""
        room = 250_000 + 1_048_576 * all(one.closed for one in self.reserves) - self.tell()
        if room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(bytes(data)[:room])


def test_full_disk_keeps_what_was_recorded(tmp_path, monkeypatch):
    real_open, real_reserve, reserves = builtins.open, tempfile.TemporaryFile, []

    def on_small_disk(path, mode="r", buffering=-1, **options):
        if (mode, buffering) == ("wb", 0):
            file = _OnSmallDisk(path, mode, opener=options.get("opener"))
            file.reserves = reserves
            return file
        return real_open(path, mode, buffering, **options)

    def reserve(**options):
        reserves.append(real_reserve(**options))
        return reserves[-1]

    path = tmp_path / "run.mcap"
    _write(path, count=3)
    monkeypatch.setattr(builtins, "open", on_small_disk)
    monkeypatch.setattr(tempfile, "TemporaryFile", reserve)
    with pytest.raises(FileError, match="disk is full") as full:
        _write(path, count=20000)
    monkeypatch.undo()
    beside = tmp_path / "run.incomplete.mcap"
    kept = f"is kept in {beside}, and {path} is as it was."
    assert str(full.value).endswith(kept)
    recording = read_recording(beside)
    assert recording.complete
    assert len(recording.signals["/joint_states"].time) > 100
    assert len(read_recording(path).signals["/joint_states"].time) == 3
    assert sorted(os.listdir(tmp_path)) == [beside.name, path.name]


def test_wrong_shapes_and_files_are_refused(tmp_path):
    with McapRecorder(path=tmp_path / "r.mcap", joints=JOINTS) as recorder:
        with pytest.raises(InputError, match="need \\(2, 1\\)"):
            recorder.write_signal("/x", ["a"], [0.0, 1.0], values=[[1.0]])
        with pytest.raises(InputError, match="begun with"):
            recorder.write_signal("/y", ["a"], [0.0], values=[[1.0]])
            recorder.write_signal("/y", ["b"], [0.0], values=[[1.0]])
    (tmp_path / "no.mcap").write_text("nothing")
    with pytest.raises(FileError, match="not an MCAP"):
        read_recording(tmp_path / "no.mcap")
    with pytest.raises(FileError, match="cannot be read"):
        read_recording(tmp_path / "missing.mcap")


@contextmanager
def _no_file_longer_than(size):
    """Neither the reserve nor the recording, as on a disk or quota with so little room."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def _simulate(path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["simulate", str(EXAMPLES / "baxter.toml"), "--duration", "0.15", "--out", str(path)])
    return stop.value.code, *capsys.readouterr()


def test_without_room_for_a_reserve_the_run_is_kept_as_far_as_it_fits(tmp_path, capsys):
    path = tmp_path / "run.mcap"
    with _no_file_longer_than(200_000):  # the whole is some 300 kB
        answer = _simulate(path, capsys)
    kept = "what was recorded until then is kept"
    assert answer == (2, "", f"sealag: {path} is cut off: File too large; {kept}.\n")
    recording = read_recording(path)
    assert not recording.complete
    assert len(recording.signals["/joint_states"].time) > 30
    assert "outcome" not in recording.metadata
    assert os.listdir(tmp_path) == ["run.mcap"]


def test_a_recording_that_cannot_begin_leaves_nothing_behind(tmp_path, capsys):
    path = tmp_path / "run.mcap"
    with _no_file_longer_than(1_000):
        answer = _simulate(path, capsys)
    assert answer == (2, "", f"sealag: {path} cannot be written: File too large.\n")
    assert os.listdir(tmp_path) == []


def test_a_recording_that_fits_needs_no_reserve(tmp_path):
    """Negative control of both: little room, but less to write."""
    path = tmp_path / "run.mcap"
    with _no_file_longer_than(300_000):
        time, _ = _write(path)
    recording = read_recording(path)
    assert recording.complete
    assert len(recording.signals["/joint_states"].time) == len(time)
    assert os.listdir(tmp_path) == ["run.mcap"]


def test_times_are_the_nearest_nanosecond(tmp_path):
    """1.001 s · 1e9 is 1000999999.9999999: cut off it would be a nanosecond early."""
    path, time = tmp_path / "run.mcap", np.array([1.001, 1.0020000004, 8.2009999996])
    with McapRecorder(path=path, joints=JOINTS) as recorder:
        recorder.write_signal("/energy", ["kinetic_j"], time, values=np.zeros((3, 1)))
    with open(path, "rb") as file:
        from mcap.reader import make_reader

        stamps = [message.log_time for _, _, message in make_reader(file).iter_messages()]
    assert stamps == [1_001_000_000, 1_002_000_000, 8_201_000_000]
