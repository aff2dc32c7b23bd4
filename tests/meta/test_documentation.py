"""Every public name says what it is, and names every parameter and field it has."""

import dataclasses
import enum
import importlib
import inspect
import pkgutil
import re

import pytest

import sealag

ROOMS = [
    module.name
    for module in pkgutil.iter_modules(sealag.__path__, prefix="sealag.")
    if module.name not in {"sealag.data", "sealag.cli"}
]


def _public_names() -> list[tuple[str, str]]:
    names = []
    for room in ROOMS:
        module = importlib.import_module(room)
        names += [(room, name) for name in getattr(module, "__all__", [])]
    return names


def missing_documentation(name: str, thing: object) -> list[str]:
    """List what the docstrings of a public thing leave out.

    Args:
        name: what to call it in the list.
        thing: a class, function or value.
    """
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        return []
    doc = inspect.getdoc(thing) or ""
    if len(doc.split()) < 4:
        return [f"{name}: no docstring"]
    gaps: list[str] = []
    if inspect.isfunction(thing):
        gaps += _unmentioned(name, inspect.signature(thing).parameters, doc)
    elif dataclasses.is_dataclass(thing):
        fields = [field.name for field in dataclasses.fields(thing)]
        gaps += _unmentioned(name, fields, _class_text(thing))
    if inspect.isclass(thing) and not issubclass(thing, enum.Enum):
        gaps += _method_gaps(name, thing)
    return gaps


def _class_text(thing: type) -> str:
    """Docstring and source of a class: a field may be documented by a string below it."""
    try:
        source = inspect.getsource(thing)
    except OSError:
        source = ""
    below = re.findall(r"^    (\w+)\s*:.*\n\s+(?:[rf]?\"\"\")", source, flags=re.MULTILINE)
    return (inspect.getdoc(thing) or "") + " ".join(below)


def _unmentioned(name: str, parameters: object, doc: str) -> list[str]:
    return [
        f"{name}: parameter or field `{parameter}` is not documented"
        for parameter in parameters  # type: ignore[attr-defined]
        if parameter not in {"self", "cls"}
        and not parameter.startswith("_")
        and not re.search(rf"\b{re.escape(parameter)}\b", doc)
    ]


def _method_gaps(name: str, thing: type) -> list[str]:
    gaps = []
    for method_name, method in vars(thing).items():
        if method_name.startswith("_"):
            continue
        target = method
        if isinstance(method, property):
            target = method.fget
        elif isinstance(method, (staticmethod, classmethod)):
            target = method.__func__
        if not inspect.isfunction(target):
            continue
        doc = inspect.getdoc(target) or ""
        if len(doc.split()) < 3:
            gaps.append(f"{name}.{method_name}: no docstring")
        else:
            parameters = inspect.signature(target).parameters
            gaps += _unmentioned(f"{name}.{method_name}", parameters, doc)
    return gaps


@pytest.mark.parametrize(("room", "name"), _public_names(), ids=lambda value: str(value))
def test_public_name_is_documented(room: str, name: str) -> None:
    thing = getattr(importlib.import_module(room), name)
    assert missing_documentation(f"{room}.{name}", thing) == []


@pytest.mark.parametrize("room", ROOMS)
def test_room_has_public_names_and_says_what_it_is_for(room: str) -> None:
    module = importlib.import_module(room)
    assert len((module.__doc__ or "").split()) >= 4


def test_check_fails_on_an_undocumented_parameter() -> None:
    def undocumented(x: float, y: float) -> float:
        """Add the number x to another one.

        Args:
            x: one number.
        """
        return x + y

    assert missing_documentation("f", undocumented) == [
        "f: parameter or field `y` is not documented"
    ]


def test_check_fails_on_an_undocumented_method_and_field() -> None:
    @dataclasses.dataclass
    class Thing:
        """A thing that has a width in m."""

        width: float
        height: float

        def area(self) -> float:
            return self.width * self.height

    assert missing_documentation("Thing", Thing) == [
        "Thing: parameter or field `height` is not documented",
        "Thing.area: no docstring",
    ]
