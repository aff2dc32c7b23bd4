"""Long arrays lie in the temporary folder: in little memory, refused before they do not fit."""

import errno
import os
import subprocess
import sys
import tempfile

import numpy as np
import pytest

from sealag.errors import InputError
from sealag.store import Store, blocks, release

PLACE = {"what": "The log", "remedy": "log less often"}


def test_blocks_hold_each_row_once():
    for rows in (0, 1, 7, 8, 9, 16):
        found = [row for block in blocks(rows, 8) for row in range(rows)[block]]
        assert found == list(range(rows))


@pytest.mark.parametrize("on_disk", [False, True])
def test_what_is_written_stays_when_memory_is_given_back(on_disk):
    array = Store(on_disk=on_disk).zeros((50, 3))
    assert not array.any()
    array[:] = np.arange(150.0).reshape(50, 3)
    part = array[10:20, 1]
    release(array, part, None, "no array")
    np.testing.assert_array_equal(array, np.arange(150.0).reshape(50, 3))
    np.testing.assert_array_equal(part, np.arange(31.0, 61.0, 3.0))


def test_small_arrays_need_no_disk(monkeypatch):
    monkeypatch.setattr(tempfile, "gettempdir", lambda: pytest.fail("asked for a folder"))
    assert not Store.of(1000, 10, **PLACE).on_disk
    assert Store(on_disk=True).zeros((0, 4)).shape == (0, 4)


def test_what_does_not_fit_is_refused_before_it_begins():
    with pytest.raises(InputError, match=r"The log of 1e\+12 instants needs .* GB .*; log less .*"):
        Store.of(10**12, 100, **PLACE)


def test_no_temporary_folder_is_told(monkeypatch):
    def missing():
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found")

    monkeypatch.setattr(tempfile, "gettempdir", missing)
    with pytest.raises(InputError, match="TMPDIR"):
        Store.of(10**7, 100, **PLACE)


def test_a_full_disk_is_told_and_crashes_nothing(monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(InputError, match="No space left on device; log less often"):
        Store(on_disk=True, remedy="log less often").zeros((10, 10))


_FILL = """
import sys
from sealag.store import Store, blocks, release
def peak():
    lines = open("/proc/self/status").read().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("VmHWM"))) / 1e3
array, before = Store(on_disk=True).zeros((40_000, 1000)), peak()
for rows in blocks(len(array)):
    array[rows] = 1.0
    if sys.argv[1] == "release":
        release(array)
print(peak() - before, array[::4000, 7].sum())
"""


@pytest.mark.parametrize(("mode", "least", "most"), [("release", 0, 120), ("keep", 300, 400)])
def test_320_mb_are_written_in_little_memory(mode, least, most):
    """The second case is the control: memory that is not given back is seen."""
    told = subprocess.run(
        [sys.executable, "-c", _FILL, mode], capture_output=True, text=True, check=True
    )
    grown, total = map(float, told.stdout.split())
    assert least <= grown <= most, f"{grown} MB"
    assert total == 10.0
