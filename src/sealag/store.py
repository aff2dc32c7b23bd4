"""Where long arrays lie: in memory while they are small, else in the temporary folder."""

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
BLOCK = 4096  # rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """Allocates arrays of one length.

    An array on disk is the map of a file without a name, which ends with the array. Its room is
    taken at once: a disk that fills up later would crash the process.

    Attributes:
        on_disk: Whether arrays are files.
        remedy: What messages advise where there is no room.
    """

    on_disk: bool
    remedy: str = ""

    @classmethod
    def of(cls, rows: int, numbers: int, *, what: str, remedy: str) -> "Store":
        """Return the store of arrays.

        Args:
            rows: How many rows they have at most.
            numbers: How many numbers a row has in all of them.
            what: What messages call them, such as "The run's log".
            remedy: What to do where there is no room for them.

        Raises:
            InputError: They would not fit.
        """
        size = 8 * rows * numbers
        if size <= LARGEST_IN_MEMORY:
            return cls(on_disk=False)
        need = f"{what} of {rows:.4g} instants needs {size / 1e9:.3g} GB in a temporary folder"
        try:
            folder = tempfile.gettempdir()
            free = shutil.disk_usage(folder).free
        except OSError as error:
            raise InputError(f"{need}, and there is none: {error}. Set TMPDIR.") from error
        if size > free:
            raise InputError(
                f"{need}, but {free / 1e9:.3g} GB are free in {folder}; {remedy}, or set TMPDIR to "
                "a folder with more room."
            )
        return cls(on_disk=True, remedy=remedy)

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
                f"{size / 1e9:.3g} GB more are needed in {tempfile.gettempdir()}: "
                f"{error.strerror}; {self.remedy}, or set TMPDIR to a folder with more room."
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


def blocks(rows: int, size: int | None = None) -> Iterator[slice]:
    """Go through rows block by block.

    Args:
        rows: How many there are.
        size: Rows of a block; BLOCK if None.
    """
    size = BLOCK if size is None else size
    for first in range(0, rows, size):
        yield slice(first, min(first + size, rows))
