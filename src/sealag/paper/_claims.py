"""What the paper says, beside what is computed here."""

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """How a computed value stands to a published statement."""

    CONFIRMED = "confirmed"
    QUALIFIED = "qualified"
    CONTRADICTED = "contradicted"


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One published statement, checked.

    Attributes:
        key: a short name for links and tests.
        source: where the paper says it.
        published: what the paper says, in our words.
        computed: what was computed here, with numbers and units.
        verdict: whether the two agree; `qualified` when only under a condition that is stated.
        tolerance: what counted as agreement.
    """

    key: str
    source: str
    published: str
    computed: str
    verdict: Verdict
    tolerance: str
