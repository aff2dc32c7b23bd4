"""What a worker does: build each design of a block from the project's text, and ask it."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from sealag.design import load
from sealag.errors import FileError, SealagError
from sealag.sweep._axis import Value
from sealag.sweep._key import Key
from sealag.sweep._question import Question
from sealag.toml import text_of

POINT, KIND, ERROR = "point", "error_kind", "error"
"""Columns of every sweep: the number, and why there is no answer."""
FAILURE = "ToolFailure"
"""Kind of a point at which the tool itself failed: no answer about the design."""
_LONGEST_ERROR = 2000  # letters


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
        self._require_same_files()
        with threadpool_limits(1):  # sums of several threads differ in their last bits
            return [self._row(first + i, values) for i, values in enumerate(points)]

    def text_with(self, values: Sequence[Value]) -> str:
        """Return the project's text with other values.

        Args:
            values: of each key.

        Raises:
            InputError: a key leads nowhere, or its dotted keys cannot be extended.
        """
        import tomlkit

        document = tomlkit.parse(self.text)
        for key, value in zip(self.keys, values, strict=True):
            key.put(document, value)
        return text_of(
            document,
            refusal=f"{', '.join(key.text for key in self.keys)}: dotted keys of the file cannot "
            "be extended; give the table a header of its own, [table.name].",
        )

    def _row(self, number: int, values: Sequence[Value]) -> dict[str, Any]:
        row: dict[str, Any] = {POINT: number}
        row |= {key.text: value for key, value in zip(self.keys, values)}
        try:
            system = load(self.path, text=self.text_with(values))
            return row | self.question.answer(system, self.motion)
        except SealagError as error:
            return row | _refused(type(error).__name__, self._without_path(str(error)))
        except Exception as error:
            return row | _refused(FAILURE, f"{type(error).__name__}: {error}")

    def _without_path(self, message: str) -> str:
        """A message as it reads on every machine."""
        return message.removeprefix(f"{self.path}: ").replace(f"{self.path.parent}/", "")

    def _require_same_files(self) -> None:
        for name, known in self.digests.items():
            if digest_of(Path(name)) != known:
                raise FileError(
                    f"{name} is not here what it was when the sweep began; sweep again into "
                    "another --out, and let workers of a cluster see the same files."
                ).at(name)


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


def asked(job: Job, first: int, points: Sequence[tuple[Value, ...]]) -> list[dict[str, Any]]:
    """Ask a block of points in a worker, as `Job.rows` does.

    Args:
        job: what all workers know.
        first: number of the first point.
        points: values of each key.
    """
    return job.rows(first, points)
