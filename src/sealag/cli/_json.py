"""Answers as JSON on standard output."""

import json
from typing import Any


def show_json(answer: dict[str, Any]) -> None:
    """Print one JSON object to standard output.

    Args:
        answer: what to print; it must hold finite numbers only.
    """
    print(json.dumps(answer, allow_nan=False))
