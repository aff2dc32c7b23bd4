"""Where the arrays of a run lie: in memory while they are small, else in the temporary folder."""

import mmap
import os
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array

LARGEST_IN_MEMORY = 64_000_000  # bytes
_BLOCK = 4096  # rows


@dataclass(frozen=True, slots=True)
class Store:
    """Allocates the arrays of a run.

    An array on disk is the map of a file without a name, which ends with the array. Its room is
    taken at once: a disk that fills up later would crash the process.

    Attributes:
        on_disk: Whether arrays are files.
    """

    on_disk: bool

    @classmethod
    def of(cls, rows: int, numbers: int) -> "Store":
        """Return the store of a log.

        Args:
            rows: How many instants there will be at most.
            numbers: How many numbers each has.

        Raises:
            InputError: It would not fit.
        """
        size = 8 * rows * numbers
        if size <= LARGEST_IN_MEMORY:
            return cls(on_disk=False)
        try:
            folder = tempfile.gettempdir()
            free = shutil.disk_usage(folder).free
        except OSError as error:
            raise InputError(
                f"The run would record {rows:.4g} instants in {size / 1e9:.4g} GB, which are kept "
                f"in a temporary folder, and there is none: {error}. Set TMPDIR."
            ) from error
        if size > free:
            raise InputError(
                f"The run would record {rows:.4g} instants in {size / 1e9:.4g} GB, more than the "
                f"{free / 1e9:.4g} GB that are free in {folder}; log less often "
                "(simulation.log_period_ms, --log-ms), simulate for a shorter time, or set TMPDIR "
                "to a folder with more room."
            )
        return cls(on_disk=True)

    def zeros(self, shape: int | tuple[int, ...], dtype: type = float) -> Array:
        """Return an array of zeros, as numpy does.

        Args:
            shape: Its shape.
            dtype: Type of its numbers.

        Raises:
            InputError: The disk is full.
        """
        size = np.dtype(dtype).itemsize * int(np.prod(shape))
        if not (self.on_disk and size):
            return np.zeros(shape, dtype)
        try:
            with tempfile.TemporaryFile() as file:
                if hasattr(os, "posix_fallocate"):
                    os.posix_fallocate(file.fileno(), 0, size)
                else:
                    file.truncate(size)
                pages = mmap.mmap(file.fileno(), size)
        except OSError as error:
            raise InputError(
                f"The run's log needs {size / 1e9:.4g} GB more in {tempfile.gettempdir()}: "
                f"{error.strerror}; make room, log less often, or set TMPDIR."
            ) from error
        return np.frombuffer(pages, dtype).reshape(shape)


def release(*arrays: Any) -> None:
    """Give back the memory of arrays that lie on disk; what they hold stays.

    Args:
        arrays: Arrays or views of them; those in memory are left alone.
    """
    for array in arrays:
        base = array
        while isinstance(base, np.ndarray):
            base = base.base
        if isinstance(base, memoryview):
            base = base.obj
        if isinstance(base, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
            base.madvise(mmap.MADV_DONTNEED)


def blocks(rows: int, size: int = _BLOCK) -> Iterator[slice]:
    """Go through rows block by block.

    Args:
        rows: How many there are.
        size: Rows of a block.
    """
    for first in range(0, rows, size):
        yield slice(first, min(first + size, rows))
