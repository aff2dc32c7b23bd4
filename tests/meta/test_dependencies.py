"""What is declared is imported, and what is imported is declared."""

import ast
import functools
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("src", "studies")
BESIDE = ("tests", "bench")
ELSEWHERE = ROOT / "bench/peers"
"""Scripts that run in environments of their own, which the benchmark builds."""
IN_CMEEL = {"pinocchio": "pin"}
"""Imports whose distribution Python does not find: cmeel keeps them in a prefix of its own."""
COMMANDS = {
    "ruff": "$(BIN)/ruff",
    "pyright": "$(BIN)/pyright",
    "import-linter": "$(BIN)/lint-imports",
    "pytest-xdist": "-n auto",
}
"""Packages that the Makefile runs, and how."""
NOT_IMPORTED = {
    "example-robot-data": "holds URDFs and no code",
    "daqp": "Pink's solver, asked for by name in bench/",
    "pandas": "sealag.extras imports it by name, where it is asked for",
    "control": "the same",
    "distributed": "the same",
    "xacro": "the optional extra of this name, which the library imports where it is there",
}


def normal(name: str) -> str:
    """Return a distribution's name as package indices spell it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def declared(requirements: Iterable[str]) -> set[str]:
    """Return the names in a list of requirements."""
    names = (re.match(r"[A-Za-z0-9._-]+", one) for one in requirements)
    return {normal(name.group()) for name in names if name}


def imports(source: str) -> Iterator[str]:
    """Yield the top-level modules that a source file imports by absolute name."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def own_modules() -> set[str]:
    """Return what the repository's own folders are imported as."""
    parents = [ROOT, *(ROOT / name for name in (*SHIPPED, *BESIDE))]
    return {path.name for parent in parents if parent.is_dir() for path in parent.iterdir()}


@functools.cache
def distributions(folders: tuple[str, ...]) -> set[str]:
    """Return the distributions that the sources in some folders import from."""
    own, owners = own_modules() | set(sys.stdlib_module_names), packages_distributions()
    modules = {
        module
        for folder in folders
        for path in (ROOT / folder).rglob("*.py")
        if ELSEWHERE not in path.parents
        for module in imports(path.read_text())
    }
    return {distribution(module, owners.get(module, [])) for module in modules - own}


def distribution(module: str, owners: list[str]) -> str:
    """Return the distribution of a module: the one of its own name if several hold parts of it."""
    names = sorted({normal(name) for name in owners})
    if module in IN_CMEEL:
        return IN_CMEEL[module]
    return normal(module) if normal(module) in names or not names else names[0]


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_shipped_code_imports_exactly_what_is_declared() -> None:
    needed, extras = project()["dependencies"], project()["optional-dependencies"]
    assert distributions(SHIPPED) == declared(needed) | declared(extras["xacro"])


def test_development_packages_are_imported_or_run() -> None:
    makefile = (ROOT / "Makefile").read_text()
    run = {name for name, words in COMMANDS.items() if words in makefile}
    extra = declared(project()["optional-dependencies"]["dev"])
    shipped = distributions(SHIPPED) - set(NOT_IMPORTED)
    assert distributions(BESIDE) - shipped == extra - run - set(NOT_IMPORTED)


def test_every_package_is_pinned() -> None:
    pins = declared((ROOT / "constraints.txt").read_text().splitlines())
    wanted = declared(project()["dependencies"])
    wanted |= declared(project()["optional-dependencies"]["dev"])
    assert wanted - pins == set()


def test_checks_see_an_import_and_a_requirement() -> None:
    assert set(imports("import numpy.linalg as la\nfrom cvxpy.atoms import norm\n")) == {
        "numpy",
        "cvxpy",
    }
    assert set(imports("from . import near\n")) == set()
    assert declared(["Foxglove_SDK>=0.10", "rich"]) == {"foxglove-sdk", "rich"}
    assert "foxglove-sdk" not in distributions(SHIPPED)
    assert "numpy" in distributions(SHIPPED)
