"""Theory is shipped: every section that is cited exists, and every example in it runs."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
THEORY = ROOT / "docs/theory"
PAGES = sorted(THEORY.glob("*.md"))
NUMBER = r"\d+(?:\.\d+)?"
CITATION = re.compile(rf"docs/theory,? sections? ({NUMBER}(?:(?:, | and | to ){NUMBER})*)")


def headings(text: str) -> set[str]:
    """Return the numbers of a page's sections."""
    return set(re.findall(r"^#{2,3} (\d+(?:\.\d+)?)\.? ", text, flags=re.MULTILINE))


def cited(text: str) -> set[str]:
    """Return the numbers of the sections that a source text cites."""
    flat = re.sub(r"\s*\n\s*#?\s*", " ", text)
    return {number for found in CITATION.findall(flat) for number in re.findall(NUMBER, found)}


def examples() -> list[tuple[str, str]]:
    """Return page and code of every Python example."""
    found = []
    for page in PAGES:
        blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
        found += [(page.name, block) for block in blocks]
    return found


def test_every_cited_section_exists() -> None:
    there = set().union(*(headings(page.read_text()) for page in PAGES))
    found = {
        str(path.relative_to(ROOT)): cited(path.read_text())
        for folder in ("src", "tests", "studies", "bench")
        for path in (ROOT / folder).rglob("*.py")
        if path != Path(__file__)
    }
    assert {path: lost for path, numbers in found.items() if (lost := numbers - there)} == {}
    assert {"6", "7", "14"} <= set().union(*found.values()), "the control: citations are found"


def test_sections_are_numbered_once_and_listed() -> None:
    numbers = [n for page in PAGES for n in headings(page.read_text()) if "." not in n]
    assert sorted(map(int, numbers)) == list(range(1, len(numbers) + 1))
    index = (THEORY / "README.md").read_text()
    listed = dict(re.findall(r"^\| (\d+) \|.*\[(\w+\.md)\]", index, flags=re.MULTILINE))
    assert listed == {
        number: page.name
        for page in PAGES
        for number in headings(page.read_text())
        if "." not in number
    }


@pytest.mark.parametrize(("page", "code"), examples(), ids=lambda value: value[:12])
def test_example_runs(page: str, code: str) -> None:
    exec(compile(code, page, "exec"), {})


def test_checks_see_a_missing_section_and_a_broken_example() -> None:
    assert cited('"""Of docs/theory section\n    99, as printed."""') == {"99"}
    assert cited("as docs/theory sections 1 and 2.1 say") == {"1", "2.1"}
    assert "99" not in headings("## 9. Nine\n### 9.9 Nine of nine\n# 99. Not a section\n")
    assert len(examples()) >= 2
    wrong = next(code for _, code in examples() if "certified < exact" in code)
    with pytest.raises(AssertionError):
        exec(wrong.replace("certified < exact", "exact < certified"), {})
