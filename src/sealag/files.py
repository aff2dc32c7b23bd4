"""Files: read with a size limit, written under a temporary name and then renamed."""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from sealag.errors import FileError


def read_whole(path: Path, *, what: str, largest: int) -> bytes:
    """Read a regular file that has at most a given size.

    Args:
        path: the file.
        what: what messages call it, such as "the project file".
        largest: bytes.

    Raises:
        FileError: it is missing, unreadable, too large, or not a regular file.
    """
    try:
        with open(path, "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise FileError(f"{what} {path} is not a regular file.")
            # Not `largest`: Python would make room for all of it before it reads.
            content = file.read(min(status.st_size or largest, largest) + 1)
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{what} {path} cannot be read: {error.strerror or error}.") from error
    except ValueError as error:
        raise FileError(f"{what} {str(path)!r} cannot be read: {error}.") from error
    if len(content) > largest:
        raise FileError(f"{what} {path} is larger than {largest / 1e6:g} MB.")
    return content


def check_output(path: Path, *inputs: Path) -> None:
    """Refuse to overwrite an input, a folder or a device.

    Args:
        path: where a file is to be written; it need not exist.
        inputs: files that the command reads.

    Raises:
        FileError: it is one of the inputs, or exists and is not a regular file.
    """
    if not path.exists():
        return
    if not path.is_file():
        raise FileError(
            f"{path} is not a regular file and is not overwritten; choose another --out."
        )
    for other in inputs:
        if other.exists() and path.samefile(other):
            raise FileError(f"{path} is an input and is not overwritten; choose another --out.")


def make_folder(path: Path) -> None:
    """Make a folder with those above it, if it is not there.

    Args:
        path: the folder.

    Raises:
        FileError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder {path} cannot be made: {error.strerror or error}.") from error


@contextmanager
def written_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a file for writing; it gets its name when it is complete.

    Args:
        path: where it goes; the folder is made if needed. What was there before stays until the
            new file is complete.

    Yields:
        A binary file.

    Raises:
        FileError: it cannot be written.
    """
    name = ""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            yield file
        os.chmod(name, 0o644)
        os.replace(name, path)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}.") from error
    finally:
        if name and os.path.exists(name):
            os.unlink(name)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole, as UTF-8.

    Args:
        path: where it goes.
        text: what it holds.

    Raises:
        FileError: it cannot be written.
    """
    with written_whole(path) as file:
        file.write(text.encode("utf-8"))


__all__ = [
    "check_output",
    "make_folder",
    "read_whole",
    "write_text",
    "written_whole",
]
