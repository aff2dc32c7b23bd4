"""The dotted path of a value in a project file."""

import re
from collections.abc import MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any

from sealag.errors import InputError, near
from sealag.toml import table_in

_PART = re.compile(r'"([^"]+)"|([^."]+)')
_PATH = re.compile(rf"(?:{_PART.pattern})(?:\.(?:{_PART.pattern}))+")
_NAMES = ("name", "frame")
"""Keys by which the tables of a list are called: of a task, of a contact or a push."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """Where a value stands in a project file.

    Attributes:
        text: as it was given, such as `tasks.0.stiffness`.
        parts: names of tables and keys, and places in lists, from 0, or the names of what is there.
    """

    text: str
    parts: tuple[str, ...]

    @classmethod
    def of(cls, text: str) -> "Key":
        """Read a dotted path; a part with a dot in it stands in double quotes.

        Args:
            text: the path.

        Raises:
            InputError: it is none.
        """
        if not _PATH.fullmatch(text):
            raise InputError(
                f"{text!r} is no key of a project file; its tables, lists and keys are joined by "
                "dots, such as tasks.0.stiffness or delays.central_round_trip.value_ms."
            )
        return cls(text=text, parts=tuple(a or b for a, b in _PART.findall(text)))

    def place(self, document: Any) -> tuple[str | int, ...]:
        """Return the parts with the number of each list's entry, also where its name was given.

        Args:
            document: a document of TOML Kit.

        Raises:
            InputError: a list has no such entry, or the path goes on behind a value.
        """
        at, found = document, []
        for part in self.parts:
            step: str | int = part
            if isinstance(at, list):
                step = self._entry(at, part)
                at = at[step]
            elif isinstance(at, MutableMapping):
                at = at.get(part, {})
            else:
                raise InputError(
                    f"{self.text}: {'.'.join(map(str, found))} is a value, not a table or list; "
                    "end the key there."
                )
            found.append(step)
        return tuple(found)

    @property
    def table(self) -> str:
        """The table of the file that it stands in."""
        return self.parts[0]

    @staticmethod
    def put(document: Any, place: Sequence[str | int], value: Any) -> None:
        """Write a value; tables that are not there are made.

        Args:
            document: a document of TOML Kit.
            place: where, as `place` returns it.
            value: a number, a truth value or a word.
        """
        *tables, last = place
        at = document
        for step in tables:
            if isinstance(at, MutableMapping) and step not in at:
                at[step] = table_in(at)
            at = at[step]
        at[last] = value

    def _entry(self, entries: list[Any], part: str) -> int:
        """The place of a list's entry, by its number or its name."""
        if part.isascii() and part.isdigit():
            if int(part) < len(entries):
                return int(part)
            raise InputError(
                f"{self.text}: the list has {len(entries)} entries, numbered from 0; there is no "
                f"{part}."
            )
        names = [
            next((str(entry[key]) for key in _NAMES if key in entry), "")
            for entry in entries
            if isinstance(entry, MutableMapping)
        ]
        if part not in names:
            raise InputError(f"{self.text}: {near(part, filter(None, names), what='entry')}")
        return names.index(part)
