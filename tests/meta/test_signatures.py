"""Functions take at most ten parameters."""

import ast

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
