"""Matrix inequalities of a certificate, each checked from its own numbers alone."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from sealag.passivity._checks import Check
from sealag.passivity._definite import (
    Decision,
    Reader,
    like,
    positive_complement,
    positive_definite,
    rationals,
    size,
)
from sealag.passivity._kinds import Criterion
from sealag.passivity._layout import Matrix
from sealag.passivity._statement import Question
from sealag.typing import Array
from sealag.units import time_text

SYMMETRY = 1e-7
"""Relative asymmetry up to which a certified stiffness counts as symmetric. Ten times less refuses
gradients of gravity from central differences; ten times more lets a loop gain energy."""

AGREEMENT = 1e-9
"""Relative difference up to which redundant numbers of a file agree. They were rounded: ten times
less accuses large robots, ten times more hides a changed seventh digit no better than this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstantProof:
    """The numbers from which one instant's bound can be checked again.

    With W_i = d Q_i ≻ 0 and

        [[2D − Σ J_iᵀ W_i J_i, d M_1, …, d M_k], [⋆, diag(W_1 … W_k)]] ⪰ 0

    the delayed loop dissipates for delays up to d: (29), or (31) for several priority levels, times
    −2. Criterion published: J_i are the levels' rows of J*, M_i = J_iᵀ S_i, and W_i is (m_i, m_i).
    Criterion certified: one multiplier in joint coordinates, J_1 = I, M_1 = F, W_1 is (n, n).

    Attributes:
        instant: index of the instant.
        delay_s: d, s.
        J_star: (m, n).
        stiffness: (m, m) task stiffness S.
        F_gravity: (n, n) gradient of the fed-back gravity compensation.
        F: (n, n) delayed stiffness −∂τ_osc/∂θ of the criterion.
        W: multipliers W_i.
        Q: multipliers Q_i = W_i / d of (29), (31) and of the storage function V_4.
    """

    instant: int
    delay_s: float
    J_star: Annotated[Array, "m", "n"]
    stiffness: Annotated[Array, "m", "m"]
    F_gravity: Matrix
    F: Matrix
    W: tuple[Annotated[Array, "", ""], ...]
    Q: tuple[Annotated[Array, "", ""], ...]

    def checks(self, question: Question, number: Reader, *, bound_s: float) -> Iterator[Check]:
        """Check the claimed delay, the law's stiffness F and the matrix inequality.

        Args:
            question: of the certificate that this proof is part of.
            number: how numbers are read: doubles or rationals.
            bound_s: the bound that is claimed for the instant, s.
        """
        name = f"instant {self.instant}"
        yield Check(
            name=f"{name}: claimed delay",
            ok=bound_s == self.delay_s and self.delay_s > 0.0,
            detail=time_text(self.delay_s),
        )
        yield from self._stiffness_checks(name, question, number)
        gap = max(
            size(self.delay_s * Q - W) / max(size(W), 1e-300)
            for Q, W in zip(self.Q, self.W, strict=True)
        )
        yield Check(name=f"{name}: W = d Q", ok=gap <= AGREEMENT, detail=f"to {gap:.1e}")
        found = decided(lambda number: self._dissipates(question, number), number)
        yield inequality(f"{name}: matrix inequality", found, self.W)

    def _dissipates(self, question: Question, number: Reader) -> Decision:
        """Decide [[2D − Σ J_iᵀ W_i J_i, d M], [⋆, diag(W)]] ≻ 0."""
        D, d = number(question.D_theta), number(self.delay_s)[()]
        W = [number(block) for block in self.W]
        if question.criterion is Criterion.CERTIFIED:
            return dissipates(D, d, M=number(self.F), W=W, loss=W[0])
        J, S = number(self.J_star), number(self.stiffness)
        rows = [slice(first, after) for first, after in pairwise(question.levels)]
        loss = np.sum([J[at].T @ block @ J[at] for at, block in zip(rows, W)], axis=0)
        M = np.hstack([J[at].T @ S[at, at] for at in rows])
        sizes = np.abs(self.J_star)
        terms = (
            np.sum([sizes[at].T @ np.abs(B) @ sizes[at] for at, B in zip(rows, self.W)], axis=0),
            sizes.T @ np.abs(self.stiffness),
        )
        return dissipates(D, d, M=M, W=W, loss=loss, terms=terms)

    def _stiffness_checks(self, name: str, question: Question, number: Reader) -> Iterator[Check]:
        """Check that F is the stiffness of the law that the file names."""
        J, S, G, F = map(number, (self.J_star, self.stiffness, self.F_gravity, self.F))
        certified = question.criterion is Criterion.CERTIFIED
        yield Check(
            name=f"{name}: gravity gradient",
            ok=question.gravity == "feedback" or size(G) == 0.0,
            detail=f"gravity compensation is {question.gravity}",
        )
        if not certified:
            yield from _law_checks(name, F, J.T @ S @ J)
            apart = not any(value != 0 for value in _between(S, question.levels).ravel())
            words = f"no task stiffness between levels {list(question.levels)}"
            yield Check(name=f"{name}: priority levels", ok=apart, detail=words)
            return
        F_q, K = J.T @ S @ J - G, number(question.spring_stiffness)
        static = question.feedback == "static_joint"
        yield from _law_checks(name, F, F_q, K if static else None)
        skew = asymmetry(F)
        yield Check(name=f"{name}: F is symmetric", ok=skew <= SYMMETRY, detail=f"{skew:.1e}")
        raised = (S + S.T) / 2 + like(S, (AGREEMENT * size(S) + 1e-300) * np.eye(len(S)))
        found, skew = positive_definite(raised), size(S - S.T) / max(size(S), 1e-300)
        yield Check(
            name=f"{name}: task stiffness is symmetric positive semidefinite",
            ok=found.holds and skew <= SYMMETRY,
            detail=f"asymmetry {skew:.1e}, {found.words}",
        )
        if static:
            even = (F_q + F_q.T) / 2
            ok = all(positive_definite(np.diag(K) + sign * even).holds for sign in (-1, 1))
            words = "K - F_q and K + F_q are positive definite"
            yield Check(name=f"{name}: q̄(θ) contracts", ok=ok, detail=words)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A set of delayed stiffnesses that holds a window of the motion.

    All F = centre + Σ c_k axis_k + Δ with |c_k| ≤ 1 and ‖d D^-½ Δ W^-½‖₂ ≤ radius, where d and W
    are delay and multiplier of the time-varying bound.

    Attributes:
        first: first instant.
        last: last instant.
        centre: (n, n) Nm/rad.
        axes: (k, n, n) half edges of the box, Nm/rad.
        radius: of the ball around it.
    """

    first: int
    last: int
    centre: Matrix
    axes: Annotated[Array, "", "n", "n"]
    radius: float

    def vertices(self, number: Reader) -> Iterator[Array]:
        """Yield the corners of the box, (n, n) each.

        Args:
            number: how numbers are read: doubles or rationals.
        """
        corners = [number(self.centre)]
        for values in self.axes:
            axis = number(values)
            corners = [corner + sign * axis for corner in corners for sign in (-1, 1)]
        yield from corners

    def distance(self, F: Array, *, root: Array, C: Array) -> float:
        """Return ‖D^-½ Δ W^-½‖₂ of a stiffness from the box, in doubles.

        Args:
            F: (n, n) the stiffness.
            root: (n,) D^½.
            C: (n, n) with W = C Cᵀ.
        """
        rest = (F - self.centre) / root[:, None]
        if len(self.axes):
            basis = (self.axes / root[:, None]).reshape(len(self.axes), -1).T
            share = np.linalg.lstsq(basis, rest.ravel(), rcond=None)[0]
            rest = rest - (basis @ np.clip(share, -1.0, 1.0)).reshape(rest.shape)
        return float(np.linalg.norm(np.linalg.solve(C, rest.T), 2))


def _law_checks(name: str, F: Array, F_q: Array, K: Array | None = None) -> Iterator[Check]:
    """F = F_q, or F (I − K⁻¹ F_q) = F_q where q̄(θ) is fed back."""
    if K is None:
        gap, scale = size(F - F_q), size(F)
    else:
        gap, scale = size(F - F @ (F_q / K[:, None]) - F_q), size(F) + size(F_q)
    yield Check(
        name=f"{name}: F follows from J*, S and K",
        ok=gap <= AGREEMENT * scale,
        detail=f"relative difference {gap / max(scale, 1e-300):.1e}",
    )


def _between(S: Array, edges: Sequence[int]) -> Array:
    """S without the blocks of the priority levels."""
    rest = S.copy()
    for first, after in pairwise(edges):
        rest[first:after, first:after] = 0 * S[first:after, first:after]
    return rest


def asymmetry(F: Array) -> float:
    """‖F − Fᵀ‖ / ‖F + Fᵀ‖, 0 for F = 0.

    Args:
        F: (n, n) doubles or rationals.
    """
    return size(F - F.T) / max(size(F + F.T), 1e-300)


def decided(decide: Callable[[Reader], Decision], number: Reader) -> Decision:
    """Decide with the given numbers, and in rationals where rounding leaves it open.

    Args:
        decide: decides from numbers that a reader reads.
        number: doubles or rationals.
    """
    found = decide(number)
    return decide(rationals) if found.doubtful else found


def dissipates(
    D: Array,
    d: Any,
    *,
    M: Array,
    W: Sequence[Array],
    loss: Array,
    factor: Any = 2,
    terms: tuple[Any, Array] | None = None,
) -> Decision:
    """Decide [[factor D − loss, d M], [d Mᵀ, diag(W)]] ≻ 0.

    Args:
        D: (n,) motor damping.
        d: delay, s.
        M: (n, m).
        W: blocks, (m_i, m_i) each.
        loss: (n, n).
        factor: 2, or less where a ball around M is to be covered.
        terms: sums of the absolute values that loss and M were added up from; their own absolute
            values if None.
    """
    m = M.shape[1]
    whole, first = like(M, np.zeros((m, m))), 0
    for block in W:
        whole[first : first + len(block), first : first + len(block)] = block
        first += len(block)
    if M.dtype == object:
        corner = np.diag(factor * D) - loss
        return positive_definite(np.block([[corner, d * M], [(d * M).T, whole]]))
    loss_terms, M_terms = (np.abs(loss), np.abs(M)) if terms is None else terms
    return positive_complement(factor * D, loss, d * M, whole, terms=(loss_terms, d * M_terms))


def inequality(name: str, found: Decision, W: Sequence[Array]) -> Check:
    """Say whether the inequality holds with symmetric multipliers.

    Args:
        name: of the check.
        found: what `dissipates` decides.
        W: the multipliers.
    """
    holds = found.holds and all(bool((block == block.T).all()) for block in W)
    text = f"[[2D - J'WJ, dM], [dM', W]] {'is' if holds else 'is not'} positive definite"
    return Check(name=name, ok=holds, detail=f"{text} ({found.words})")
