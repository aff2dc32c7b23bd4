"""Outputs of commands that meet: none is lost, mixed or half."""

import shutil
import signal
import subprocess
import sys
import time

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
        f"sealag: {out} is being written by another process; wait for it, or choose another "
        "--out.\n"
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
    )  # fmt: skip
    draft, end = tmp_path / ".run.mcap.sealag-draft", time.monotonic() + 60.0
    while not draft.exists() and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(4.0)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
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
