"""The layout of a file, declared once by dataclasses: plain data from it, and it from plain data.

Nothing is guessed: unknown, missing and repeated keys, other types, and numbers that are none are
errors that name the key.
"""

import json
import math
import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from sealag.errors import CertificateError

UNBOUNDED = "unbounded"
"""What a file says where no time is too long."""

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
        raise CertificateError(f"the number {text[:20]}… has {len(text)} digits; no count has")
    return int(text)


def _constant(text: str) -> float:
    raise CertificateError(f"it says {text}, which is no JSON number; a time says {UNBOUNDED!r}")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise CertificateError(f"the key {twice[:80]!r} stands there twice; keep one")
    return found


def encoded(value: Any, kind: Any) -> Any:
    """Return plain data for a value of a declared type.

    Args:
        value: the value.
        kind: its type: a dataclass, a list, a mapping, an enumeration, a number or text.
    """
    if is_dataclass(kind):
        hints = _hints(kind)
        return {name: encoded(getattr(value, name), hints[name]) for name in hints}
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (types.UnionType, Union):
        return None if value is None else encoded(value, _one_of(inner))
    if origin in (list, tuple):
        return [encoded(entry, inner[0]) for entry in value]
    if origin is Mapping:
        return {key: encoded(entry, inner[1]) for key, entry in value.items()}
    if origin is Annotated and value == math.inf:
        return UNBOUNDED
    return value


def decoded(data: Any, kind: type[T]) -> T:
    """Return a value of a declared type from plain data.

    Args:
        data: plain data.
        kind: a dataclass.

    Raises:
        CertificateError: data does not fit the type; the message names the key.
    """
    return _read(data, kind, "")


def _read(data: Any, kind: Any, at: str) -> Any:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (types.UnionType, Union):
        return None if data is None else _read(data, _one_of(inner), at)
    if is_dataclass(kind):
        return _object(data, kind, at)
    if origin in (list, tuple):
        entries = _typed(data, list | tuple, at, "a list")
        if inner[0] is float and all(type(e) is float and math.isfinite(e) for e in entries):
            return origin(entries)
        found = (_read(entry, inner[0], f"{at}[{k}]") for k, entry in enumerate(entries))
        return origin(found)
    if origin is Mapping:
        pairs = _typed(data, dict, at, "an object").items()
        return {
            _text(key, f"a name in {at}"): _read(entry, inner[1], f"{at}.{key}")
            for key, entry in pairs
        }
    if origin is Annotated:
        return math.inf if data == UNBOUNDED else _number(data, at, f"or {UNBOUNDED!r}")
    return _SCALARS.get(kind, lambda data, at: _word(data, kind, at))(data, at)


def _object(data: Any, kind: Any, at: str) -> Any:
    found, hints = _typed(data, dict, at, "an object"), _hints(kind)
    known, place = hints.keys(), f"`{at}`" if at else "the file"
    if missing := [name for name in known if name not in found]:
        raise CertificateError(f"{place} lacks the key `{missing[0]}`")
    if unknown := [name for name in found if name not in known]:
        raise CertificateError(f"{place} has the key {str(unknown[0])[:80]!r}, which is unknown")
    lead = f"{at}." if at else ""
    return kind(**{name: _read(found[name], hints[name], lead + name) for name in known})


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


def _one_of(choices: tuple[Any, ...]) -> Any:
    """The type beside None."""
    return next(choice for choice in choices if choice is not type(None))
