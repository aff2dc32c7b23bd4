"""Answers as JSON on standard output."""

import json
from typing import Any


def show_json(answer: dict[str, Any]) -> None:
    """Print one JSON object to standard output.

    Args:
        answer: what to print; it must hold finite numbers only. Halves of surrogate pairs, as paths
            have them whose bytes are no UTF-8, are written out: not every JSON reader takes them.
    """
    print(json.dumps(_readable(answer), allow_nan=False))


def _readable(value: Any) -> Any:
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, dict):
        return {_readable(key): _readable(entry) for key, entry in value.items()}
    return [_readable(entry) for entry in value] if isinstance(value, list | tuple) else value
