"""Writing files whole: under a temporary name, then renamed."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from sealag.errors import FileError


@contextmanager
def written_whole(path: Path) -> Iterator[BinaryIO]:
    """Open a file for writing that appears under its name only once it is complete.

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
