"""Every numbered part of the paper has a row in the article."""

import re

import pytest

from humanoids2016 import ROWS

PARTS = [row.part for row in ROWS]


def equations(parts):
    numbers = set()
    for part in parts:
        for first, last in re.findall(r"\((\d+)\)(?:–\((\d+)\))?", part):
            numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def test_equations_1_to_31_have_a_row():
    assert equations(PARTS) == set(range(1, 32))
    assert equations(PARTS[1:]) != set(range(1, 32))


@pytest.mark.parametrize(
    "part",
    [
        "Theorem 1", "Corollary 1", "Assumptions 1, 2", "Assumption 3", "Assumption 4", "Remark 1",
        "Remark 2", "Figs. 1–3", "Fig. 4", "Fig. 5", "Conclusion 1", "Conclusion 2", "Conclusion 3",
        "Future work (i)", "Future work (ii)", "Future work (iii)", "Future work (iv)",
    ],
)  # fmt: skip
def test_everything_else_has_one(part):
    assert any(part in one for one in PARTS)


def test_each_row_says_where():
    for row in ROWS:
        assert len(row.says) > 5
        assert len(row.here) > 5
