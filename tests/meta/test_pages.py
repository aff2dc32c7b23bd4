"""Files that the pages name exist, and commands that they name are there."""

import re
from pathlib import Path

import pytest

from sealag.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
ROOTS = ("src/", "tests/", "docs/", "examples/", "bench/", "studies/", ".ci/", ".github/")


def named_paths(text: str) -> set[str]:
    """Return the repository's paths that a page names in code or links to."""
    code = re.findall(r"`([^`\n]+)`", text)
    words = [word for part in code for word in part.split() if word.startswith(ROOTS)]
    return {word.partition("::")[0].rstrip("/") for word in words}


def named_commands(text: str) -> set[str]:
    """Return the subcommands of sealag that a page names."""
    return set(re.findall(r"\bsealag ([a-z]+)\b", "\n".join(code_of(text))))


def code_of(text: str) -> list[str]:
    """Return code in a line and indented blocks."""
    return re.findall(r"`([^`\n]+)`", text) + re.findall(r"^ {4,}(.+)$", text, re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_files_exist(page: Path) -> None:
    lost = {path for path in named_paths(page.read_text()) if "<" not in path}
    assert {path for path in lost if not (ROOT / path).exists()} == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_linked_pages_exist(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_named_commands_exist(capsys: pytest.CaptureFixture[str]) -> None:
    named = set().union(*(named_commands(page.read_text()) for page in PAGES))
    assert {"certify", "verify", "cite"} <= named
    for command in sorted(named):
        with pytest.raises(SystemExit) as stop:
            main([command, "--help"])
        assert stop.value.code == 0, command
    capsys.readouterr()


def test_every_make_target_is_there() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    named = {
        word
        for page in PAGES
        for part in code_of(page.read_text())
        for word in re.findall(r"\bmake ([a-z-]+)", part)
    }
    assert named - targets == set()
    assert "test" in named & targets


def test_checks_see_what_is_lost() -> None:
    assert named_paths("see `src/sealag/none.py` and `python x`") == {"src/sealag/none.py"}
    assert named_commands("run `sealag nothing x.toml`") == {"nothing"}
