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


def show_json_error(kind: str, message: str, *, file: str | None, key: str | None) -> None:
    """Print the JSON object that stands where the answer would: what went wrong, and where.

    Args:
        kind: name of the error's class; "UsageError" for a wrong command line, "ToolFailure" where
            the tool itself failed.
        message: the sentence that standard error shows.
        file: the file that is wrong, or None.
        key: its key or column, or None.
    """
    error = {"kind": kind, "file": file, "key": key, "message": message}
    show_json({"status": "error", "error": error})


def _readable(value: Any) -> Any:
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, dict):
        return {_readable(key): _readable(entry) for key, entry in value.items()}
    return [_readable(entry) for entry in value] if isinstance(value, list | tuple) else value
