"""What is no matrix of real numbers is refused in one sentence that says why."""

import re

import numpy as np
import pytest

from sealag.errors import InputError
from sealag.margin import DelayedLoop


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "A_0 is nothing"),
        ("fast", "A_0 is no array of numbers (text)"),
        ([["a", "b"], ["c", "d"]], "A_0 is no array of numbers (text)"),
        ([[1.0, 2.0], [3.0]], "A_0 has rows of different lengths"),
        ([[1.0 + 2.0j]], "A_0 is complex"),
        ([[object()]], "A_0 is no array of numbers (object)"),
        ([[{"k": 1}]], "A_0 is no array of numbers (dict)"),
        ([[None]], "A_0 is no array of numbers (NoneType)"),
        (np.array([["2020-01-01"]], dtype="M8[D]"), "A_0 is no array of numbers (dates)"),
        ([[np.nan]], "A_0 has entries that are not finite"),
        ([[1.0, 2.0]], "A_0 has shape (1, 2)"),
        (3.0, "A_0 has shape ()"),
    ],
)
def test_sentence_says_what_is_wrong(value, words: str) -> None:
    for ask in (DelayedLoop.margin, lambda loop: loop.roots(0.1)):
        with pytest.raises(InputError) as refused:
            ask(DelayedLoop(value, [[1.0]]))
        assert str(refused.value).startswith(words)
        assert str(refused.value).endswith(".")


def test_other_arguments_are_checked_the_same_way() -> None:
    with pytest.raises(InputError, match="A_1 is nothing"):
        DelayedLoop([[1.0]], None).margin()  # type: ignore[arg-type]
    with pytest.raises(InputError, match="symmetries is no array of numbers"):
        DelayedLoop([[0.0]], [[0.0]], symmetries="yaw").margin()
    with pytest.raises(InputError, match="horizon is -1"):
        DelayedLoop([[0.0]], [[-1.0]]).margin(horizon=-1.0)
    with pytest.raises(InputError, match="delay is no array of numbers"):
        DelayedLoop([[0.0]], [[-1.0]]).roots("soon")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="A_0 is complex"):
        DelayedLoop(1j * np.ones((1, 1)), np.ones((1, 1))).margin()


def test_numbers_of_other_kinds_are_taken() -> None:
    from fractions import Fraction

    assert DelayedLoop([[0]], [[Fraction(-1)]]).margin().delay == pytest.approx(np.pi / 2)
    assert DelayedLoop([[False]], [[-1]]).margin().delay == pytest.approx(np.pi / 2)


def test_a_horizon_with_endless_crossings_names_one_that_is_short_enough() -> None:
    """A root crosses every 2π s: the list of 1e12 s would need terabytes."""
    with pytest.raises(
        InputError, match=r"horizon is 1e\+15 ms \(1e\+12 s\).* at most 10,000 are listed"
    ) as no:
        DelayedLoop([[0.0]], [[-1.0]]).margin(horizon=1e12)
    short = re.search(r"ask for (\S+) s \(--horizon-ms (\S+)\)", str(no.value))
    assert short is not None
    seconds, milliseconds = map(float, short.groups())
    assert milliseconds == pytest.approx(1e3 * seconds)
    assert 5_000 < len(DelayedLoop([[0.0]], [[-1.0]]).margin(horizon=seconds).intervals) <= 10_000
    slow_and_fast = np.diag([-1.0, -1e6])
    with pytest.raises(InputError, match=r"horizon is .* are listed"):
        DelayedLoop(0.0 * slow_and_fast, slow_and_fast).margin(intervals=True)
