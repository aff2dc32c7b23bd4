"""Errors under --json: one JSON object on standard output that names kind, file and key."""

import json
import subprocess
import sys

import pytest

from helpers.designs import EXAMPLES
from sealag.errors import SolverError

HELD = str(EXAMPLES / "hume_held.toml")


def told(cli, *arguments):
    code, out, err = cli(*arguments, "--json")
    answer = json.loads(out)
    assert set(answer) == {"status", "error"}
    assert answer["status"] == "error"
    assert set(answer["error"]) == {"kind", "file", "key", "message"}
    assert err == f"sealag: {answer['error']['message']}\n"
    return code, answer["error"]


def changed(tmp_path, old, new):
    text = (EXAMPLES / "hume_held.toml").read_text()
    assert old in text
    path = tmp_path / "p.toml"
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("[delays]", "[dealys]", "delays"),
        ("[[tasks]]", "[[tasks]]\nwidth = 1.0", "tasks['right foot'].width"),
        ("right_hip = -0.43633", "elbow = 1.0", "posture.joints"),
        ("stiffness = 50.0", "stiffness = -50.0", "tasks['right foot'].stiffness"),
    ],
)
def test_a_wrong_key_is_named_with_its_file(tmp_path, cli, old, new, key):
    path = changed(tmp_path, old, new)
    code, error = told(cli, "margin", path)
    assert (code, error["kind"], error["file"]) == (2, "ProjectError", str(path))
    assert error["key"] == key


def test_missing_files_are_named(tmp_path, cli):
    code, error = told(cli, "certify", tmp_path / "none.toml")
    assert (code, error["kind"], error["file"]) == (2, "FileError", str(tmp_path / "none.toml"))
    code, error = told(cli, "certify", HELD, "--motion", tmp_path / "none.csv")
    assert (code, error["kind"], error["file"]) == (2, "FileError", str(tmp_path / "none.csv"))


def test_wrong_command_lines_are_objects_too(cli):
    for words in (["frobnicate"], ["certify"], ["certify", HELD, "--nope"]):
        code, error = told(cli, *words)
        assert (code, error["kind"], error["file"]) == (2, "UsageError", None)


def test_failures_of_the_tool_keep_their_status(cli, monkeypatch):
    for problem, kind in ((SolverError("no"), "SolverError"), (KeyError("J"), "ToolFailure")):

        def fails(*_arguments, problem=problem, **_options):
            raise problem

        monkeypatch.setattr("sealag.design.load", fails)
        code, error = told(cli, "margin", HELD)
        assert (code, error["kind"]) == (3, kind)


def test_without_json_standard_output_stays_empty(cli):
    code, out, _ = cli("certify", "none.toml")
    assert (code, out) == (2, "")


def test_a_full_disk_takes_no_object_and_keeps_the_status():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "sealag", "certify", "none.toml", "--json"],
            stdout=full, stderr=subprocess.PIPE, timeout=120, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1
