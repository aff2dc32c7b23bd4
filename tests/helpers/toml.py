"""Project files as text."""

import json
import math
from typing import Any


def to_toml(data: dict[str, Any]) -> str:
    """Return a nested dictionary as TOML, one top-level key a line; None is left out."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in data.items())


def _key(name: str) -> str:
    return json.dumps(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        inside = (f"{_key(k)} = {_value(v)}" for k, v in value.items() if v is not None)
        return "{" + ", ".join(inside) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # nan, inf, -inf
    return json.dumps(value)
