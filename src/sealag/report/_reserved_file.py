"""A file that can still be closed properly when the disk is full."""

import errno
import os
import tempfile
from io import FileIO
from pathlib import Path

CHUNK_BYTES = 256 * 1024
"""What a recording keeps in memory before it writes it."""

_RESERVE_BYTES = 4 * CHUNK_BYTES  # for the last chunk and the index


class ReservedFile:
    """A file that keeps room, where there is any, to be finished properly on a full disk.

    The room is a file without a name: nothing of it is left if the process is killed.

    Args:
        file: the file, opened for writing, unbuffered; whoever opened it closes it.
        folder: where it lies.

    Attributes:
        full: whether the reserve was needed.
        failure: why something could not be written; nothing of it is in the file.

    Raises:
        OSError: no file can be made in the folder.
    """

    def __init__(self, file: FileIO, folder: Path) -> None:
        self._file, self._reserve = file, tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        self.full = False
        self.failure: OSError | None = None
        try:
            os.posix_fallocate(self._reserve.fileno(), 0, _RESERVE_BYTES)
        except OSError:
            self.release()

    def write(self, data: bytes) -> int:
        """Write all of it, on a full disk where the reserve was; return how many bytes.

        Args:
            data: the bytes.

        Raises:
            OSError: it cannot be written as a whole.
        """
        start = self._file.tell()
        try:
            self._write_all(data)
        except OSError as error:
            self._file.seek(start)
            self._file.truncate()
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) or self.full:
                self.failure = error
                raise
            self.full = True
            self.release()
            self.write(data)
        return len(data)

    def _write_all(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]

    def tell(self) -> int:
        """Return how many bytes the file has."""
        return self._file.tell()

    def flush(self) -> None:
        """Do nothing that the operating system does not do anyway."""
        self._file.flush()

    def release(self) -> None:
        """Give the room back."""
        self._reserve.close()
