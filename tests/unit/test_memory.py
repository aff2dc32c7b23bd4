"""Resident memory over an hour of ticks, from 10,000 of them, C++ included."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
FLAT = 16e6
"""Bytes an hour of a 1 kHz controller: 11 pages of 4 KiB in the 10,000 ticks that are measured."""


def _in_an_hour(subject):
    paths = [str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-m", "helpers.memory", subject],
        capture_output=True, text=True, check=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
    )  # fmt: skip
    return float(done.stdout)


def test_whole_body_controller_stays_flat():
    """ANYmal with q̄(θ) and the tank, which does all that the other signals do."""
    assert _in_an_hour("anymal") < FLAT


def test_walking_controller_stays_flat():
    """Through some thirty steps."""
    assert _in_an_hour("hume") < FLAT


def test_a_leak_outside_python_shows():
    """Negative control: 64 bytes a tick are 230 MB an hour."""
    assert _in_an_hour("leaking") > 3 * FLAT
