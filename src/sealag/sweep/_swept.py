"""What a dataset comes to: counts, and the range of the number that counts."""

import math
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sealag.sweep._dataset import Dataset
from sealag.sweep._job import ERROR, FAILURE, KIND
from sealag.sweep._question import Question


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """What a sweep comes to.

    Attributes:
        folder: the dataset.
        points: how many rows it has.
        computed: how many of them this run has computed.
        refused: how many have a reason instead of an answer.
        refusal: the reason of the first of these; None if there is none.
        failed: how many of these the tool itself failed at.
        verdict: the column whose words are counted; None if there is none.
        verdicts: how often each verdict was given.
        column: the number that counts.
        smallest: the smallest of it that is finite; None if there is none.
        largest: the largest.
    """

    folder: Path
    points: int
    computed: int
    refused: int
    refusal: str | None
    failed: int
    verdict: str | None
    verdicts: dict[str, int]
    column: str
    smallest: float | None
    largest: float | None

    def summary(self) -> dict[str, Any]:
        """Return everything as JSON says it."""
        return {**asdict(self), "folder": str(self.folder)}


def summed_up(dataset: Dataset, question: Question, *, computed: int) -> Swept:
    """Go through a dataset once.

    Args:
        dataset: the dataset.
        question: what was asked.
        computed: how many points were computed now.
    """
    verdicts: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    points, low, high, refusal = 0, math.inf, -math.inf, None
    names = [KIND, ERROR, question.headline, *([question.verdict] if question.verdict else [])]
    for part in dataset.read(names):
        points += len(part[KIND])
        kinds.update(kind for kind in part[KIND] if kind is not None)
        refusal = refusal or next((one for one in part[ERROR] if one is not None), None)
        if question.verdict is not None:
            verdicts.update(str(one) for one in part[question.verdict] if one is not None)
        finite = [x for x in part[question.headline] if x is not None and math.isfinite(x)]
        low, high = min([low, *finite]), max([high, *finite])
    known = low <= high
    return Swept(
        folder=dataset.folder,
        points=points,
        computed=computed,
        refused=kinds.total(),
        refusal=refusal,
        failed=kinds[FAILURE],
        verdict=question.verdict,
        verdicts=dict(sorted(verdicts.items())),
        column=question.headline,
        smallest=low if known else None,
        largest=high if known else None,
    )
