"""What is swept: a key of the project file and the values that it takes."""

import math
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sealag.errors import InputError
from sealag.sweep._key import Key
from sealag.units import number_of

Value = float | int | bool | str

MOST_VALUES = 1_000_000
"""Values of one key in a grid."""
_SCALE = re.compile(r"(lin|log)([1-9][0-9]{0,6})?|int")


class Spacing(StrEnum):
    """How the values of a range lie."""

    LIN = "lin"
    LOG = "log"
    INT = "int"


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Numbers from one to another.

    Attributes:
        low: the smallest.
        high: the largest.
        spacing: equal differences, equal ratios, or every whole number.
        count: how many a grid takes; None if none is given.
    """

    low: float
    high: float
    spacing: Spacing
    count: int | None

    def at(self, share: float) -> Value:
        """Return the number at a share of the way, 0 … 1."""
        if self.spacing is Spacing.INT:
            return int(self.low) + min(int(share * self._whole), self._whole - 1)
        if share in (0.0, 1.0):  # not rounded
            return self.high if share else self.low
        if self.spacing is Spacing.LOG:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)

    def step(self, index: int) -> Value:
        """Return a number of the grid."""
        if self.spacing is Spacing.INT:
            return int(self.low) + index
        return self.at(index / (self.size - 1) if self.size > 1 else 0.0)

    @property
    def size(self) -> int:
        """How many numbers a grid takes."""
        return self._whole if self.spacing is Spacing.INT else self.count or 0

    @property
    def _whole(self) -> int:
        return int(self.high) - int(self.low) + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """Values one by one.

    Attributes:
        values: numbers, truth values or words, all of one kind.
    """

    values: tuple[Value, ...]

    def at(self, share: float) -> Value:
        """Return the value at a share of the list, 0 … 1."""
        return self.values[min(int(share * self.size), self.size - 1)]

    def step(self, index: int) -> Value:
        """Return a value of the grid."""
        return self.values[index]

    @property
    def size(self) -> int:
        """How many there are."""
        return len(self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A key of the project file and the values that it takes.

    Attributes:
        key: where the values stand.
        values: the values.
    """

    key: Key
    values: Span | Choices

    @classmethod
    def of(cls, text: str) -> "Axis":
        """Read KEY=1,2,5 or KEY=LOW:HIGH:log40, lin40, log, lin or int.

        Args:
            text: the expression.

        Raises:
            InputError: it is none.
        """
        name, given, rest = text.partition("=")
        if not given or not rest:
            raise InputError(
                f"--over is {text!r}; KEY=1,2,5 or KEY=LOW:HIGH:log40 (lin40, int) is right."
            )
        key = Key.of(name.strip())
        low = number_of(rest.partition(":")[0])
        if ":" in rest and low is not None:
            return cls(key=key, values=_span(text, rest))
        return cls(key=key, values=Choices(values=_choices(text, rest.split(","))))

    @property
    def moves(self) -> bool:
        """Whether it takes more than one value."""
        return self.values.size != 1

    def probes(self) -> Sequence[Value]:
        """Return a few of its values, from one end to the other."""
        return tuple(dict.fromkeys(self.values.at(share) for share in np.linspace(0.0, 1.0, 9)))


def _span(text: str, rest: str) -> Span:
    parts = rest.split(":")
    low, high = number_of(parts[0]), number_of(parts[1])
    scale = _SCALE.fullmatch(parts[2] if len(parts) > 2 else "lin")
    if low is None or high is None or scale is None or len(parts) > 3:
        raise InputError(
            f"--over is {text!r}; a range is LOW:HIGH and :lin, :log or :int, with a grid's number "
            "of values behind, such as 10:400:log40."
        )
    spacing = Spacing(scale[1] or "int")
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"--over is {text!r}; a range goes from a number to a larger one.")
    if spacing is Spacing.LOG and low <= 0.0:
        raise InputError(f"--over is {text!r}; a logarithmic range begins above 0.")
    if spacing is Spacing.INT and not (low.is_integer() and high.is_integer()):
        raise InputError(f"--over is {text!r}; a range of whole numbers has whole ends.")
    span = Span(low=low, high=high, spacing=spacing, count=int(scale[2]) if scale[2] else None)
    if span.size > MOST_VALUES or max(abs(low), abs(high)) > 1e300:
        raise InputError(f"--over is {text!r}; one key takes {MOST_VALUES} values at most.")
    return span


def _choices(text: str, words: Sequence[str]) -> tuple[Value, ...]:
    values = [_value(text, word.strip()) for word in words]
    if len(set(values)) != len(values):
        raise InputError(f"--over is {text!r}; a value is listed twice.")
    kinds = {type(value) for value in values}
    if kinds == {int, float}:
        return tuple(float(value) for value in values)
    if len(kinds) > 1:
        raise InputError(f"--over is {text!r}; numbers and words are mixed.")
    return tuple(values)


def _value(text: str, word: str) -> Value:
    """A value as TOML reads it; what it does not read is a word."""
    try:
        plain = word.isprintable() and "#" not in word
        value = tomllib.loads(f"value = {word}\n")["value"] if plain else word
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        value = word
    finite = not isinstance(value, float) or math.isfinite(value)
    short = not isinstance(value, int) or value.bit_length() <= 63
    if not (isinstance(value, Value) and finite and short and value != ""):
        raise InputError(
            f"--over is {text!r}; {word!r} is no value: finite numbers, true, false or words are."
        )
    return value
