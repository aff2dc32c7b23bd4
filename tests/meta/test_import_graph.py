"""The import graph has no cycle, imports inside functions included."""

import ast
from graphlib import CycleError, TopologicalSorter

from helpers.source import imported, modules, tree


def _graph(files):
    """For each module the modules that it imports."""
    graph = {}
    for name, source in files.items():
        targets = set()
        for module, part in imported(source):
            full = f"{module}.{part}"
            targets.add(full if full in files else module)
        graph[name] = {target for target in targets if target in files and target != name}
    return graph


def _cycle(graph):
    """One cycle; empty if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_the_import_graph_has_no_cycle():
    files = {**modules("sealag"), **modules("humanoids2016")}
    assert _cycle(_graph({name: tree(path) for name, path in files.items()})) == []


def test_a_cycle_is_noticed():
    files = {
        "a": "from b import x",
        "b": "def late():\n    import c",
        "c": "from a import y",
    }
    trees = {name: ast.parse(text) for name, text in files.items()}
    assert set(_cycle(_graph(trees))) == set("abc")
    assert _cycle(_graph({"a": ast.parse("import b"), "b": ast.parse("")})) == []
