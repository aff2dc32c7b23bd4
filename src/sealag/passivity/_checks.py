"""What a verification says."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

from sealag.passivity._kinds import Status


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that was checked.

    Attributes:
        name: what it is.
        ok: whether it holds.
        detail: numbers, or what is wrong.
    """

    name: str
    ok: bool
    detail: str

    def __post_init__(self) -> None:
        """Keep a plain truth value, which JSON can say."""
        object.__setattr__(self, "ok", bool(self.ok))


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Outcome of checking a certificate.

    Attributes:
        status: the verdict that the file states.
        exact: whether inequalities were decided in rational arithmetic.
        checks: everything that was checked.
    """

    status: Status
    exact: bool
    checks: tuple[Check, ...]

    @property
    def valid(self) -> bool:
        """Whether every check holds: then what the file says follows from its numbers."""
        return all(check.ok for check in self.checks)

    def extended(self, more: Iterable[tuple[str, bool, str]]) -> Self:
        """Return the outcome with further checks.

        Args:
            more: name, whether it holds, and detail of each.
        """
        found = (Check(name=name, ok=ok, detail=detail) for name, ok, detail in more)
        return replace(self, checks=(*self.checks, *found))

    def to_json_dict(self) -> dict[str, Any]:
        """Return the outcome as plain data with the key `valid`."""
        return {"valid": self.valid, **asdict(self)}
