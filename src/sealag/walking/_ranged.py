"""Numbers of a record with the range in which they make sense, and what its fields may be."""

import math
from dataclasses import field, fields
from enum import StrEnum
from typing import Any, NamedTuple

from sealag.errors import InputError, word


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


def check_fields(record: Any, key: str) -> None:
    """Refuse numbers outside their range, and what is neither true nor false or no word of a set.

    Args:
        record: a dataclass; numbers are `ranged`, the other fields have a default of their kind. A
            word becomes its member of the set.
        key: section of the project file that gives the fields, which messages name.

    Raises:
        InputError: a field has a value of another kind or outside its range.
    """
    for one in fields(record):
        name, value = f"{key}.{one.name}", getattr(record, one.name)
        if _Range in one.metadata:
            _check(one.metadata[_Range], value, name)
        elif isinstance(one.default, StrEnum):
            object.__setattr__(record, one.name, word(type(one.default), value, what=name))
        elif not isinstance(value, bool):
            raise InputError(f"{name} is {value!r}; it must be true or false.")


def _check(within: _Range, value: Any, name: str) -> None:
    low, high, unit = within
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and low <= value <= high and math.isfinite(value)):
        need = f"{low:g} … {high:g} {unit}".rstrip()
        raise InputError(f"{name} is {value!r}; it must lie in {need}.")
