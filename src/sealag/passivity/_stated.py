"""What a certificate states: question, answer, and the evidence to check the answer by."""

from dataclasses import dataclass
from typing import Annotated

from sealag.passivity._kinds import Basis
from sealag.passivity._layout import SECTION, Matrix, Time
from sealag.passivity._local import LocalLoop
from sealag.passivity._proofs import InstantProof, Window
from sealag.passivity._statement import Answer, Question
from sealag.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The numbers from which the answer is checked.

    Attributes:
        time_s: (N,) instants.
        bounds_s: (N,) bound at each.
        instant_margins_s: (N,) local margin at each instant, or what is known not to exceed it.
        instant_basis: (N,) what each of these rests on.
        worst_motion: (2, n) real and imaginary part of the motor velocities y in the motion that
            turns active first at the worst instant: d |y* F y| = y* D_θ y = 1 at the supremum d.
        proofs: of the instants with the smallest bounds and those that bind the common multiplier.
        common_multiplier: (n, n) W of the bound with one multiplier, in joint coordinates.
        time_varying_multiplier: (n, n) W of the time-varying bound.
        time_varying_windows: its polytopes, each with the ball around it.
        local_loop: the frozen loop at the critical instant.
    """

    time_s: Annotated[Array, "N"]
    bounds_s: Annotated[tuple[Time, ...], "N"]
    instant_margins_s: Annotated[tuple[Time | None, ...], "N"]
    instant_basis: Annotated[tuple[Basis, ...], "N"]
    worst_motion: Annotated[Array, "2", "n"]
    proofs: tuple[InstantProof, ...]
    common_multiplier: Matrix | None
    time_varying_multiplier: Matrix | None
    time_varying_windows: tuple[Window, ...]
    local_loop: LocalLoop | None

    def proof_of(self, instant: int) -> InstantProof | None:
        """Return the proof of an instant, if there is one.

        Args:
            instant: its index.
        """
        return next((proof for proof in self.proofs if proof.instant == instant), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """The three parts of a certificate. In a file their fields stand side by side.

    Attributes:
        question: what was asked, and of which design.
        answer: what is claimed.
        evidence: the numbers from which the answer is checked.
    """

    question: Annotated[Question, SECTION]
    answer: Annotated[Answer, SECTION]
    evidence: Annotated[Evidence, SECTION]
