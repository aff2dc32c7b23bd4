"""Rooms export few names, and each is used outside its room: tests do not count."""

import ast
import re
from collections.abc import Iterator

from helpers.source import ROOT, exported, imported, modules, tree

MOST = 89
"""Names of all rooms together, at most."""
NO_ROOMS = {"sealag.cli", "sealag.data", "sealag.kernels"}
"""The command line is called by its entry point; data and kernels export nothing."""

_TEXT_IMPORT = re.compile(r"from (sealag[\w.]*) import ([\w, ]+)")
_TEXT_NAME = re.compile(r"\b(sealag(?:\.\w+)*)\.(\w+)\b")


def _rooms() -> dict[str, list[str]]:
    """Exported names of every room."""
    return {
        name: exported(tree(path))
        for name, path in modules("sealag").items()
        if path.name == "__init__.py" and name not in {"sealag", *NO_ROOMS}
    }


def _homes() -> dict[str, str]:
    """The room of every name that the package itself offers."""
    front = set(exported(tree(modules("sealag")["sealag"])))
    return {name: room for room, names in _rooms().items() for name in names if name in front}


def _uses_in_code(source: ast.AST) -> Iterator[tuple[str, str]]:
    yield from imported(source)
    rooms = {name: f"sealag.{name}" for module, name in imported(source) if module == "sealag"}
    for node in ast.walk(source):
        if isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            yield rooms.get(owner, owner), node.attr


def _uses_in_text(text: str) -> Iterator[tuple[str, str]]:
    for module, names in _TEXT_IMPORT.findall(text):
        for name in names.split(","):
            yield module, name.strip()
    yield from _TEXT_NAME.findall(text)


def _used() -> set[tuple[str, str]]:
    """(room, name) of all uses outside the room, in code, examples and documentation."""
    homes, found = _homes(), set()

    def note(uses: Iterator[tuple[str, str]], own: str = "") -> None:
        for module, name in uses:
            room = homes.get(name, module) if module == "sealag" else module
            if room != own:
                found.add((room, name))

    for name, path in modules("sealag").items():
        if name != "sealag":
            note(_uses_in_code(tree(path)), own=".".join(name.split(".")[:2]))
    others = [ROOT / folder for folder in ("studies", "bench", "examples")]
    for path in (path for folder in others for path in folder.rglob("*.py")):
        note(_uses_in_code(tree(path)))
    for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        note(_uses_in_text(path.read_text()))
    return found


def _unused(rooms: dict[str, list[str]]) -> list[str]:
    used = _used()
    pairs = [(room, name) for room, names in rooms.items() for name in names]
    return [f"{room}.{name}" for room, name in pairs if (room, name) not in used]


def test_every_exported_name_is_used_outside_its_room():
    assert _unused(_rooms()) == []


def test_an_unused_name_is_noticed():
    extended = {"sealag.robot": ["Robot", "nonsense"], "sealag.passivity": ["_polygon"]}
    assert _unused(extended) == ["sealag.robot.nonsense", "sealag.passivity._polygon"]


def test_rooms_export_few_names():
    counts = {room: len(names) for room, names in _rooms().items()}
    assert sum(counts.values()) <= MOST, counts


def test_uses_in_code_are_found():
    text = (
        "import sealag\nfrom sealag import design\ndesign.certify\nsealag.margin.DelayedLoop(A, B)"
    )
    assert set(_uses_in_code(ast.parse(text))) >= {
        ("sealag.design", "certify"),
        ("sealag.margin", "DelayedLoop"),
    }


def test_uses_in_documentation_are_found():
    text = "`sealag.passivity.max_delay(J)`\n    from sealag.margin import a, b\n    sealag.load(x)"
    assert set(_uses_in_text(text)) >= {
        ("sealag.passivity", "max_delay"),
        ("sealag.margin", "a"),
        ("sealag.margin", "b"),
        ("sealag", "load"),
    }
