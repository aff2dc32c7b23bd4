"""Source files of the repository, as syntax trees."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"sealag": ROOT / "src", "humanoids2016": ROOT / "studies"}
"""The folder that holds each shipped package."""


@cache
def modules(package: str) -> dict[str, Path]:
    """Return the files of a shipped package by their dotted names.

    Args:
        package: sealag or humanoids2016.
    """
    base = PACKAGES[package]
    found = {}
    for path in sorted((base / package).rglob("*.py")):
        parts = path.relative_to(base).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def tree(path: Path) -> ast.Module:
    """Return the syntax tree of a file.

    Args:
        path: the file.
    """
    return ast.parse(path.read_text(), filename=str(path))


def imported(source: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield module and name of every import, those inside functions too; name "" for `import x`.

    Args:
        source: a syntax tree.
    """
    for node in ast.walk(source):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for alias in node.names:
                yield node.module, alias.name
        elif isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ""


def exported(source: ast.Module) -> list[str]:
    """Return a module's `__all__`; empty if it has none.

    Args:
        source: its syntax tree.
    """
    for node in source.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    return []
