"""Workers of the study end with the process that asked, also when it is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from helpers.source import ROOT

_ASK = """
import os, sys, time
from pathlib import Path
from sealag.workers import in_parallel
from workers import work, plainly
if __name__ == "__main__":
    folder, way = sys.argv[1:]
    cases = [(folder,), (folder,)]
    list(in_parallel(work, cases, jobs=2)) if way == "watched" else plainly(cases)
"""
_WORK = """
import os, time
from pathlib import Path

def work(folder):
    Path(folder, str(os.getpid())).touch()
    time.sleep(20.0)

def plainly(cases):
    from joblib import Parallel, delayed
    Parallel(n_jobs=2)(delayed(work)(*case) for case in cases)
"""


def _alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def _within(seconds: float, condition) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.1)
    return False


@pytest.mark.parametrize(("way", "left"), [("watched", 0), ("plain", 2)])
def test_a_killed_parent_leaves_no_workers(tmp_path, way, left):
    """The second way is the control: without the watch they live on."""
    (tmp_path / "ask.py").write_text(_ASK)
    (tmp_path / "workers.py").write_text(_WORK)
    pids = tmp_path / "pids"
    pids.mkdir()
    path = os.pathsep.join([str(tmp_path), str(ROOT / "src"), str(ROOT / "studies")])
    parent = subprocess.Popen(
        [sys.executable, tmp_path / "ask.py", pids, way],
        env={**os.environ, "PYTHONPATH": path}, cwd=tmp_path, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        assert _within(60.0, lambda: len(os.listdir(pids)) == 2)
    finally:
        parent.kill()
        parent.wait()
    workers = [int(name) for name in os.listdir(pids)]
    ended = _within(10.0 if left == 0 else 3.0, lambda: not any(map(_alive, workers)))
    assert ended == (left == 0)
    for pid in filter(_alive, workers):
        os.kill(pid, signal.SIGKILL)
