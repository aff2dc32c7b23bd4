"""A file that can still be closed properly when the disk is full."""

import errno
import os
from pathlib import Path

CHUNK_BYTES = 256 * 1024
"""What a recording keeps in memory before it writes it."""

_RESERVE_BYTES = 4 * CHUNK_BYTES  # for the last chunk and the index


class ReservedFile:
    """A file that keeps room beside it, where there is any, to be closed properly on a full disk.

    Args:
        path: the file, opened for writing.

    Attributes:
        full: whether the reserve was needed.
        failure: why something could not be written; nothing of it is in the file.

    Raises:
        OSError: the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115 - closed by close()
        self._reserve = path.with_name(path.name + ".reserve")
        self.full = False
        self.failure: OSError | None = None
        try:
            with open(self._reserve, "wb") as reserve:
                os.posix_fallocate(reserve.fileno(), 0, _RESERVE_BYTES)
        except OSError:
            self._reserve.unlink(missing_ok=True)

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
            self._reserve.unlink(missing_ok=True)
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

    def close(self) -> None:
        """Close the file and give its reserve back."""
        self._file.close()
        self._reserve.unlink(missing_ok=True)
