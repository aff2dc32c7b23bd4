"""Multipliers that instants share: of a whole motion, and of polytopes around it."""

import math
from collections.abc import Iterator

import numpy as np

from sealag.passivity._checks import Check
from sealag.passivity._definite import Decision, Reader, as_doubles
from sealag.passivity._proofs import AGREEMENT, decided, dissipates, inequality
from sealag.passivity._stated import Stated
from sealag.typing import Array
from sealag.units import time_text


def _stated(name: str, longest: float | None, *, there: bool) -> Check:
    """A multiplier belongs to a positive finite delay, and only to one."""
    needed = longest is not None and 0.0 < longest < math.inf
    if longest is None:
        words = "not asked for" if not there else "it is there, but no delay is claimed for it"
    else:
        words = f"it is {'there' if there else 'missing'} for {time_text(longest)}"
    return Check(name=f"{name}, if claimed", ok=needed == there, detail=words)


def common_checks(c: Stated, number: Reader) -> Iterator[Check]:
    """Check the multiplier shared by all instants, at those whose numbers are in the file.

    Args:
        c: the certificate.
        number: how its numbers are read: doubles or rationals.
    """
    longest, W = c.answer.common_multiplier_delay_s, c.evidence.common_multiplier
    proofs, D_theta = c.evidence.proofs, c.question.D_theta
    yield _stated("common multiplier", longest, there=W is not None)
    if not longest or W is None or longest == math.inf:
        return

    def shared(F: Array, number: Reader) -> Decision:
        block = number(W)
        return dissipates(number(D_theta), number(longest)[()], M=number(F), W=[block], loss=block)

    bad = []
    for proof in proofs:
        found = decided(lambda number, F=proof.F: shared(F, number), number)
        here = inequality("", found, [W])
        bad += [] if here.ok else [f"instant {proof.instant}: {here.detail}"]
    good = f"[[2D - W, dF], [dF', W]] > 0 at each for {time_text(longest)}"
    yield Check(
        name=f"common multiplier at {len(proofs)} of {c.question.instants} instants",
        ok=not bad and bool(proofs),
        detail=bad[0] if bad else good,
    )


def window_checks(c: Stated, number: Reader) -> Iterator[Check]:
    """Check the time-varying bound: every vertex with the ball around it, in every window.

    ‖[D^-½C, d D^-½FC^-ᵀ]‖₂ ≤ √2 − r at the vertices, W = C Cᵀ, gives ≤ √2 in the whole window; it
    says [[(√2 − r)² D − W, dF], [dFᵀ, W]] ⪰ 0.

    Args:
        c: the certificate.
        number: how its numbers are read: doubles or rationals.
    """
    longest, W = c.answer.time_varying_delay_s, c.evidence.time_varying_multiplier
    windows = c.evidence.time_varying_windows
    yield _stated("time-varying multiplier", longest, there=W is not None)
    yield _stated("time-varying windows", longest, there=bool(windows))
    if not longest or W is None or not windows or longest == math.inf:
        return
    D, d, block = number(c.question.D_theta), number(longest)[()], number(W)
    bad, vertices = [] if bool((W == W.T).all()) else ["the multiplier is asymmetric"], 0
    for window in windows:
        place = f"instants {window.first} … {window.last}"
        if not (0.0 <= window.radius < 1.0 and window.first <= window.last):
            bad.append(f"{place} with radius {window.radius} are not a window")
            continue
        factor = number((math.sqrt(2.0) - window.radius) ** 2 * (1.0 - 1e-12))[()]
        for F in window.vertices(number):
            vertices += 1
            found = dissipates(D, d, M=F, W=[block], loss=block, factor=factor)
            bad += [] if found.holds else [f"{place}: {found.words}"]
    good = f"{vertices} vertices with their balls dissipate for {time_text(longest)}"
    yield Check(
        name=f"time-varying multiplier in all {len(windows)} windows",
        ok=not bad,
        detail=bad[0] if bad else good,
    )
    held = np.zeros(c.question.instants, dtype=bool)
    for window in windows:
        held[window.first : window.last + 1] = True
    text = f"{held.sum()} of {len(held)} instants lie in a window"
    yield Check(name="time-varying windows cover the motion", ok=bool(held.all()), detail=text)
    if not bad:
        yield _members(c, W=as_doubles(block), d=longest)


def _members(c: Stated, *, W: Array, d: float) -> Check:
    """That the instants with numbers lie in the sets, in doubles."""
    root, C = np.sqrt(c.question.D_theta), np.linalg.cholesky(W)
    proofs = c.evidence.proofs
    pairs = [
        (proof, window)
        for proof in proofs
        for window in c.evidence.time_varying_windows
        if window.first <= proof.instant <= window.last
    ]
    outside = []
    for proof, window in pairs:
        far = d * window.distance(proof.F, root=root, C=C)
        if not far <= window.radius + AGREEMENT:
            outside.append(f"instant {proof.instant} is {far:.3e} from its box")
    return Check(
        name=f"time-varying windows hold the {len(proofs)} instants with a proof",
        ok=not outside,
        detail=outside[0] if outside else f"{len(pairs)} memberships, floating point",
    )
