"""Each promise of docs/promises.md names a test that exists."""

import ast
import re

from helpers.source import ROOT

_NAMED = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")


def _missing(text):
    found = []
    for path, name in _NAMED.findall(text):
        file = ROOT / path
        names = set()
        if file.is_file():
            nodes = ast.walk(ast.parse(file.read_text()))
            names = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
        if name not in names:
            found.append(f"{path}::{name}")
    return found


def test_every_promise_names_a_test():
    text = (ROOT / "docs" / "promises.md").read_text()
    rows = [line for line in text.splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 10
    assert all(_NAMED.search(row) for row in rows)
    assert _missing(text) == []


def test_a_missing_test_is_noticed():
    assert _missing("`tests/unit/test_files.py::test_nothing`") != []
    assert _missing("`tests/unit/none.py::test_nothing`") != []
