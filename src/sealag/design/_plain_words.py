"""What the schema finds wrong with a project file, in plain words."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sealag.errors import FileError, ProjectError, SealagError

_NEEDS = {
    "bool_type": "it must be true or false",
    "dict_type": "it must be a table",
    "finite_number": "it must be a finite number",
    "float_type": "it must be a number, without quotes",
    "greater_than": "it must be more than {gt:g}",
    "greater_than_equal": "it must be at least {ge:g}",
    "int_type": "it must be a whole number, without quotes",
    "less_than": "it must be less than {lt:g}",
    "less_than_equal": "it must be at most {le:g}",
    "list_type": "it must be a list: [ … ]",
    "literal_error": "it must be {expected}",
    "model_attributes_type": "it must be a table",
    "model_type": "it must be a table",
    "range": "{need}",
    "string_type": "it must be text in quotes",
    "too_long": "it must have at most {max_length} entries",
    "too_short": "it must have at least {min_length} entries",
}


def first_problem(problems: list[Any], data: dict[str, Any], *, path: Path) -> tuple[str, str]:
    """Say in one sentence what is wrong first, where, and what would be right.

    Args:
        problems: what pydantic found, at least one.
        data: the parsed file.
        path: what the message calls the file.

    Returns:
        The key, and the sentence; it names the file, the key, what was found and what is needed.
        What a starter file leaves to be filled in comes first, and all of it at once.
    """
    unfilled = [problem for problem in problems if _is_unfilled(problem)]
    if unfilled:
        keys = dict.fromkeys(_key(problem["loc"], data) for problem in unfilled)
        return next(iter(keys)), f"{path}: still to be filled in: {', '.join(keys)}."
    first = problems[0]
    key = _key(first["loc"], data)
    more = len({tuple(problem["loc"]) for problem in problems}) - 1
    rest = f" ({more} more problem{'s' * (more > 1)} in the file.)" if more else ""
    found = first.get("input")
    match first["type"]:
        case "missing":
            return key, f"{path}: the key {key} is missing.{rest}"
        case "union_tag_not_found":
            return f"{key}.kind", f"{path}: the key {key}.kind is missing.{rest}"
        case "extra_forbidden":
            return key, (
                f"{path}: the key {key} is not known; check its spelling and section.{rest}"
            )
        case "union_tag_invalid":
            key, found = f"{key}.kind", first["ctx"]["tag"]
            need = f"it must be one of {first['ctx']['expected_tags']}"
        case kind:
            need = _NEEDS[kind].format(**first.get("ctx", {})) if kind in _NEEDS else first["msg"]
    shown = repr(found) if len(repr(found)) < 60 else f"a {type(found).__name__}"
    unit = " (in ms: was another unit meant?)" if key.endswith("_ms") else ""
    return key, f"{path}: {key} is {shown}; {need}{unit}.{rest}"


def _is_unfilled(problem: Any) -> bool:
    found = problem.get("input")
    return isinstance(found, str) and found.startswith("FILL")


def _key(place: tuple[Any, ...], data: Any) -> str:
    """The key that a place in the schema stands for; tables in lists go by their names.

    Parts of the place that the file does not have are pydantic's own, but for a last one that is
    missing.
    """
    key, at = "", data
    for depth, part in enumerate(place, start=1):
        if isinstance(at, dict) and (part in at or depth == len(place)):
            at, key = at.get(part), f"{key}.{part}"
        elif isinstance(at, list) and isinstance(part, int):
            at = at[part]
            name = at.get("name", at.get("frame")) if isinstance(at, dict) else None
            key += f" (entry {part + 1})" if name is None else f"[{name!r}]"
    return key.removeprefix(".")


@contextmanager
def named(path: Path, key: str) -> Iterator[None]:
    """Let errors name the project file and the key that they come from, unless they do so.

    Args:
        path: the file.
        key: the key; empty if none is at fault.
    """
    try:
        yield
    except SealagError as error:
        if str(error).startswith((f"{path}: ", f"{path} ")):
            error.at(path, key)
            raise
        kind = FileError if isinstance(error, FileError) else ProjectError
        named = kind(f"{path}: {key}{': ' if key else ''}{error}").at(path, key)
        raise named from error
