"""Claims of a certificate that follow from, or contradict, its other numbers."""

import math
import re
from collections.abc import Iterator

import numpy as np

from sealag.passivity._certificate import Basis, Certificate, Criterion, Proof, Status
from sealag.passivity._checks import Check
from sealag.passivity._inequalities import AGREEMENT, SYMMETRY, asymmetry
from sealag.passivity._local import coupled
from sealag.passivity._reading import Given
from sealag.typing import Array

_WORDS = {
    "feedback": ("motor", "static_joint", "static_joint_tank", "joint"),
    "gravity": ("feedback", "planned", "none"),
    "stiffness_form": ("symmetric", "published", "force"),
    "task_inertia": ("lambda_ts", "lambda_star"),
}
_BOUNDS = ("max_delay_s", "common_multiplier_delay_s", "time_varying_delay_s")
_HASHES = ("urdf", "project", "content")
_SILENT = 1e-12
"""Share of A_0 below which A_1 is rounding: differences of a law that feeds nothing back leave
1e-13, the softest law of an example 1e-3."""

_DIGEST = re.compile(r"[0-9a-f]{64}")
_KEY = re.compile(r"[a-z][a-z0-9_]{0,59}")
_VERSION = re.compile(r"[0-9A-Za-z][0-9A-Za-z.+_-]{0,59}")


def content_check(given: Given) -> Check:
    """Check that no digit differs from what was written: digest and form of every number.

    Args:
        given: the certificate as it was given.
    """
    if given.odd:
        detail = f"the number {given.odd[0]} is {float(given.odd[0])!r}"
    else:
        detail = "the digest agrees" if given.sealed else "the digest is of other content"
    return Check(name="content is as written", ok=given.sealed and not given.odd, detail=detail)


def claim_checks(c: Certificate) -> Iterator[Check]:
    """Check instants, smallest bound, verdict, and what else the file says of the motion.

    Args:
        c: the certificate.
    """
    yield from _labels(c)
    yield from _instants(c)
    yield from _margins(c)
    yield _verdict(c)
    yield _published(c)
    yield _conservatism(c)
    yield _unbounded(c)
    yield _contraction(c)
    yield _asymmetry(c)


def worst_proof(c: Certificate) -> Proof | None:
    """Return the proof of the instant that sets the bound, if there is one.

    Args:
        c: the certificate.
    """
    return next((proof for proof in c.proofs if proof.instant == c.worst.instant), None)


def _labels(c: Certificate) -> Iterator[Check]:
    """Words, digests, versions and keys are of the kinds that a certificate has."""
    bad = [key for key, words in _WORDS.items() if getattr(c, key) not in words]
    yield Check(name="words of the law", ok=not bad, detail=f"unknown: {bad}" if bad else "known")
    known = all(key in _HASHES and _DIGEST.fullmatch(value) for key, value in c.hashes.items())
    words = f"SHA-256 of {', '.join(c.hashes)}"
    yield Check(name="hashes", ok=known and "content" in c.hashes, detail=words)
    good = "sealag" in c.versions and all(
        _KEY.fullmatch(key) and _VERSION.fullmatch(value) for key, value in c.versions.items()
    )
    yield Check(name="versions", ok=good, detail=f"of {', '.join(c.versions)}")
    keys = [one.key for one in c.assumptions]
    named = len(set(keys)) == len(keys) > 0 and all(_KEY.fullmatch(key) for key in keys)
    said = all(one.text.strip() for one in c.assumptions) and all(map(str.strip, c.reasons))
    yield Check(name="assumptions", ok=named and said, detail=f"{len(keys)} with a name each")
    open_ = all(
        key in _BOUNDS and getattr(c, key) is not None and reason.strip()
        for key, reason in c.left_open.items()
    )
    yield Check(name="left open", ok=open_, detail=f"bounds: {', '.join(c.left_open) or 'none'}")
    positive = (c.D_theta, c.spring_stiffness, c.motor_inertia, c.rotor_inertia)
    least = [c.spring_damping, c.viscous_friction]
    drives = [w for w in c.torque_bandwidth if w is not None]
    good = all(v > 0.0 for values in (*positive, drives) for v in values)
    good &= all(v >= 0.0 for values in least for v in values)
    yield Check(
        name="damping, springs and drives", ok=good, detail=f"{len(c.joints)} joints, positive"
    )


def _instants(c: Certificate) -> Iterator[Check]:
    bounds, times, smallest = c.bounds_s, np.array(c.time_s), min(c.bounds_s)
    proven = [proof.instant for proof in c.proofs]
    yield Check(
        name="instants",
        ok=bool((np.diff(times) > 0.0).all()) and len(set(proven)) == len(proven),
        detail=f"{len(times)} times that increase, {len(proven)} proofs of different ones",
    )
    yield Check(
        name="smallest bound",
        ok=c.max_delay_s == smallest and smallest >= 0.0,
        detail=f"{c.max_delay_s:.9g} s claimed, {smallest:.9g} s in the list",
    )
    at = c.worst.instant
    yield Check(
        name="worst instant",
        ok=bounds[at] == smallest and times[at] == c.worst.time_s,
        detail=f"instant {at} at {c.worst.time_s} s",
    )
    yield Check(
        name="proof of the worst instant",
        ok=worst_proof(c) is not None or not 0.0 < c.max_delay_s < math.inf,
        detail=f"{len(proven)} instants have proofs",
    )
    shared = [c.common_multiplier_delay_s, c.time_varying_delay_s]
    known = [delay for delay in shared if delay is not None]
    yield Check(
        name="shared multipliers prove no more than each instant's own",
        ok=all(0.0 <= delay <= smallest * (1.0 + 1e-6) for delay in known)
        and (c.instants > 1 or not known),
        detail=f"{known} s, {smallest:.9g} s",
    )


def _margins(c: Certificate) -> Iterator[Check]:
    """What is said of all instants follows from what is said of each."""
    basis, margins = c.instant_basis, c.instant_margins_s
    exact = [m for m, b in zip(margins, basis) if b is Basis.EXACT and m is not None]
    floor = min(exact, default=None)
    held = all(
        (m is None) == (b is Basis.OPEN) and (m is None or m >= 0.0) for m, b in zip(margins, basis)
    )
    yield Check(
        name="margins of instants",
        ok=held and c.local_margin_s == floor,
        detail=f"{c.local_margin_s} s claimed, smallest exact one {floor} s",
    )
    yield Check(
        name="margins by bounds",
        ok=all(
            m == bound > 0.0 and c.criterion is Criterion.CERTIFIED and not coupled(c)
            for m, b, bound in zip(margins, basis, c.bounds_s)
            if b is Basis.BOUND
        )
        and all(
            m >= (floor or 0.0)
            for m, b in zip(margins, basis)
            if b in (Basis.BOUND, Basis.SEARCHED) and m is not None
        ),
        detail=f"{basis.count(Basis.BOUND)} instants: the passive bound of each; "
        f"{basis.count(Basis.SEARCHED)} searched for crossings; none below the smallest margin",
    )
    at = c.critical.instant
    yield Check(
        name="critical instant",
        ok=c.time_s[at] == c.critical.time_s and margins[at] == floor,
        detail=f"instant {at} at {c.critical.time_s} s",
    )
    expected = False if floor == 0.0 else (None if Basis.OPEN in basis else True)
    rests = c.equilibrium is not None and c.equilibrium.found
    yield Check(
        name="stable without delay",
        ok=(c.stable is expected and (c.unstable_modes > 0) == (floor == 0.0 and rests))
        or (c.stable is False and floor == 0.0 and not rests),
        detail=f"{c.stable} claimed with {c.unstable_modes} unstable modes",
    )
    rest = c.equilibrium
    yield Check(
        name="equilibrium",
        ok=(c.instants == 1 or rest is None) and (rest is None or rest.moved_rad >= 0.0),
        detail="none for a motion" if rest is None else f"{rest.moved_rad} rad away",
    )


def _verdict(c: Certificate) -> Check:
    """Status, reasons and delays agree; a bound of 0 is where a condition fails.

    A bound over the whole motion that a solver left open below the design's delay is no answer, and
    a law that loses its stability before its bound is not covered by it.
    """
    largest, delay, yes = c.max_delay_s, c.delay_s, not c.reasons
    shared = [getattr(c, name) for name in c.left_open if name in _BOUNDS[1:]]
    certified = c.criterion is Criterion.CERTIFIED
    covered = not certified or c.feedback != "joint"
    undercut = certified and any(
        m is not None and basis is Basis.EXACT and 0.0 < m < bound
        for m, basis, bound in zip(c.instant_margins_s, c.instant_basis, c.bounds_s)
    )
    rests = c.equilibrium is None or c.equilibrium.found
    enough = delay <= largest and all(bound is None or delay <= bound for bound in shared)
    return Check(
        name="verdict",
        ok=c.status is (Status.CERTIFIED if yes else Status.NOT_CERTIFIED)
        and delay >= 0.0
        and (yes == (enough and not undercut and rests) or (largest == 0.0 and not yes))
        and (covered or largest == 0.0),
        detail=f"{c.status} by the {c.criterion} criterion at {delay} s",
    )


def _published(c: Certificate) -> Check:
    if c.criterion is Criterion.PUBLISHED:
        same, detail = c.published_max_delay_s == c.max_delay_s, "it is this certificate's bound"
    else:
        same = c.published_max_delay_s >= 0.0
        detail = "the maker's word: its proof is a certificate by the published criterion"
    return Check(name="published bound", ok=same, detail=detail)


def _conservatism(c: Certificate) -> Check:
    """Margin over bound; at least 1 where a design is certified."""
    ratio, margin, largest = c.conservatism, c.local_margin_s or 0.0, c.max_delay_s
    expected = margin / largest if 0.0 < margin < math.inf and 0.0 < largest < math.inf else None
    passive = c.criterion == c.status == "certified"
    return Check(
        name="conservatism",
        ok=ratio == expected and not (passive and ratio is not None and ratio < 1.0),
        detail=f"local margin over bound is {ratio}",
    )


def _unbounded(c: Certificate) -> Check:
    """A bound without end is claimed only of a law that feeds nothing back."""
    endless = c.max_delay_s == math.inf
    silent = False
    if c.local_loop is not None:
        most, size = (np.abs(A).max(initial=0.0) for A in (c.local_loop.A_1, c.local_loop.A_0))
        silent = bool(most <= _SILENT * size)
    return Check(
        name="bound without end",
        ok=not endless or silent,
        detail="none is claimed" if not endless else "the frozen loop has no delayed part",
    )


def _shown(claimed: float, shown: float, *, complete: bool) -> bool:
    """Whether a largest value over a motion is not below what is shown, and equal if all is."""
    room = AGREEMENT * max(shown, 1.0)
    return claimed >= shown - room and (not complete or claimed <= shown + room)


def _asymmetry(c: Certificate) -> Check:
    shown = [asymmetry(np.array(proof.F)) for proof in c.proofs]
    most, claimed = max(shown, default=0.0), c.asymmetry
    proven = c.criterion is Criterion.CERTIFIED and c.max_delay_s > 0.0
    ok = not proven
    if claimed is not None:
        ok = _shown(claimed, most, complete=len(shown) == c.instants)
        ok &= not (proven and claimed > SYMMETRY)
    words = f"{claimed} claimed, {most:.2e} at {len(shown)} instants with a proof"
    return Check(name="asymmetry", ok=ok, detail=words)


def _contraction(c: Certificate) -> Check:
    """‖K^-½ F_q K^-½‖₂ with F_q = J*ᵀ S J* less the gravity gradient."""
    if c.criterion is not Criterion.CERTIFIED:
        words = "the maker's word: the published criterion has another S"
        return Check(name="contraction", ok=(c.contraction or 0.0) >= 0.0, detail=words)
    K = np.array(c.spring_stiffness)
    shown = [_factor(proof, K) for proof in c.proofs] if (K > 0.0).all() else [math.inf]
    most, claimed = max(shown, default=0.0), c.contraction
    needed = c.feedback == "static_joint" and c.max_delay_s > 0.0
    ok = not needed
    if claimed is not None:
        ok = _shown(claimed, most, complete=len(shown) == c.instants)
        ok &= not (needed and claimed >= 1.0)
    words = f"{claimed} claimed, {most:.6g} at {len(shown)} instants with a proof"
    return Check(name="contraction", ok=ok, detail=words)


def _factor(proof: Proof, K: Array) -> float:
    J, S, G = (np.array(part) for part in (proof.J_star, proof.stiffness, proof.F_gravity))
    return float(np.linalg.norm((J.T @ S @ J - G) / np.sqrt(np.outer(K, K)), 2))
