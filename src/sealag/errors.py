"""The error tree: one root; children also inherit the builtin error that a caller expects.

A message is one sentence: value, place (file, key, joint, frame), remedy. "Not certified" is a
result, never an exception.
"""

import difflib
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Self, TypeVar
from unicodedata import normalize


class SealagError(Exception):
    """Root of every error that sealag raises on purpose; the command line exits with status 2.

    Attributes:
        file: the file that is wrong, where that is known.
        key: its key or column, where one is to blame.
    """

    file: str | None = None
    key: str | None = None

    def at(self, file: object, key: str | None = None) -> Self:
        """Return this error with its place, unless it has one.

        Args:
            file: path of the file that is wrong.
            key: its key or column.
        """
        self.file = self.file or str(file)
        self.key = self.key or key or None
        return self


class InputError(SealagError, ValueError):
    """A value given by the user cannot be used: wrong shape, unit, sign, NaN or out of range."""


class FileError(SealagError, OSError):
    """A file cannot be read or written: missing, too large, not the format its name says."""


class ProjectError(InputError):
    """The project file (TOML) does not match its schema; the message names file and key."""


class MotionError(InputError):
    """A motion file has unknown or missing columns, NaN rows or times that do not increase."""


class RobotError(InputError):
    """A URDF cannot be turned into a robot, or a configuration does not fit the robot."""


class UnknownNameError(SealagError, KeyError):
    """A joint, frame, task or robot name does not exist; the message lists near matches."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ContractionError(SealagError, ArithmeticError):
    """The static joint state has no contraction: springs too soft for the task stiffness."""


class SolverError(SealagError, RuntimeError):
    """A numerical method stopped before its answer could be trusted."""


class CertificateError(SealagError, ValueError):
    """A file is not a certificate."""


def near(name: str, known: Iterable[str], *, what: str) -> UnknownNameError:
    """Return the error for an unknown name, with near matches.

    Args:
        name: what was asked for.
        known: the names that exist.
        what: such as "joint" or "frame".
    """
    known = list(known)
    for other in known:
        if normalize("NFC", name) == normalize("NFC", other):
            return UnknownNameError(
                f"The {what} {name!r} is written with other characters than the {other!r} there is "
                f"({name!a} and {other!a}), which only look alike; copy the name."
            )
    matches = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
    hint = f"did you mean {either(matches)}?" if matches else f"there is {either(known[:12])}."
    return UnknownNameError(f"No {what} is called {name!r}; {hint}")


W = TypeVar("W", bound=StrEnum)


def word(kind: type[W], value: object, *, what: str) -> W:
    """Return the member of an enumeration that a word names.

    Args:
        kind: the enumeration.
        value: the word.
        what: how the message calls it.

    Raises:
        InputError: there is none; the message lists those there are.
    """
    known = [str(member) for member in kind]
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{what} is {value!r}; it must be {either(known)}.")
    return kind(value)


def either(names: Sequence[str]) -> str:
    """Join names as a, b or c.

    Args:
        names: the names.
    """
    if not names:
        return "none"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


__all__ = [
    "CertificateError",
    "ContractionError",
    "FileError",
    "InputError",
    "MotionError",
    "ProjectError",
    "RobotError",
    "SealagError",
    "SolverError",
    "UnknownNameError",
    "either",
    "near",
    "word",
]
