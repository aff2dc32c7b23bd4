"""Tests, benchmarks, examples and studies use public names of the library only."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
USERS = ("tests", "bench", "examples", "studies")
AT_KERNELS = {
    "tests/reference/test_kernels_control_law.py",
    "tests/reference/test_kernels_plant.py",
    "tests/unit/test_gait_margin.py",
    "tests/unit/test_simulation_scenes.py",
}
"""Twins of kernels whose arrays only their room lays out, a plant that is broken on purpose, and a
walk that is saved, changed and restored."""
TEXT = re.compile(r"\bsealag(?:\.\w+)*\._[a-z]\w*")
"""A private module by its dotted name, also as text for monkeypatch."""


def private_names(source: str) -> list[str]:
    """Return what a source text takes from private modules of sealag."""
    found = TEXT.findall(source)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "sealag":
            names = (alias.name for alias in node.names)
            found += [f"{node.module}.{name}" for name in names if re.match("_[a-z]", name)]
    return found


def test_only_public_names_are_used() -> None:
    found = {
        str(path.relative_to(ROOT)): names
        for folder in USERS
        for path in (ROOT / folder).rglob("*.py")
        if "meta" not in path.parts and (names := private_names(path.read_text()))
    }
    assert set(found) <= AT_KERNELS


def test_check_sees_private_names() -> None:
    assert private_names("from sealag.passivity._definite import doubles") != []
    assert private_names("from sealag.report import _mcap as module") != []
    assert private_names("from sealag.report import (\n    McapRecorder,\n    _mcap,\n)") != []
    assert private_names('patch("sealag.cli._commands.load")') != []
    assert private_names("from sealag.report import read_recording\n_x = 1") == []
    assert private_names("import sealag.second_verifier") == []
