"""Matrix inequalities of a certificate, each from the numbers in its file alone."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from sealag.passivity._certificate import Certificate, Criterion, Proof, Window
from sealag.passivity._checks import Check
from sealag.passivity._definite import (
    DOUBT,
    Reader,
    as_doubles,
    like,
    positive_complement,
    positive_definite,
    rationals,
    size,
)
from sealag.typing import Array

SYMMETRY = 1e-7
"""Relative asymmetry up to which a certified stiffness counts as symmetric."""

AGREEMENT = 1e-9
"""Relative difference up to which redundant numbers of a file agree (they were rounded)."""


def proof_checks(c: Certificate, number: Reader) -> Iterator[Check]:
    """Check every instant whose numbers are in the file, and the common multiplier at them.

    Args:
        c: the certificate.
        number: how its numbers are read: doubles or rationals.
    """
    D, K = number(c.D_theta), number(c.spring_stiffness)
    for proof in c.proofs:
        yield from _proof(c, proof, number, K=K)
    yield from _common(c, number, D=D)


def _proof(c: Certificate, proof: Proof, number: Reader, *, K: Array) -> Iterator[Check]:
    """One instant: delay, stiffness, multipliers."""
    name = f"instant {proof.instant}"
    J, S, G, F = (
        number(part) for part in (proof.J_star, proof.stiffness, proof.F_gravity, proof.F)
    )
    W, Q = ([number(block) for block in blocks] for blocks in (proof.W, proof.Q))
    yield Check(
        name=f"{name}: claimed delay",
        ok=c.bounds_s[proof.instant] == proof.delay_s and proof.delay_s > 0.0,
        detail=f"{proof.delay_s:.9g} s",
    )
    yield from _stiffness(name, c, J=J, S=S, G=G, F=F, K=K)
    if c.criterion is Criterion.PUBLISHED:
        apart = _apart(S, c.levels)
        words = f"no task stiffness between levels {c.levels}"
        yield Check(name=f"{name}: priority levels", ok=apart, detail=words)
    d = number([proof.delay_s])[0]
    gap = max(size(d * q - w) / max(size(w), 1e-300) for q, w in zip(Q, W, strict=True))
    yield Check(name=f"{name}: W = d Q", ok=gap <= AGREEMENT, detail=f"to {gap:.1e}")
    found = _multiplied(c, proof, number)
    if DOUBT in found.detail:
        found = _multiplied(c, proof, rationals)
    yield found


def _multiplied(c: Certificate, proof: Proof, number: Reader) -> Check:
    """The matrix inequality of one instant."""
    J, S, F = (number(part) for part in (proof.J_star, proof.stiffness, proof.F))
    W, terms = [number(block) for block in proof.W], None
    if c.criterion is Criterion.CERTIFIED:
        loss, M = W[0], F
    else:
        loss, M = _levels(J, S, W, c.levels)
        terms = _terms(proof, len(c.joints))
    return _inequality(
        f"instant {proof.instant}: matrix inequality",
        number(c.D_theta),
        number([proof.delay_s])[0],
        loss=loss,
        M=M,
        W=W,
        terms=terms,
    )


def _apart(S: Array, edges: Sequence[int]) -> bool:
    """Whether S couples no priority levels of (31)."""
    rest = S.copy()
    for first, after in pairwise(edges):
        rest[first:after, first:after] = 0 * S[first:after, first:after]
    return not any(value != 0 for value in rest.ravel())


def _levels(J: Array, S: Array, W: Sequence[Array], edges: Sequence[int]) -> tuple[Array, Array]:
    """Σ J_iᵀ W_i J_i and M_i = J_iᵀ S_i side by side."""
    rows = [slice(first, after) for first, after in pairwise(edges)]
    loss = sum(J[at].T @ block @ J[at] for at, block in zip(rows, W, strict=True))
    return loss, np.hstack([J[at].T @ S[at, at] for at in rows])  # pyright: ignore


def _terms(proof: Proof, n: int) -> tuple[Array, Array]:
    """Absolute sums behind Σ J_iᵀ W_i J_i and J*ᵀ S, for the rounding bound."""
    J, S = (np.abs(np.array(part)) for part in (proof.J_star, proof.stiffness))
    loss, first = np.zeros((n, n)), 0
    for block in proof.W:
        at = slice(first, first + len(block))
        loss += J[at].T @ np.abs(np.array(block)) @ J[at]
        first += len(block)
    return loss, J.T @ S


def _inequality(
    name: str,
    D: Array,
    d: Any,
    *,
    loss: Array,
    M: Array,
    W: Sequence[Array],
    terms: tuple[Array, Array] | None = None,
) -> Check:
    """Whether [[2D − loss, dM], [(dM)ᵀ, diag(W)]] ≻ 0 and every W_i is symmetric."""
    slack, ok = _dissipates(D, d, loss=loss, M=M, W=W, terms=terms)
    holds = ok and all(bool((block == block.T).all()) for block in W)
    words = "is" if holds else "is not"
    text = f"[[2D - J'WJ, dM], [dM', W]] {words} positive definite ({slack})"
    return Check(name=name, ok=holds, detail=text)


def _dissipates(
    D: Array,
    d: Any,
    *,
    loss: Array,
    M: Array,
    W: Sequence[Array],
    factor: Any = 2,
    terms: tuple[Array, Array] | None = None,
) -> tuple[str, bool]:
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


def _stiffness(
    name: str, c: Certificate, *, J: Array, S: Array, G: Array, F: Array, K: Array
) -> Iterator[Check]:
    """That F is the stiffness of the law that the file names."""
    certified = c.criterion is Criterion.CERTIFIED
    yield Check(
        name=f"{name}: gravity gradient",
        ok=c.gravity == "feedback" or size(G) == 0.0,
        detail=f"gravity compensation is {c.gravity}",
    )
    F_q = J.T @ S @ J - (G if certified else 0 * G)
    if certified and c.feedback == "static_joint":
        difference, scale = F - F @ (F_q / K[:, None]) - F_q, size(F) + size(F_q)
    else:
        difference, scale = F - F_q, size(F)
    yield Check(
        name=f"{name}: F follows from J*, S and K",
        ok=size(difference) <= AGREEMENT * scale,
        detail=f"relative difference {size(difference) / max(scale, 1e-300):.1e}",
    )
    if not certified:
        return
    skew = asymmetry(F)
    yield Check(name=f"{name}: F is symmetric", ok=skew <= SYMMETRY, detail=f"{skew:.1e}")
    shift = AGREEMENT * size(S) + 1e-300
    raised = (S + S.T) / 2 + like(S, shift * np.eye(len(S)))
    slack, ok = positive_definite(raised)
    crooked = size(S - S.T) / max(size(S), 1e-300)
    yield Check(
        name=f"{name}: task stiffness is symmetric positive semidefinite",
        ok=ok and crooked <= SYMMETRY,
        detail=f"asymmetry {crooked:.1e}, {slack}",
    )
    if c.feedback == "static_joint":
        even = (F_q + F_q.T) / 2
        ok = all(positive_definite(np.diag(K) + sign * even)[1] for sign in (-1, 1))
        yield Check(
            name=f"{name}: q̄(θ) contracts",
            ok=ok,
            detail="K - F_q and K + F_q are positive definite",
        )


def asymmetry(F: Array) -> float:
    """‖F − Fᵀ‖ / ‖F + Fᵀ‖, 0 for F = 0.

    Args:
        F: (n, n) doubles or rationals.
    """
    return size(F - F.T) / max(size(F + F.T), 1e-300)


def _common(c: Certificate, number: Reader, *, D: Array) -> Iterator[Check]:
    """The multiplier shared by all instants, at those whose numbers are in the file."""
    longest, W = c.common_multiplier_delay_s, c.common_multiplier
    yield _stated("common multiplier", longest, W is not None)
    if not longest or W is None or longest == math.inf:
        return
    d, blocks = number([longest])[0], [number(W)]
    bad = []
    for proof in c.proofs:
        F = number(proof.F)
        here = _inequality("", D, d, loss=blocks[0], M=F, W=blocks)
        if DOUBT in here.detail:
            here = _shared(c, longest, W, proof)
        bad += [] if here.ok else [f"instant {proof.instant}: {here.detail}"]
    yield Check(
        name=f"common multiplier at {len(c.proofs)} of {c.instants} instants",
        ok=not bad and bool(c.proofs),
        detail=bad[0] if bad else f"[[2D - W, dF], [dF', W]] > 0 at each for {longest:.9g} s",
    )


def _shared(c: Certificate, longest: float, W: list[list[float]], proof: Proof) -> Check:
    """The inequality with the shared multiplier, in rationals."""
    D, d, F, block = (rationals(part) for part in (c.D_theta, [longest], proof.F, W))
    return _inequality("", D, d[0], loss=block, M=F, W=[block])


def _stated(name: str, longest: float | None, there: bool) -> Check:
    """A multiplier belongs to a positive finite delay, and only to one."""
    needed = longest is not None and 0.0 < longest < math.inf
    words = f"{'there' if there else 'missing'} for a delay of {longest} s"
    return Check(name=f"{name} is stated", ok=needed == there, detail=words)


def window_checks(c: Certificate, number: Reader) -> Iterator[Check]:
    """Check the time-varying bound: every vertex with the ball around it, in every window.

    ‖[D^-½C, d D^-½FC^-ᵀ]‖₂ ≤ √2 − r at the vertices, W = C Cᵀ, gives ≤ √2 in the whole window; it
    says [[(√2 − r)² D − W, dF], [dFᵀ, W]] ⪰ 0.

    Args:
        c: the certificate.
        number: how its numbers are read: doubles or rationals.
    """
    longest, W = c.time_varying_delay_s, c.time_varying_multiplier
    windows = c.time_varying_windows
    yield _stated("time-varying multiplier", longest, W is not None)
    yield _stated("time-varying windows", longest, bool(windows))
    if not longest or W is None or not windows or longest == math.inf:
        return
    D, d, block = number(c.D_theta), number([longest])[0], number(W)
    bad, vertices = [] if bool((block == block.T).all()) else ["the multiplier is asymmetric"], 0
    for window in windows:
        place = f"instants {window.first} … {window.last}"
        if not (0.0 <= window.radius < 1.0 and window.first <= window.last):
            bad.append(f"{place} and radius {window.radius} are no window")
            continue
        factor = number([(math.sqrt(2.0) - window.radius) ** 2 * (1.0 - 1e-12)])[0]
        for F in _vertices(window, number):
            vertices += 1
            slack, ok = _dissipates(D, d, loss=block, M=F, W=[block], factor=factor)
            bad += [] if ok else [f"{place}: {slack}"]
    good = f"{vertices} vertices with their balls dissipate for {longest:.9g} s"
    yield Check(
        name=f"time-varying multiplier in all {len(windows)} windows",
        ok=not bad,
        detail=bad[0] if bad else good,
    )
    held = np.zeros(c.instants, dtype=bool)
    for window in windows:
        held[window.first : window.last + 1] = True
    text = f"{held.sum()} of {len(held)} instants lie in a window"
    yield Check(name="time-varying windows cover the motion", ok=bool(held.all()), detail=text)
    if not bad:
        yield _members(c, W=as_doubles(block), D=as_doubles(D), d=longest)


def _vertices(window: Window, number: Reader) -> Iterator[Array]:
    corners = [number(window.centre)]
    for values in window.axes:
        axis = number(values)
        corners = [corner + sign * axis for corner in corners for sign in (-1, 1)]
    yield from corners


def _members(c: Certificate, *, W: Array, D: Array, d: float) -> Check:
    """That the instants with numbers lie in the sets, in doubles."""
    root, C = np.sqrt(D), np.linalg.cholesky(W)
    outside, count = [], 0
    for proof in c.proofs:
        for window in c.time_varying_windows:
            if not window.first <= proof.instant <= window.last:
                continue
            count += 1
            rest = (np.array(proof.F) - np.array(window.centre)) / root[:, None]
            axes = [np.array(axis) / root[:, None] for axis in window.axes]
            if axes:
                basis = np.array([axis.ravel() for axis in axes]).T
                share = np.linalg.lstsq(basis, rest.ravel(), rcond=None)[0]
                rest = rest - (basis @ np.clip(share, -1.0, 1.0)).reshape(rest.shape)
            far = d * float(np.linalg.norm(np.linalg.solve(C, rest.T), 2))
            if not far <= window.radius + AGREEMENT:
                outside.append(f"instant {proof.instant} is {far:.3e} from its box")
    return Check(
        name=f"time-varying windows hold the {len(c.proofs)} instants with a proof",
        ok=not outside,
        detail=outside[0] if outside else f"{count} memberships, floating point",
    )
