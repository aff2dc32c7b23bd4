"""Mutations of a project, key by key of the schema, and of a URDF, attribute by attribute."""

import copy
import re
import types
import typing
from random import Random
from typing import Any

from pydantic import BaseModel

from sealag.design import load

PROJECT = type(load("bundled:hume").source.project)
"""The schema's class of a whole project."""

NUMBERS = (
    0.0, -0.0, 1.0, -1.0, 0.3, 2, 7, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 10.0, 60.0, 100.0, 1e3,
    5e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e15, 1e300, -1e300, 1e-300, 5e-324, 2**31, 2**63, 10**400,
    float("nan"), float("inf"), -float("inf"),
)  # fmt: skip
"""Ends of ranges, what lies beyond them, and what is no number."""

TEXTS = (
    "", " ", "x" * 5000, "a\nb", "\x1b[31mred\x1b[0m", "\u202eevil", "e\u0301", "\x85", "\x00",
    "..", "../..", "~nosuch/x", "/dev/zero", "/proc/self/mem", "bundled:../hume", "bundled:hume",
    "example-robot-data:../../../etc/passwd", "example-robot-data:", "%s", "{0}", "universe",
)  # fmt: skip
"""Names that are none, paths that lead elsewhere, and what a terminal takes for an order."""


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The sections that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if typing.get_origin(annotation) in (typing.Union, types.UnionType, typing.Annotated, list):
        return [model for part in typing.get_args(annotation) for model in _models(part)]
    if typing.get_origin(annotation) is dict:
        return _models(typing.get_args(annotation)[1])
    return []


def _choices(annotation: Any) -> list[Any]:
    return (
        list(typing.get_args(annotation)) if typing.get_origin(annotation) is typing.Literal else []
    )


def places(data: Any, model: type[BaseModel] | None = PROJECT) -> list[tuple[Any, Any, list[Any]]]:
    """Every place of a project: its container, its key or index, and words that it may hold.

    Keys of the schema that the project leaves out are places too.
    """
    found = []
    if isinstance(data, dict):
        fields = {} if model is None else model.model_fields
        for key in dict.fromkeys([*data, *fields]):  # in a fixed order
            field = fields.get(key)
            inner = _models(field.annotation) if field else []
            found.append((data, key, _choices(field.annotation) if field else []))
            value = data.get(key)
            for part in value if isinstance(value, list) else [value]:
                chosen = [one for one in inner if _fits(one, part)]
                if isinstance(part, dict) and field is not None and not chosen and inner:
                    for each in part.values():
                        found += places(each, inner[0]) if isinstance(each, dict) else []
                found += places(part, chosen[0] if chosen else None)
    if isinstance(data, list):
        for index, part in enumerate(data):
            found.append((data, index, []))
            found += places(part, None) if isinstance(part, list) else []
    return found


def _fits(model: type[BaseModel], value: Any) -> bool:
    return isinstance(value, dict) and any(key in model.model_fields for key in value)


def _value(place: tuple[Any, Any, list[Any]]) -> Any:
    container, key, _ = place
    if isinstance(container, list):
        return container[key] if key < len(container) else None
    return container.get(key)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _scaled(data: dict[str, Any], random: Random) -> dict[str, Any]:
    """A project with some of its numbers scaled, most of them within their ranges."""
    for _ in range(random.choice((1, 2, 3))):
        container, key, _ = random.choice([one for one in places(data) if _is_number(_value(one))])
        by = random.choice((-1, 0.3, 3, 0.1, 10, 0.01, 100, 1e-3, 1e3, 1e-6, 1e6))
        container[key] = container[key] * by or by
    return data


def mutated(project: dict[str, Any], random: Random, words: list[str]) -> dict[str, Any]:
    """A copy of a project with one to three keys changed, left out or doubled."""
    data = copy.deepcopy(project)
    if random.random() < 0.5:
        return _scaled(data, random)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        place = random.choice(places(data))
        container, key, choices = place
        now = _value(place)
        match random.choice(("number", "number", "text", "word", "drop", "shape")):
            case "number":
                container[key] = random.choice(NUMBERS)
            case "text":
                container[key] = random.choice(TEXTS)
            case "word":
                container[key] = random.choice([*choices, *words, True, False])
            case "drop" if now is not None:
                del container[key]
            case "shape":
                container[key] = random.choice(([], {}, [now], [now, now], [0.0] * 7, {"": now}))
    return data


_ATTRIBUTE = re.compile(r'(\w+)="([^"]*)"')


def _is_numbers(text: str) -> bool:
    try:
        return bool([float(word) for word in text.split()])
    except ValueError:
        return False


def mutated_urdf(text: str, random: Random) -> str:
    """A URDF with one to three attributes changed, or an element cut out or doubled."""
    for _ in range(random.choice((1, 1, 2, 3))):
        match random.choice(("scale", "scale", "scale", "attribute", "cut", "double", "chop")):
            case "scale":
                found = [one for one in _ATTRIBUTE.finditer(text) if _is_numbers(one[2])]
                if not found:
                    continue
                one, by = random.choice(found), random.choice((-1, 0.1, 0.5, 2, 10, 1e-3, 1e3, 1e6))
                value = " ".join(str(float(word) * by) for word in one[2].split())
                text = f'{text[: one.start()]}{one[1]}="{value}"{text[one.end() :]}'
            case "attribute":
                found = list(_ATTRIBUTE.finditer(text))
                if not found:
                    continue
                one, other = random.choice(found), random.choice(found)
                value = random.choice(
                    (
                        other[2],
                        str(random.choice(NUMBERS)),
                        random.choice(TEXTS),
                        "0 0 0",
                        "1 1 1e308",
                    )
                )
                value = value.replace('"', "").replace("<", "")
                text = f'{text[: one.start()]}{one[1]}="{value}"{text[one.end() :]}'
            case "cut" | "double" as kind:
                elements = list(re.finditer(r"<(\w+)[^<>]*/>|<(joint|link)\b.*?</\2>", text, re.S))
                if elements:
                    one = random.choice(elements)
                    text = text[: one.start()] + one[0] * 2 * (kind == "double") + text[one.end() :]
            case _:
                if random.random() < 0.1:
                    text = text[: random.randrange(len(text) + 1)]
    return text
