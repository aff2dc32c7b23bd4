"""The study is a guest: it imports public names of the library only, and is never imported."""

import ast

import pytest

from helpers.source import exported, imported, modules, tree


def _private(source: ast.AST) -> list[str]:
    """Imports from sealag that are no name of a room's, a module's or the package's `__all__`."""
    library = modules("sealag")
    found = []
    for module, name in imported(source):
        if module.split(".")[0] != "sealag":
            continue
        public = exported(tree(library[module])) if module in library else []
        if not name or module.count(".") > 1 or name not in public:
            found.append(f"{module}: {name or 'the module itself'}")
    return found


@pytest.mark.parametrize("module", modules("humanoids2016"))
def test_the_guest_imports_public_names_only(module):
    assert _private(tree(modules("humanoids2016")[module])) == []


@pytest.mark.parametrize(
    "line",
    [
        "from sealag.passivity._bounds import max_delay",
        "from sealag.walking import StepReferences",
        "from sealag.design import nonsense",
        "import sealag.kernels.motor",
        "def late():\n    from sealag.robot._tree import tree_of",
    ],
)
def test_a_private_import_is_noticed(line):
    assert len(_private(ast.parse(line))) == 1


def test_a_public_import_is_none():
    assert _private(ast.parse("from sealag.robot import Motion\nfrom sealag import load")) == []


def _hosted(source: ast.AST) -> bool:
    return any(module.split(".")[0] == "humanoids2016" for module, _ in imported(source))


def test_the_library_never_imports_the_guest():
    assert [name for name, path in modules("sealag").items() if _hosted(tree(path))] == []
    assert _hosted(ast.parse("def late():\n    from humanoids2016 import reproduce"))
