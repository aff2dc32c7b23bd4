"""What a worker does: build each design of a block from the project's text, and ask it."""

import hashlib
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from sealag.design import System, load
from sealag.errors import FileError, SealagError
from sealag.robot import Motion
from sealag.sweep._axis import Value
from sealag.sweep._key import Key
from sealag.sweep._question import Question, ToDelays
from sealag.toml import text_of

POINT, KIND, ERROR = "point", "error_kind", "error"
"""Columns of every sweep: the number, and why there is no answer."""
FAILURE = "ToolFailure"
"""Kind of a point at which the tool itself failed: no answer about the design."""
_LONGEST_ERROR = 2000  # letters
_NOT_OF_MOTIONS = frozenset({"actuators", "controller", "delays", "simulation", "tasks"})
"""Tables of a project that say nothing of robot, contacts and posture, by which a motion's file is
read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What all workers know.

    Attributes:
        path: the project file, absolute.
        text: what it says.
        keys: what is swept.
        question: what every point is asked.
        motion: a motion's file, absolute; None for the project's own.
        digests: SHA-256 of every file that an answer depends on, by its absolute path.
    """

    path: Path
    text: str
    keys: tuple[Key, ...]
    question: Question
    motion: Path | None
    digests: dict[str, str]

    def require_same_files(self) -> None:
        """Refuse to go on with other files.

        Raises:
            FileError: a file is not what it was when the sweep began.
        """
        for name, known in self.digests.items():
            if digest_of(Path(name)) != known:
                raise FileError(
                    f"{name} is not here what it was when the sweep began; sweep again into "
                    "another --out, and let workers of a cluster see the same files."
                ).at(name)


class Bench:
    """A worker's place of work: what one point leaves to the next, so that it is computed once.

    That is the file as it was parsed, the robot, the motion, and what an answer rests on besides
    the delays.
    """

    def __init__(self, job: Job) -> None:
        """Parse the project file.

        Args:
            job: what all workers know.

        Raises:
            InputError: a key leads nowhere.
        """
        import tomlkit

        self.job = job
        self._document = tomlkit.parse(job.text)
        self._places = [key.place(self._document) for key in job.keys]
        self._before: System | None = None
        self._motion: tuple[tuple[Value, ...], Motion] | None = None
        self._found: tuple[tuple[Any, ...], ToDelays] | None = None

    def system(self, values: Sequence[Value]) -> System:
        """Return the design with other values.

        Args:
            values: of each key.

        Raises:
            SealagError: the project does not take them.
        """
        for key, place, value in zip(self.job.keys, self._places, values, strict=True):
            key.put(self._document, place, value)
        text = text_of(
            self._document,
            refusal=f"{', '.join(key.text for key in self.job.keys)}: dotted keys of the file "
            "cannot be extended; give the table a header of its own, [table.name].",
        )
        self._before = load(self.job.path, text=text, beside=self._before)
        return self._before

    def rows(self, first: int, points: Sequence[tuple[Value, ...]]) -> list[dict[str, Any]]:
        """Ask a block of points.

        Args:
            first: number of the first.
            points: values of each key.

        Returns:
            A row of each: number, values by key, and the answer, or what refused it.

        Raises:
            FileError: a file is not what it was when the sweep began.
        """
        self.job.require_same_files()
        with threadpool_limits(1):  # sums of several threads differ in their last bits
            return [self._row(first + i, values) for i, values in enumerate(points)]

    def _row(self, number: int, values: tuple[Value, ...]) -> dict[str, Any]:
        row: dict[str, Any] = {POINT: number}
        row |= {key.text: value for key, value in zip(self.job.keys, values)}
        try:
            return row | self._answer(self.system(values), values)
        except SealagError as error:
            return row | _refused(type(error).__name__, self._without_path(str(error)))
        except Exception as error:
            return row | _refused(FAILURE, f"{type(error).__name__}: {error}")

    def _answer(self, system: System, values: tuple[Value, ...]) -> dict[str, Any]:
        question = self.job.question
        rest = self._but(frozenset({"delays"}), values)
        besides = (*rest, system.delays.torque_feedback_delay)
        if self._found is None or self._found[0] != besides:
            self._found = None  # before the next one needs the memory
            found = question.prepared(system, self._along(system, values))
            if system.program is not None or not question.spans_delays:
                return found(system)
            self._found = besides, found
        return self._found[1](system)

    def _along(self, system: System, values: tuple[Value, ...]) -> Motion | None:
        """The motion that is asked about; None for the posture, or where none is asked about."""
        if not self.job.question.of_motions:
            return None
        if self.job.motion is None and system.motion_file is None:
            return None
        used = self._but(_NOT_OF_MOTIONS, values)
        if self._motion is None or self._motion[0] != used:
            self._motion = used, system.motion_of(self.job.motion, tell=_nothing)
        return self._motion[1]

    def _but(self, tables: frozenset[str], values: tuple[Value, ...]) -> tuple[Value, ...]:
        """The values of the keys that stand in other tables than these."""
        pairs = zip(self.job.keys, values)
        return tuple(value for key, value in pairs if key.table not in tables)

    def _without_path(self, message: str) -> str:
        """A message as it reads on every machine."""
        path = self.job.path
        return message.removeprefix(f"{path}: ").replace(f"{path.parent}/", "")


def _nothing(_: str) -> None:
    """What was left out of a motion is said once, before the sweep."""


def _refused(kind: str, message: str) -> dict[str, Any]:
    return {KIND: kind, ERROR: " ".join(message.split())[:_LONGEST_ERROR]}


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file.

    Args:
        path: the file.

    Raises:
        FileError: it cannot be read.
    """
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.").at(path) from error


class _Kept(threading.local):
    """The bench of this thread: a cluster's workers may have several."""

    bench: Bench | None = None


_kept = _Kept()


def asked(job: Job, first: int, points: Sequence[tuple[Value, ...]]) -> list[dict[str, Any]]:
    """Ask a block of points in a worker, as `Bench.rows` does.

    Args:
        job: what all workers know.
        first: number of the first point.
        points: values of each key.
    """
    if _kept.bench is None or _kept.bench.job != job:
        _kept.bench = Bench(job)
    return _kept.bench.rows(first, points)
