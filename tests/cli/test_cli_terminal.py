"""Streams that are closed, names that are orders, failures of the tool itself."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.designs import EXAMPLES
from sealag.cli import main

CASE = EXAMPLES.parent / "tests" / "data" / "cases" / "s7_static_joint_gravity.toml"
ANYWHERE = CASE.read_text().replace('urdf="one.urdf"', f'urdf="{CASE.parent}/one.urdf"')
"""The case with its robot's whole path, for a project file in any folder."""


def closed(streams, *words, folder):
    """Exit status and standard error of the command with streams closed, as a shell closes them."""
    command = f'exec "{sys.executable}" -m sealag "$@" {streams}'
    done = subprocess.run(
        ["sh", "-c", command, "sealag", *map(str, words)],
        capture_output=True, cwd=folder, timeout=120, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr.decode()


@pytest.mark.parametrize(
    ("streams", "status"), [("<&-", 0), ("2>&-", 0), (">&-", 2), ("<&- >&- 2>&-", 2)]
)
def test_closed_streams_change_no_verdict_and_no_file(streams, status, tmp_path):
    """A file must not get the number of a closed stream: what is printed would land in it."""
    whole = tmp_path / "whole.json"
    assert closed("", "certify", CASE, "--out", whole, folder=tmp_path) == (0, "")
    out = tmp_path / "c.json"
    code, err = closed(streams, "certify", CASE, "--out", out, folder=tmp_path)
    assert code == status
    assert out.read_bytes() == whole.read_bytes()
    if streams == ">&-":
        assert err == "sealag: standard output is closed; nobody can read the answer\n"
    code, err = closed(streams, "certify", tmp_path / "none.toml", folder=tmp_path)
    assert code == 2


@pytest.mark.parametrize("name", ["\x1b[2Jx", "a\nb", "\u202egnp.exe", "\x9bm", "\u2028"])
def test_names_reach_the_terminal_as_text(name, tmp_path, cli):
    """Of files, frames and joints, in messages and in answers."""
    orders = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")
    path = tmp_path / f"{name}.toml"
    _, _, err = cli("certify", path)
    assert err.count("\n") == 1
    assert not orders.search(err)
    spelled = "".join(f"\\u{ord(c):04x}" if not c.isprintable() else c for c in name)
    path.write_text(ANYWHERE.replace('name="t"', f'name="t"\nframe="{spelled}"'))
    code, _, err = cli("certify", path)
    assert code == 2
    assert err.count("\n") == 1
    assert not orders.search(err)
    path.write_text(ANYWHERE)
    code, text, _ = cli("certify", path, "--out", tmp_path / f"{name}.json")
    assert code == 0
    assert not orders.search(text)


def test_bytes_that_are_no_text_are_written_out_or_refused(tmp_path, cli):
    """A path of any bytes: JSON has no half of a surrogate pair for them, TOML no letter."""
    strange = Path(os.fsdecode(os.fsencode(tmp_path) + b"/b\xffd"))
    project = strange.with_suffix(".toml")
    project.write_text(ANYWHERE)
    out = strange.with_suffix(".mcap")
    code, text, _ = cli("simulate", project, "--duration", "0.002", "--out", out, "--json")
    assert code == 0
    assert json.loads(text)["recording"] == f"{tmp_path}/b\\udcffd.mcap"
    urdf = strange.with_suffix(".urdf")
    urdf.write_bytes((CASE.parent / "one.urdf").read_bytes())
    code, _, err = cli("init", urdf, "--base", "fixed", "--out", tmp_path / "p.toml")
    assert (code, err.count("\n")) == (2, 1)
    assert "no UTF-8" in err
    assert not (tmp_path / "p.toml").exists()


def test_letters_that_a_stream_lacks_are_written_out(tmp_path):
    path = tmp_path / "g\u00e9nou.toml"
    path.write_text(ANYWHERE)
    done = subprocess.run(
        [sys.executable, "-m", "sealag", "certify", str(path)],
        capture_output=True, cwd=tmp_path, timeout=120, check=False,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert b"g\\xe9nou.certificate.json" in done.stdout


def test_names_that_look_alike_are_told_apart(tmp_path, cli):
    robot = tmp_path / "r.urdf"
    robot.write_text((CASE.parent / "one.urdf").read_text().replace('"j"', '"ge\u0301nou"'))
    path = tmp_path / "p.toml"
    text = CASE.read_text().replace("one.urdf", "r.urdf").replace("j=", '"g\u00e9nou"=')
    path.write_text(text)
    code, _, err = cli("certify", path)
    assert code == 2
    assert "only look alike" in err
    assert "'ge\\u0301nou'" in err
    path.write_text(text.replace("g\u00e9nou", "ge\u0301nou"))
    assert cli("certify", path, "--out", tmp_path / "c.json")[0] == 0


@pytest.mark.parametrize("urdf", ["bundled:../hume.urdf", "bundled:/etc/passwd",
    "example-robot-data:../../../../../../etc/passwd", "~nosuch/robot.urdf"])  # fmt: skip
def test_names_of_robots_stay_in_their_folders(urdf, tmp_path, cli):
    code, _, err = cli("init", urdf, "--out", tmp_path / "p.toml")
    assert code == 2
    assert err.count("\n") == 1
    assert "root:" not in err
    assert not (tmp_path / "p.toml").exists()


@pytest.mark.parametrize("project", ["bundled:../hume", "bundled:/etc/passwd", "/etc/passwd"])
def test_names_of_projects_stay_in_their_folders(project, cli):
    code, _, err = cli("certify", project)
    assert code == 2
    assert "root:" not in err


def test_samples_that_are_none_are_not_quoted(tmp_path, cli):
    """A project may name any file: its lines are shown to nobody."""
    (tmp_path / "one.urdf").write_bytes((CASE.parent / "one.urdf").read_bytes())
    (tmp_path / "secret").write_text("password: 1234\n")
    text = CASE.read_text().replace(
        'central_round_trip={kind="constant",value_ms=1.0}',
        'central_round_trip={kind="samples",file="secret",period_s=0.01}',
    )
    (tmp_path / "p.toml").write_text(text)
    code, _, err = cli("certify", tmp_path / "p.toml")
    assert code == 2
    assert "line 1 is no number" in err
    assert "password" not in err


def test_a_failure_of_the_tool_is_status_3_and_leaves_a_report(monkeypatch, capsys, tmp_path):
    def broken(*_arguments, **_options):
        raise ZeroDivisionError("deep inside")

    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr("sealag.design.certify", broken)
    with pytest.raises(SystemExit) as stop:
        main(["certify", str(CASE), "--out", str(tmp_path / "c.json")])
    out, err = capsys.readouterr()
    assert (stop.value.code, out, err.count("\n")) == (3, "", 1)
    assert "no answer about the design" in err
    (report,) = Path(tmp_path).glob("sealag-failure-*.txt")
    assert str(report) in err
    words = report.read_text()
    assert "ZeroDivisionError: deep inside" in words
    assert f"command: sealag certify {CASE}" in words
    assert not (tmp_path / "c.json").exists()


def test_without_a_cache_kernels_are_compiled_and_it_is_said_once():
    program = """
import numba.core.caching as caching
caching.CompileResultCacheImpl._locator_classes = []
from sealag.kernels import compiled, walking
assert compiled()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("set NUMBA_CACHE_DIR") == 1


def test_kernels_that_may_not_be_compiled_are_named(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "sealag", "certify", str(CASE), "--out", str(tmp_path / "c.json")],
        capture_output=True, text=True, timeout=120, check=False,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 2
    assert "NUMBA_DISABLE_JIT" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_log_says_that_a_long_motion_takes_long(tmp_path, cli):
    """Where no spinner turns, and only there."""
    files = ("--motion", tmp_path / "m.csv", "--out", tmp_path / "c.json")
    for count, words in ((60, ""), (20_000, "certifying 20000 instants: up to 10 min")):
        rows = "\n".join(f"{1e-3 * k},0.1" for k in range(count))
        (tmp_path / "m.csv").write_text(f"time_s,j\n{rows}\n")
        err = cli("certify", CASE, "--criterion", "published", *files)[2]
        assert words in err
        assert bool(err) == bool(words)
