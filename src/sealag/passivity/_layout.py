"""The layout of a file, declared once by dataclasses: plain data from it, and it from plain data.

Unknown, missing and repeated keys, other types, other sizes and numbers that are not finite are
errors that name the key. A field's size stands in its type by name, `Annotated[Array, "n", "n"]`;
the first field that uses a name fixes the size, and an empty name is any size. A section is a
dataclass whose fields stand in the file beside those of the class that holds it.
"""

import json
import math
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from sealag.errors import CertificateError
from sealag.typing import Array

UNBOUNDED = "unbounded"
"""How a file writes a time that no delay reaches."""

SECTION = "section"
"""Marks a field whose own fields stand in the file beside it: `Annotated[Answer, SECTION]`."""

Time = Annotated[float, UNBOUNDED]
"""A time in s that may be inf: "unbounded" in a file, for what no delay reaches."""

Vector = Annotated[Array, "n"]
Matrix = Annotated[Array, "n", "n"]
"""(n,) and (n, n) of a certificate with n joints."""

LARGEST_BYTES = 100_000_000
"""Of a file. Ten times more would let one file take 20 GB of memory; a walk of 7,000 instants with
all proofs is 30 MB."""

LARGEST_COUNT = 2**53
"""Whole numbers up to here are doubles too."""

LONGEST_TEXT = 20_000
"""Letters of one text."""

_LONGEST_INTEGER = 20
"""Digits of a whole number in a file: 5,000 digits are no count, and slow to read."""

T = TypeVar("T")


def plain(content: bytes) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Read strict JSON, and tell which numbers are not written as `repr` writes them.

    Such a number has a changed digit that its double does not show.

    Args:
        content: of a file.

    Returns:
        The plain data, and those numbers.

    Raises:
        CertificateError: it is not JSON, nested too deep, repeats a key, or has a number that is
            no finite double.
    """
    odd: list[str] = []

    def number(text: str) -> float:
        value = float(text)
        if not math.isfinite(value):
            raise CertificateError(f"the number {text[:40]} is too large; write a smaller one")
        if repr(value) != text:
            odd.append(text)
        return value

    try:
        data = json.loads(
            content.decode("utf-8"),
            parse_float=number,
            parse_int=_whole,
            parse_constant=_constant,
            object_pairs_hook=_once,
        )
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CertificateError(f"it is not JSON ({error})") from error
    except RecursionError as error:
        raise CertificateError("it is nested too deep; a certificate has six levels") from error
    if not isinstance(data, dict):
        raise CertificateError("it is no JSON object")
    return data, tuple(odd)


def _whole(text: str) -> int:
    if len(text) > _LONGEST_INTEGER:
        raise CertificateError(
            f"the number {text[:20]}… has {len(text)} digits, too many for a count"
        )
    return int(text)


def _constant(text: str) -> float:
    raise CertificateError(f"it says {text}, which is not a JSON number; a time says {UNBOUNDED!r}")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise CertificateError(f"the key {twice[:80]!r} stands there twice; keep one")
    return found


def encoded(value: Any) -> dict[str, Any]:
    """Return the plain data of a dataclass.

    Args:
        value: the value; its fields are dataclasses, arrays, lists, mappings, enumerations, numbers
            or text.
    """
    data = {}
    for name, kind in _hints(type(value)).items():
        entry = _encoded(getattr(value, name), kind)
        data |= entry if _is_section(kind) else {name: entry}
    return data


def _encoded(value: Any, kind: Any) -> Any:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (types.UnionType, Union):
        return None if value is None else _encoded(value, _one_of(inner))
    if origin is Annotated:
        time = kind == Time and value == math.inf
        return UNBOUNDED if time else _encoded(value, inner[0])
    if kind is Array:
        return value.tolist() if value.size else []
    if origin is tuple:
        return [_encoded(entry, inner[0]) for entry in value]
    if origin is Mapping:
        return {key: _encoded(entry, inner[1]) for key, entry in value.items()}
    return encoded(value) if is_dataclass(kind) else value


def decoded(data: Any, kind: type[T]) -> T:
    """Return a value of a declared type from plain data.

    Args:
        data: plain data.
        kind: a dataclass.

    Raises:
        CertificateError: data does not fit the type; the message names the key.
    """
    return _Reader(sizes={}).object(data, kind, "")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reader:
    """Reads plain data by declared types; sizes that a name has had so far."""

    sizes: dict[str, int]

    def read(self, data: Any, kind: Any, at: str) -> Any:
        origin, inner = get_origin(kind), get_args(kind)
        if origin in (types.UnionType, Union):
            return None if data is None else self.read(data, _one_of(inner), at)
        if kind == Time:
            return math.inf if data == UNBOUNDED else _number(data, at, f"or {UNBOUNDED!r}")
        if origin is Annotated:
            return self.sized(data, inner[0], inner[1:], at)
        if is_dataclass(kind):
            return self.object(data, kind, at)
        if origin is tuple:
            entries = _typed(data, list | tuple, at, "a list")
            return tuple(
                self.read(entry, inner[0], f"{at}[{k}]") for k, entry in enumerate(entries)
            )
        if origin is Mapping:
            pairs = _typed(data, dict, at, "an object").items()
            return {
                _text(key, f"a name in {at}"): self.read(entry, inner[1], f"{at}.{key}")
                for key, entry in pairs
            }
        return _SCALARS.get(kind, lambda data, at: _word(data, kind, at))(data, at)

    def object(self, data: Any, kind: Any, at: str) -> Any:
        found, known = _typed(data, dict, at, "an object"), list(_keys(kind))
        place = f"`{at}`" if at else "the file"
        if missing := [name for name in known if name not in found]:
            raise CertificateError(f"{place} lacks the key `{missing[0]}`")
        if unknown := [name for name in found if name not in known]:
            raise CertificateError(f"{place} has the unknown key {str(unknown[0])[:80]!r}")
        return self.filled(found, kind, f"{at}." if at else "")

    def filled(self, data: dict[str, Any], kind: Any, lead: str) -> Any:
        values = {}
        for name, hint in _hints(kind).items():
            if _is_section(hint):
                values[name] = self.filled(data, get_args(hint)[0], lead)
            else:
                values[name] = self.read(data[name], hint, lead + name)
        return kind(**values)

    def sized(self, data: Any, kind: Any, names: tuple[str, ...], at: str) -> Any:
        if kind is Array:
            return self.array(data, names, at)
        found = self.read(data, kind, at)
        self.check(found if kind is int else len(found), names[0], at)
        return found

    def array(self, data: Any, names: tuple[str, ...], at: str) -> Array:
        """An array of doubles; an empty list has no entries along its free axis."""
        free = tuple(name or f"axis {axis} of {at}" for axis, name in enumerate(names))
        if data == [] and "" in names:
            shape = [0 if not name else self.sizes.get(name, 0) for name in names]
            return np.zeros(shape)
        return np.array(self.rows(data, free, at), dtype=float)

    def rows(self, data: Any, names: tuple[str, ...], at: str) -> list[Any]:
        entries = _typed(data, list | tuple, at, "a list")
        self.check(len(entries), names[0], at)
        if len(names) > 1:
            return [self.rows(entry, names[1:], f"{at}[{k}]") for k, entry in enumerate(entries)]
        if all(type(entry) is float and math.isfinite(entry) for entry in entries):
            return list(entries)
        return [_number(entry, f"{at}[{k}]") for k, entry in enumerate(entries)]

    def check(self, length: int, name: str, at: str) -> None:
        """Fix the size that a name stands for, or refuse another one."""
        wanted = int(name) if name.isdigit() else self.sizes.setdefault(name, length)
        if length != wanted:
            raise CertificateError(f"`{at}` has {length} entries where {wanted} are needed")


def _typed(data: Any, kind: Any, at: str, words: str) -> Any:
    if not isinstance(data, kind):
        raise CertificateError(f"`{at}` is {_shown(data)}; it must be {words}")
    return data


def _shown(data: Any) -> str:
    if isinstance(data, list | tuple):
        return "a list"
    if isinstance(data, dict):
        return "an object"
    return json.dumps(data)[:60] if data is None or isinstance(data, bool) else repr(data)[:60]


def _number(data: Any, at: str, more: str = "") -> float:
    good = isinstance(data, int | float) and not isinstance(data, bool)
    if not good or not math.isfinite(data) or (isinstance(data, int) and abs(data) > LARGEST_COUNT):
        words = f"a finite number {more}".rstrip()
        raise CertificateError(f"`{at}` is {_shown(data)}; it must be {words}")
    return float(data)


def _count(data: Any, at: str) -> int:
    if not isinstance(data, int) or isinstance(data, bool) or not 0 <= data <= LARGEST_COUNT:
        raise CertificateError(f"`{at}` is {_shown(data)}; it must be a count from 0 up")
    return data


def _truth(data: Any, at: str) -> bool:
    return _typed(data, bool, at, "true or false")


def _text(data: Any, at: str) -> str:
    text = _typed(data, str, at, "a text")
    if len(text) > LONGEST_TEXT or not text.isprintable():
        raise CertificateError(f"`{at}` is {text[:40]!r}; it must be short and printable")
    return text


def _word(data: Any, kind: type[StrEnum], at: str) -> StrEnum:
    words = [str(word) for word in kind]
    if not isinstance(data, str) or data not in words:
        raise CertificateError(f"`{at}` is {_shown(data)}; it must be one of {', '.join(words)}")
    return kind(data)


_SCALARS: dict[Any, Callable[[Any, str], Any]] = {
    float: _number,
    int: _count,
    bool: _truth,
    str: _text,
}


@cache
def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind, include_extras=True)
    return {entry.name: hints[entry.name] for entry in fields(kind)}


def _keys(kind: Any) -> Iterator[str]:
    """Keys of a file that a dataclass stands for."""
    for name, hint in _hints(kind).items():
        if _is_section(hint):
            yield from _keys(get_args(hint)[0])
        else:
            yield name


def _is_section(kind: Any) -> bool:
    return get_origin(kind) is Annotated and get_args(kind)[1] == SECTION


def _one_of(choices: tuple[Any, ...]) -> Any:
    """The type beside None."""
    return next(choice for choice in choices if choice is not type(None))
