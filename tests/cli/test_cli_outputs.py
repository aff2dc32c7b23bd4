"""Outputs of commands that meet: none is lost, mixed or half."""

import json
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.files import Draft
from sealag.report import read_recording

ONE_JOINT = "example-robot-data:panda_description/urdf/panda.urdf"


@pytest.mark.parametrize("command", ["certify", "simulate"])
def test_a_second_command_on_one_output_is_refused_before_it_computes(command, tmp_path, cli):
    project, out = tmp_path / "baxter.toml", tmp_path / "out"
    shutil.copy(EXAMPLES / "baxter.toml", project)
    out.write_bytes(b"before")
    arguments = (command, project, "--out", out)
    with Draft(out) as first:
        code, text, err = cli(*arguments)
        first.file.write(b"first")
        first.keep()
    assert (code, text) == (2, "")
    assert err == (
        f"sealag: {out} is being written by another process; wait for it, or choose another name.\n"
    )
    assert out.read_bytes() == b"first"


def test_an_interrupted_run_stands_beside_the_whole_one(tmp_path, cli):
    out, beside = tmp_path / "run.mcap", tmp_path / "run.incomplete.mcap"
    words = ("simulate", str(EXAMPLES / "baxter.toml"), "--out", str(out), "--duration")
    assert cli(*words, "0.05")[0] == 0
    whole = out.read_bytes()
    process = subprocess.Popen(
        [sys.executable, "-m", "sealag", *words, "600"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # also in the background
    )  # fmt: skip
    draft, end = tmp_path / ".run.mcap.sealag-draft", time.monotonic() + 60.0
    try:
        while not draft.exists() and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(4.0)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130
    assert f"recorded in {beside}; {out} is as it was" in err
    assert out.read_bytes() == whole
    assert read_recording(beside).metadata["outcome"] == "interrupted"
    assert sorted(path.name for path in tmp_path.iterdir()) == [beside.name, out.name]


def test_two_starters_at_once_make_one(tmp_path):
    out = tmp_path / "p.toml"
    words = [sys.executable, "-m", "sealag", "init", ONE_JOINT, "--out", str(out)]
    both = [subprocess.Popen(words, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    errors = [one.communicate(timeout=120)[1] for one in both]
    assert sorted(one.returncode for one in both) == [0, 2]
    assert any("exists already" in err or "being written" in err for err in errors)
    assert [path.name for path in tmp_path.iterdir()] == ["p.toml"]


def test_a_longer_log_period_leaves_rows_out_and_changes_none(tmp_path, cli):
    found = []
    for period in (None, "20"):
        out = tmp_path / f"{period}.mcap"
        options = () if period is None else ("--log-ms", period)
        words = ("--duration", "0.2", "--scenario", "track", *options, "--json", "--out", out)
        code, text, _ = cli("simulate", EXAMPLES / "anymal.toml", *words)
        assert code == 0
        found.append((json.loads(text), read_recording(out).signals["/joint_states"]))
    (every, rows), (seldom, few) = found
    assert (len(rows.time), len(few.time)) == (81, 11)
    np.testing.assert_array_equal(few.values, rows.values[::8])
    assert seldom["energy_throughput_j"] == every["energy_throughput_j"]
    assert seldom["joint_side_passive"] == every["joint_side_passive"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--duration", "1e6"), "log less often (simulation.log_period_ms, --log-ms)"),
        (("--log-ms", "-1"), "--log-ms is -1; it must be more than 0"),
        (("--log-ms", "3.3"), "must be a whole multiple of the physics step"),
    ],
)
def test_logs_that_cannot_be_are_refused(options, words, tmp_path, cli):
    out = tmp_path / "r.mcap"
    code, text, err = cli("simulate", EXAMPLES / "anymal.toml", *options, "--out", out)
    assert (code, text) == (2, "")
    assert words in err
    assert not out.exists()
