"""What the paper says, beside what is computed here."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """How a computed value, or a proof, stands to a published statement."""

    CONFIRMED = "confirmed"
    QUALIFIED = "qualified"
    CONTRADICTED = "contradicted"
    PROVEN = "proven"

    @classmethod
    def of(cls, cases: Iterable[object]) -> "Verdict":
        """Judge a statement by the cases in which it was looked at.

        Args:
            cases: for each whether the statement held; confirmed if all did, contradicted if none
                did, else qualified, as it is without any case.
        """
        held = [bool(case) for case in cases]
        if not held or (any(held) and not all(held)):
            return cls.QUALIFIED
        return cls.CONFIRMED if held[0] else cls.CONTRADICTED

    @classmethod
    def theorem(cls, cases: Iterable[object]) -> "Verdict":
        """Judge a statement that has a proof: the numbers only show that the code agrees.

        Args:
            cases: for each whether the statement held; one that did not is an error somewhere.
        """
        return cls.PROVEN if all(cases) else cls.CONTRADICTED


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
