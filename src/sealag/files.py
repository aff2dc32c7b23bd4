"""Files: read with a size limit, written under a temporary name and then renamed."""

import errno
import fcntl
import hashlib
import io
import itertools
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import resources
from pathlib import Path
from typing import BinaryIO, Self

from sealag.errors import FileError, SealagError, UnknownNameError, either

_PATIENCE = 10.0  # s that a file that is written at once waits for another writer of it
_POLL = 0.05  # s
_DRAFT = ".sealag-draft"
_LONGEST_NAME = 200  # bytes; file systems allow 255
_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK)
"""How file systems without hard links answer."""


def read_whole(path: Path, *, what: str, largest: int) -> bytes:
    """Read a regular file that has at most a given size.

    Args:
        path: the file.
        what: what messages call it, such as "the project file".
        largest: bytes.

    Raises:
        FileError: it is missing, unreadable, too large, or not a regular file.
    """
    with opened(path, what=what, largest=largest) as file:
        # Not `largest`: Python would make room for all of it before it reads.
        content = file.read(min(os.fstat(file.fileno()).st_size or largest, largest) + 1)
    if len(content) > largest:
        raise _too_large(what, path, largest)
    return content


@contextmanager
def opened(path: Path, *, what: str, largest: int) -> Iterator[BinaryIO]:
    """Open a regular file that has at most a given size, to read it bit by bit.

    Args:
        path: the file.
        what: what messages call it, such as "the project file".
        largest: bytes.

    Raises:
        FileError: it is missing, unreadable, too large, or not a regular file.
    """
    try:
        with open(path, "rb", opener=_without_waiting) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise FileError(f"{what} {path} is not a regular file.")
            if status.st_size > largest:
                raise _too_large(what, path, largest)
            yield file
    except SealagError as error:
        error.at(path)
        raise
    except OSError as error:
        said = f"{what} {path} cannot be read: {error.strerror or error}."
        raise FileError(said).at(path) from error
    except ValueError as error:
        raise FileError(f"{what} {str(path)!r} cannot be read: {error}.") from error


def _without_waiting(name: str, flags: int) -> int:
    """Open a file; a named pipe that nobody writes into is opened too, instead of waited for."""
    return os.open(name, flags | os.O_NONBLOCK)


def _too_large(what: str, path: Path, largest: int) -> FileError:
    return FileError(f"{what} {path} is larger than {largest / 1e6:g} MB.")


def check_output(path: Path, *inputs: Path) -> None:
    """Refuse to overwrite an input, a folder or a device.

    Args:
        path: where a file is to be written; it need not exist.
        inputs: files that the command reads.

    Raises:
        FileError: it is one of the inputs, exists and is not a regular file, or cannot be a file.
    """
    with _told(path):
        target = _target(path)
        if target.exists() and not target.is_file():
            raise FileError(
                f"{path} is not a regular file and is not overwritten; choose another name."
            )
        if target.name.endswith(_DRAFT):
            raise FileError(f"{path} is a name of unfinished files; choose another name.")
        written = [one for one in (target, _draft_of(target)) if one.exists()]
        taken = any(other.exists() and one.samefile(other) for one in written for other in inputs)
    if taken:
        raise FileError(f"{path} is an input and is not overwritten; choose another name.")


def bundled(name: str, *, ending: str, what: str) -> Path:
    """Return the path of a file that ships with sealag.

    Args:
        name: with or without its ending.
        ending: such as ".urdf".
        what: what messages call it.

    Raises:
        UnknownNameError: there is none of this name.
    """
    folder, stem = Path(str(resources.files("sealag.data"))), name.removesuffix(ending)
    known = sorted(found.stem for found in folder.glob(f"*{ending}"))
    if stem not in known:
        raise UnknownNameError(f"No bundled {what} is called {name!r}; there is {either(known)}.")
    return folder / f"{stem}{ending}"


def is_inside(path: Path, folder: Path) -> bool:
    """Whether a path, once `..` is resolved, lies in a folder.

    Args:
        path: the path.
        folder: the folder; links in it are not followed.
    """
    return Path(os.path.normpath(path)).is_relative_to(os.path.normpath(folder))


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


def _target(path: Path) -> Path:
    """Where a draft goes, `..` and links followed.

    Raises:
        FileError: a link leads back to itself.
    """
    target = Path(os.path.realpath(path))
    if any(one.is_symlink() for one in (target, *target.parents)):
        raise FileError(f"{path} is a link that leads back to itself; choose another name.")
    return target


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Let what goes wrong say which file cannot be written; a FileError says so itself."""
    try:
        yield
    except FileError:
        raise
    except OSError as error:
        why = "its folder is a file" if isinstance(error, FileExistsError) else error.strerror
        raise FileError(f"{path} cannot be written: {why or error}.") from error


class Draft:
    """A file under way, hidden beside its target, which stays as it is until `keep`.

    Its name is the target's with a dot before and `.sealag-draft` behind. A lock on it shows that
    its writer lives: a second writer is refused; what a killed one left is taken over. A target
    that is a link stays one, and keeps its mode; a new file has the process's umask.

    Use it as a context manager: what is not kept is dropped.

    Args:
        path: where the file goes; the folder is made if needed.
        patience: how long to wait for another writer, s.

    Attributes:
        asked: where it goes.
        path: the same, links followed.
        file: opened for writing, unbuffered.

    Raises:
        FileError: it cannot be written, or somebody else is writing it.
    """

    def __init__(self, path: Path, *, patience: float = 0.0) -> None:
        self.asked = path
        with _told(path):
            self.path = _target(path)
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._name = _draft_of(self.path)
            last = time.monotonic() + patience
            while True:
                try:
                    self.file = open(self._name, "wb", buffering=0, opener=_claimed)  # noqa: SIM115
                    break
                except BlockingIOError:
                    if time.monotonic() >= last:
                        raise FileError(
                            f"{path} is being written by another process; wait for it, or choose "
                            "another name."
                        ) from None
                    time.sleep(_POLL)

    @classmethod
    def of(cls, path: "Path | Draft", *, patience: float = 0.0) -> "Draft":
        """Return a draft of a file; one that is a draft already is itself.

        Args:
            path: where the file goes, or a draft of it.
            patience: how long to wait for another writer, s.

        Raises:
            FileError: it cannot be written, or somebody else is writing it.
        """
        return path if isinstance(path, Draft) else cls(path, patience=patience)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.drop()

    def keep(self, *, replace: bool = True) -> None:
        """Give the file its name; what had it before is gone.

        Args:
            replace: False to refuse where a file of this name is there already.

        Raises:
            FileError: it cannot be renamed, or the name is taken.
        """
        with _told(self.asked):
            os.fsync(self.file.fileno())
            self._require_mine()
            if replace:
                if self.path.is_file():
                    os.fchmod(self.file.fileno(), stat.S_IMODE(self.path.stat().st_mode))
                os.replace(self._name, self.path)
            elif not _named_new(self._name, self.path):
                raise FileError(f"{self.asked} exists already; choose another name with --out.")
        self.drop()

    def keep_beside(self, word: str) -> Path:
        """Give the file its name if nothing has it, else one with a word and a number in it.

        Args:
            word: what stands before the ending, such as "incomplete".

        Returns:
            Its name.

        Raises:
            FileError: it cannot be named.
        """
        end = self.asked.suffix
        others = (f".{word}{f'-{k}' if k > 1 else ''}{end}" for k in itertools.count(1))
        target = self.asked
        while True:
            with _told(target):
                self._require_mine()
                if _named_new(self._name, _target(target)):
                    break
            target = self.asked.with_suffix(next(others))
        self.drop()
        return target

    def drop(self) -> None:
        """Leave nothing of the draft: of one that is kept, its hidden name is gone already."""
        if not self.file.closed:
            with suppress(FileNotFoundError):
                if self._is_mine():
                    os.unlink(self._name)
            self.file.close()

    def _is_mine(self) -> bool:
        """Whether the hidden name is still this draft's."""
        return os.path.samestat(os.fstat(self.file.fileno()), os.lstat(self._name))

    def _require_mine(self) -> None:
        """Refuse to name another file that somebody has put in the draft's place."""
        if not self._is_mine():
            raise FileError(
                f"{self.asked} cannot be written: somebody has replaced its unfinished file "
                f"{self._name}; leave that alone and try again."
            )


def _draft_of(path: Path) -> Path:
    """Where a file's draft lies; under a short name where the file system would refuse its own."""
    name = path.name
    if len(os.fsencode(name)) > _LONGEST_NAME:
        name = hashlib.sha256(os.fsencode(name)).hexdigest()[:32]
    return path.with_name(f".{name}{_DRAFT}")


def _claimed(name: str, _flags: int) -> int:
    """Open a draft, locked and empty.

    One with another name too, as a writer leaves it that is killed while it gives the name, is a
    whole file: it loses the draft's name and keeps what it holds.

    Raises:
        BlockingIOError: its writer lives.
    """
    while True:
        handle = os.open(name, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                # Meanwhile its writer may have renamed it, and the name is of another file.
                if os.path.samestat(status := os.fstat(handle), os.lstat(name)):
                    if status.st_nlink == 1:
                        os.ftruncate(handle, 0)
                        return handle
                    os.unlink(name)
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _named_new(draft: Path, target: Path) -> bool:
    """Give a draft a name, unless something has it; whether it has it now."""
    try:
        os.link(draft, target)
    except FileExistsError:
        return False
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if os.path.lexists(target):
            return False
        os.rename(draft, target)
    return True


@contextmanager
def written_whole(path: Path | Draft, *, replace: bool = True) -> Iterator[BinaryIO]:
    """Open a file for writing; it gets its name when it is complete.

    Args:
        path: where it goes, or a draft of it; the folder is made if needed. What was there before
            stays until the new file is complete.
        replace: False to refuse where a file of this name is there already.

    Yields:
        A binary file.

    Raises:
        FileError: it cannot be written, or somebody else is writing it.
    """
    with Draft.of(path, patience=_PATIENCE) as draft:
        with _told(draft.asked):
            file = io.BufferedWriter(draft.file)
            yield file
            file.flush()
        draft.keep(replace=replace)


def write_text(path: Path | Draft, text: str, *, replace: bool = True) -> None:
    """Write a text file whole, as UTF-8.

    Args:
        path: where it goes, or a draft of it.
        text: what it holds.
        replace: False to refuse where a file of this name is there already.

    Raises:
        FileError: it cannot be written.
    """
    with written_whole(path, replace=replace) as file:
        file.write(text.encode("utf-8"))


__all__ = [
    "Draft",
    "bundled",
    "check_output",
    "is_inside",
    "make_folder",
    "opened",
    "read_whole",
    "write_text",
    "written_whole",
]
