"""Functions take at most ten parameters, and show their types by short names."""

import ast
import contextlib
import importlib
import inspect
import re

import numpy
import numpy.typing
import pytest

from helpers.source import modules, tree

MOST = 10


def _long(source: ast.AST) -> list[str]:
    """Functions with more parameters than that; `self` and `cls` do not count."""
    found = []
    for node in ast.walk(source):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            names = [part.arg for part in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            names += [part.arg for part in (given.vararg, given.kwarg) if part]
            if len([name for name in names if name not in {"self", "cls"}]) > MOST:
                found.append(node.name)
    return found


@pytest.mark.parametrize("package", ["sealag", "humanoids2016"])
def test_no_function_has_more_than_ten_parameters(package):
    long = {name: _long(tree(path)) for name, path in modules(package).items()}
    assert {name: functions for name, functions in long.items() if functions} == {}


def test_an_eleventh_parameter_is_noticed():
    ten = ", ".join(f"p{k}" for k in range(10))
    assert _long(ast.parse(f"def f({ten}): ...")) == []
    assert _long(ast.parse(f"def f({ten}, *, p10): ...")) == ["f"]
    assert _long(ast.parse(f"class C:\n    def f(self, {ten}): ...")) == []
    assert _long(ast.parse(f"class C:\n    def f(self, {ten}, **more): ...")) == ["f"]


EXPANDED = re.compile(r"numpy\._typing|ndarray\[|dtype\[|_NestedSequence")
"""What a reader of `help` sees where an alias of arrays has lost its name."""


def _shown(thing: object) -> list[str]:
    """The signatures of a class with its methods, or of a function."""
    found = [thing]
    if inspect.isclass(thing):
        found += [
            part.fget if isinstance(part, property) else getattr(part, "__func__", part)
            for name, part in vars(thing).items()
            if not name.startswith("_")
        ]
    texts = []
    for one in found:
        if inspect.isfunction(one) or (inspect.isclass(one) and not issubclass(one, Exception)):
            with contextlib.suppress(ValueError):  # enumerations have none
                texts.append(f"{getattr(one, '__qualname__', one)}{inspect.signature(one)}")
    return texts


def _of_rooms() -> list[str]:
    return [
        text
        for room in (name for name in modules("sealag") if name.count(".") == 1)
        for name in getattr(importlib.import_module(room), "__all__", ())
        for text in _shown(getattr(importlib.import_module(room), name))
    ]


def test_signatures_name_their_arrays():
    texts = _of_rooms()
    assert len(texts) > 200
    assert any("A_0: ArrayLike" in text for text in texts)
    assert [text for text in texts if EXPANDED.search(text)] == []


def test_an_expanded_union_is_noticed():
    def wide(a: numpy.typing.ArrayLike, b: numpy.typing.NDArray[numpy.float64]): ...

    (text,) = _shown(wide)
    assert EXPANDED.search(text)
