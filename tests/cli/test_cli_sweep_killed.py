"""`sealag sweep` that is killed again and again ends with the rows of one that was not."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

from helpers.source import ROOT
from helpers.two_joints import two_joints

pandas = pytest.importorskip("pandas")

KILLS = int(os.environ.get("KILLS", "5"))
"""`make kills` asks for 20."""
POINTS = 8 * KILLS
OVER = ["--over", f"tasks.hand.stiffness=10:400:log{POINTS}", "--ask", "margin"]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": str(ROOT / "src"),
    "PYTHONWARNINGS": "error::UserWarning",
}


def begun(folder, project, name):
    return subprocess.Popen(
        [sys.executable, "-m", "sealag", "sweep", project, *OVER, "--jobs", "2", "--out", name],
        cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # also in the background
    )  # fmt: skip


def parts(folder):
    """What every finished part holds."""
    return {path.name: path.read_bytes() for path in folder.glob("part-*.parquet")}


def until(process, folder, count):
    """Wait until there are so many parts, or the sweep has ended."""
    end = time.monotonic() + 60.0
    while len(parts(folder)) < count and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.slow
def test_a_killed_sweep_goes_on(tmp_path, cli):
    project, folder = two_joints(tmp_path), tmp_path / "killed"
    chance = random.Random(7)
    before, killed = {}, 0
    for _ in range(KILLS):
        process = begun(tmp_path, project, folder)
        until(process, folder, len(before) + chance.randint(1, 8))
        time.sleep(chance.uniform(0.0, 0.1))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += process.returncode == -signal.SIGKILL
        after = parts(folder)
        assert {name: after.get(name) for name in before} == before
        before = after
    assert killed == KILLS
    assert KILLS <= len(before) < POINTS
    process = begun(tmp_path, project, folder)
    text, _ = process.communicate()
    assert process.returncode == 0
    assert f"points                     {POINTS}, {POINTS - len(before)} of them" in text.decode()
    assert {name: parts(folder)[name] for name in before} == before
    rows = pandas.read_parquet(folder)
    assert rows["point"].tolist() == list(range(POINTS))
    assert cli("sweep", project, *OVER, "--jobs", 1, "--out", tmp_path / "whole")[0] == 0
    pandas.testing.assert_frame_equal(
        rows, pandas.read_parquet(tmp_path / "whole"), check_exact=True
    )
    assert parts(folder) == parts(tmp_path / "whole")


def test_a_sweep_that_is_killed_while_it_writes_goes_on(tmp_path, cli):
    """With half a file under way: first what the folder says of itself, then a part."""
    project, folder = two_joints(tmp_path), tmp_path / "killed"
    over = ["--over", "tasks.hand.stiffness=10:400:log6", "--ask", "bound", "--jobs", "1"]
    dying = (
        "import os, signal, sys\n"
        "from sealag.cli import main\n"
        "left, sync = [int(sys.argv[1])], os.fsync\n"
        "def half(file):\n"
        "    left[0] -= 1\n"
        "    if left[0]:\n"
        "        return sync(file)\n"
        "    os.ftruncate(file, os.fstat(file).st_size // 2)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "os.fsync = half\n"
        "main(sys.argv[2:])\n"
    )
    finished = {}
    for writes in (1, 4):
        command = [sys.executable, "-c", dying, str(writes), "sweep", project, *over]
        done = subprocess.run([*command, "--out", folder], env=ENVIRONMENT, check=False)
        assert done.returncode == -signal.SIGKILL
        assert len(list(folder.glob(".*.sealag-draft"))) == 1
        assert len(parts(folder)) == max(writes - 2, 0)
        finished = parts(folder)
    code, text, error = cli("sweep", project, *over, "--out", folder)
    assert (code, error) == (0, "")
    assert f"points                     6, {6 - len(finished)} of them" in text
    assert cli("sweep", project, *over, "--out", tmp_path / "whole")[0] == 0
    assert parts(folder) == parts(tmp_path / "whole")
    assert not list(folder.glob(".*"))


@pytest.mark.slow
def test_ctrl_c_leaves_what_is_finished(tmp_path):
    project, folder = two_joints(tmp_path), tmp_path / "stopped"
    process = begun(tmp_path, project, folder)
    until(process, folder, 4)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert b"interrupted" in error
    assert b"Traceback" not in error
    left = parts(folder)
    assert 4 <= len(left) < POINTS
    process = begun(tmp_path, project, folder)
    assert process.wait(timeout=120.0) == 0
    assert {name: parts(folder)[name] for name in left} == left
    assert len(pandas.read_parquet(folder)) == POINTS
