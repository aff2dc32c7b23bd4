"""Numbers of a record with the range in which they make sense, and their unit."""

import math
from dataclasses import Field, field, fields
from typing import Any, NamedTuple

from sealag.errors import InputError


class _Range(NamedTuple):
    low: float
    high: float
    unit: str


def ranged(default: float, low: float, high: float, unit: str = "") -> Any:
    """Return a dataclass field of a number.

    Args:
        default: its value where none is given.
        low: the least that it may be.
        high: the most.
        unit: what messages call its unit.
    """
    return field(default=default, metadata={_Range: _Range(low, high, unit)})


def check_ranges(record: Any, what: str) -> None:
    """Refuse numbers outside their range.

    Args:
        record: a dataclass with `ranged` fields.
        what: how messages call it.

    Raises:
        InputError: a number is none, or outside.
    """
    for one in fields(record):
        if _Range in one.metadata:
            _check(one, getattr(record, one.name), what)


def _check(one: Field[Any], value: Any, what: str) -> None:
    low, high, unit = one.metadata[_Range]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and low <= value <= high and math.isfinite(value)):
        need = f"{low:g} … {high:g} {unit}".rstrip()
        raise InputError(f"{what} {one.name} is {value!r}; it must lie in {need}.")
