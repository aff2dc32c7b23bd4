"""Claims of a certificate that follow from, or contradict, its other numbers."""

import math
import re
from collections.abc import Iterator

import numpy as np

from sealag.passivity._checks import Check
from sealag.passivity._kinds import Basis, Criterion, Status
from sealag.passivity._proofs import AGREEMENT, SYMMETRY, asymmetry
from sealag.passivity._stated import Stated
from sealag.passivity._statement import Rest
from sealag.units import time_text

_FEEDBACK = ("motor", "static_joint", "static_joint_tank", "joint")
_GRAVITY = ("feedback", "planned", "none")
_FORM = ("symmetric", "published", "force")
_INERTIA = ("lambda_ts", "lambda_star")
_HASHES = ("urdf", "project", "content")

_NO_FEEDBACK = 1e-12
"""Share of A_0 below which A_1 is rounding: differences of a law without stiffness leave 1e-13, the
softest law of an example 1e-3."""

_SHARED = 1e-6
"""How far one multiplier's delay may exceed an instant's own: the relative width of both."""

_DIGEST = re.compile(r"[0-9a-f]{64}")
_KEY = re.compile(r"[a-z][a-z0-9_]{0,59}")
_VERSION = re.compile(r"[0-9A-Za-z][0-9A-Za-z.+_-]{0,255}")


def claim_checks(c: Stated) -> Iterator[Check]:
    """Check instants, smallest bound, verdict, and what else the file says of the motion.

    Args:
        c: the certificate.
    """
    yield from _label_checks(c)
    yield _drives(c)
    yield from _bound_checks(c)
    yield _shared(c)
    yield from _margin_checks(c)
    if c.evidence.local_loop is None:
        yield _no_loop(c)
    yield _verdict(c)
    yield _published(c)
    yield _conservatism(c)
    yield _unbounded(c)
    yield _contraction(c)
    yield _asymmetry(c)


def _label_checks(c: Stated) -> Iterator[Check]:
    """Words, digests, versions and keys are of the kinds that a certificate has."""
    question, answer = c.question, c.answer
    known = question.feedback in _FEEDBACK and question.gravity in _GRAVITY
    known &= question.stiffness_form in _FORM and question.task_inertia in _INERTIA
    words = f"{question.feedback}, {question.gravity}, {question.stiffness_form}, "
    yield Check(name="words of the law", ok=known, detail=words + question.task_inertia)
    hashes = question.hashes
    known = all(key in _HASHES and _DIGEST.fullmatch(value) for key, value in hashes.items())
    words = f"SHA-256 of {', '.join(hashes)}"
    yield Check(name="hashes", ok=known and "content" in hashes, detail=words)
    good = "sealag" in answer.versions and all(
        _KEY.fullmatch(key) and _VERSION.fullmatch(value) for key, value in answer.versions.items()
    )
    yield Check(name="versions", ok=good, detail=f"of {', '.join(answer.versions)}")
    told = dict(answer.holds_for) == question.criterion.holds_for()
    words = "words of the three numbers" if told else "other words than those of the criterion"
    yield Check(name="what each number holds for", ok=told, detail=words)
    keys = [one.key for one in answer.assumptions]
    named = len(set(keys)) == len(keys) > 0 and all(_KEY.fullmatch(key) for key in keys)
    said = all(
        text.strip() for text in (*(one.text for one in answer.assumptions), *answer.reasons)
    )
    yield Check(name="assumptions", ok=named and said, detail=f"{len(keys)} with a name each")
    asked = _bounds_asked(c)
    open_ = all(asked.get(key) is not None and why.strip() for key, why in answer.left_open.items())
    words = f"by a solver: {', '.join(answer.left_open) or 'none'}"
    yield Check(name="bounds left open", ok=open_, detail=words)


def _bounds_asked(c: Stated) -> dict[str, float | None]:
    """Bounds that a solver may leave open, by their names in the file."""
    return {
        "max_delay_s": c.answer.max_delay_s,
        "common_multiplier_delay_s": c.answer.common_multiplier_delay_s,
        "time_varying_delay_s": c.answer.time_varying_delay_s,
    }


def _drives(c: Stated) -> Check:
    q = c.question
    drives = np.array([w for w in q.torque_bandwidth if w is not None])
    positive = (q.D_theta, q.spring_stiffness, q.motor_inertia, q.rotor_inertia, drives)
    good = all((values > 0.0).all() for values in positive)
    good &= bool((q.spring_damping >= 0.0).all() and (q.viscous_friction >= 0.0).all())
    words = f"of {len(q.joints)} joints, positive"
    return Check(name="damping, springs and drives", ok=good, detail=words)


def _bound_checks(c: Stated) -> Iterator[Check]:
    answer, evidence = c.answer, c.evidence
    times, smallest = evidence.time_s, min(evidence.bounds_s)
    proven = [proof.instant for proof in evidence.proofs]
    yield Check(
        name="instants",
        ok=bool((np.diff(times) > 0.0).all()) and len(set(proven)) == len(proven),
        detail=f"{len(times)} times that increase, {len(proven)} proofs of different ones",
    )
    yield Check(
        name="smallest bound",
        ok=answer.max_delay_s == smallest and smallest >= 0.0,
        detail=f"{time_text(answer.max_delay_s)} claimed, {time_text(smallest)} in the list",
    )
    at = answer.worst.instant
    yield Check(
        name="worst instant",
        ok=evidence.bounds_s[at] == smallest and times[at] == answer.worst.time_s,
        detail=f"instant {at} at {answer.worst.time_s} s",
    )
    yield Check(
        name="proof of the worst instant",
        ok=at in proven or not 0.0 < answer.max_delay_s < math.inf,
        detail=f"{len(proven)} instants have proofs",
    )


def _shared(c: Stated) -> Check:
    """One multiplier for many instants proves no longer delay than each instant's own."""
    both = (c.answer.common_multiplier_delay_s, c.answer.time_varying_delay_s)
    known, smallest = [delay for delay in both if delay is not None], min(c.evidence.bounds_s)
    ok = all(0.0 <= delay <= smallest * (1.0 + _SHARED) for delay in known)
    claims = f"{' and '.join(map(time_text, known))} claimed" if known else "none is claimed"
    return Check(
        name="shared multipliers prove no more than each instant's own",
        ok=ok and (c.question.instants > 1 or not known),
        detail=f"{claims}, the smallest bound is {time_text(smallest)}",
    )


def _margin_checks(c: Stated) -> Iterator[Check]:
    """What is said of all instants follows from what is said of each."""
    answer, evidence = c.answer, c.evidence
    basis, margins = evidence.instant_basis, evidence.instant_margins_s
    exact = [m for m, b in zip(margins, basis) if b is Basis.EXACT and m is not None]
    floor = min(exact, default=None)
    held = all(
        (m is None) == (b is Basis.OPEN) and (m is None or m >= 0.0) for m, b in zip(margins, basis)
    )
    claimed, found = time_text(answer.local_margin_s), time_text(floor)
    yield Check(
        name="margins of instants",
        ok=held and answer.local_margin_s == floor,
        detail=f"{claimed} claimed, smallest exact one {found}",
    )
    yield _inexact_margins(c, floor or 0.0)
    at = answer.critical.instant
    yield Check(
        name="critical instant",
        ok=evidence.time_s[at] == answer.critical.time_s and margins[at] == floor,
        detail=f"instant {at} at {answer.critical.time_s} s",
    )
    expected = False if floor == 0.0 else (None if Basis.OPEN in basis else True)
    rest = answer.equilibrium
    rests = rest is not None and rest.found
    ok = answer.stable is expected and (answer.unstable_modes > 0) == (floor == 0.0 and rests)
    ok |= answer.stable is False and floor == 0.0 and not rests
    stable = "not known" if answer.stable is None else "stable" if answer.stable else "not stable"
    words = f"{stable}, with {answer.unstable_modes} unstable modes"
    yield Check(name="stable without delay", ok=ok, detail=words)
    yield Check(
        name="equilibrium",
        ok=(c.question.instants == 1 or rest is None) and (rest is None or rest.moved_rad >= 0.0),
        detail=_resting(rest),
    )


def _resting(rest: Rest | None) -> str:
    if rest is None:
        return "none for a motion"
    return f"{rest.moved_rad:.3g} rad away" if rest.found else "none near the posture"


def _inexact_margins(c: Stated, floor: float) -> Check:
    """Instants decided by their bound have it as margin; no instant lies below the smallest."""
    evidence, loop = c.evidence, c.evidence.local_loop
    basis, margins = evidence.instant_basis, evidence.instant_margins_s
    coupled = loop is not None and loop.coupled(c.question)
    bounded = c.question.criterion is Criterion.CERTIFIED and not coupled
    good = all(
        m == bound > 0.0 and bounded
        for m, b, bound in zip(margins, basis, evidence.bounds_s)
        if b is Basis.BOUND
    )
    inexact = (Basis.BOUND, Basis.SEARCHED)
    good &= all(m >= floor for m, b in zip(margins, basis) if b in inexact and m is not None)
    return Check(
        name="margins by bounds",
        ok=good,
        detail=f"{basis.count(Basis.BOUND)} instants by their passive bound, "
        f"{basis.count(Basis.SEARCHED)} by a search for crossings; none below the smallest margin",
    )


def _no_loop(c: Stated) -> Check:
    """Nothing is claimed of a loop that is not in the file."""
    answer, at = c.answer, c.answer.critical.instant
    rests = answer.equilibrium is not None and answer.equilibrium.found
    none = c.evidence.instant_margins_s[at] == 0.0 and not rests
    known = c.evidence.instant_basis[at] is not Basis.OPEN and not none
    ok = not known and answer.unstable_modes == 0 and answer.first_crossing_s is None
    ok &= answer.jitter_margin_s is None or (none and answer.jitter_margin_s == 0.0)
    words = "no frozen loop is in the file, and nothing is claimed of it"
    return Check(name="frozen loop", ok=ok, detail=words)


def _verdict(c: Stated) -> Check:
    """Status, reasons and delays agree; a bound of 0 is where a condition of the criterion fails.

    A bound over the whole motion that a solver left open below the design's delay decides nothing,
    and a law that loses its stability before its bound is not covered by it. What is passive is
    certified only if it is stable, without delay and up to the design's.
    """
    question, answer, evidence = c.question, c.answer, c.evidence
    largest, delay = answer.max_delay_s, question.delay_s
    asked = _bounds_asked(c)
    shared = [asked.get(name) for name in answer.left_open if name != "max_delay_s"]
    certified = question.criterion is Criterion.CERTIFIED
    covered = not certified or question.feedback != "joint"
    exact = [
        (m, bound)
        for m, basis, bound in zip(
            evidence.instant_margins_s, evidence.instant_basis, evidence.bounds_s
        )
        if m is not None and basis is Basis.EXACT
    ]
    undercut = certified and any(0.0 < m < bound for m, bound in exact)
    lost = any(0.0 < m <= delay for m, _ in exact)
    enough = delay <= largest and all(bound is None or delay <= bound for bound in shared)
    rests = answer.equilibrium is None or answer.equilibrium.found
    if not enough or largest == 0.0 or undercut or lost:
        status = Status.NOT_CERTIFIED
    else:
        status = Status.CERTIFIED if answer.stable is True and rests else Status.PASSIVE_ONLY
    return Check(
        name="verdict",
        ok=answer.status is status
        and delay >= 0.0
        and bool(answer.reasons) == (status is not Status.CERTIFIED)
        and (covered or largest == 0.0),
        detail=f"{answer.status} by the {question.criterion} criterion at {time_text(delay)}",
    )


def _published(c: Stated) -> Check:
    claimed = c.answer.published_max_delay_s
    if c.question.criterion is Criterion.PUBLISHED:
        same, detail = claimed == c.answer.max_delay_s, "it is this certificate's bound"
    else:
        same = claimed is None or claimed >= 0.0
        detail = "stated, not proven here: its proof is a certificate by the published criterion"
    return Check(name="published bound", ok=same, detail=detail)


def _conservatism(c: Stated) -> Check:
    """Margin over bound; at least 1 where a design is passive."""
    ratio, margin, largest = (
        c.answer.conservatism,
        c.answer.local_margin_s or 0.0,
        c.answer.max_delay_s,
    )
    expected = margin / largest if 0.0 < margin < math.inf and 0.0 < largest < math.inf else None
    passive = (
        c.question.criterion is Criterion.CERTIFIED and c.answer.status is not Status.NOT_CERTIFIED
    )
    words = "not defined" if ratio is None else f"{ratio:.6g}"
    return Check(
        name="conservatism",
        ok=ratio == expected and not (passive and ratio is not None and ratio < 1.0),
        detail=f"local margin over bound is {words}",
    )


def _unbounded(c: Stated) -> Check:
    """The bound is infinite only if F = 0."""
    if c.answer.max_delay_s < math.inf:
        return Check(name="unbounded delay", ok=True, detail="none is claimed")
    loop = c.evidence.local_loop
    free = loop is not None and loop.delayed_share <= _NO_FEEDBACK
    words = "the frozen loop has no delayed part" if free else "the frozen loop has a delayed part"
    return Check(name="unbounded delay", ok=free, detail=words)


def _shown(claimed: float, shown: float, *, complete: bool) -> bool:
    """Whether a largest value over a motion is not below what is shown, and equal if all is."""
    room = AGREEMENT * max(shown, 1.0)
    return claimed >= shown - room and (not complete or claimed <= shown + room)


def _largest(
    name: str, claimed: float | None, shown: list[float], *, c: Stated, limit: float | None
) -> Check:
    """A largest value over the motion against those of the proofs, and against its limit."""
    most = max(shown, default=0.0)
    ok = limit is None
    if claimed is not None:
        ok = _shown(claimed, most, complete=len(shown) == c.question.instants)
        ok &= limit is None or claimed <= limit
    words = "none" if claimed is None else f"{claimed:.6g}"
    detail = f"{words} claimed, {most:.6g} at {len(shown)} instants with a proof"
    return Check(name=name, ok=ok, detail=detail)


def _asymmetry(c: Stated) -> Check:
    proven = c.question.criterion is Criterion.CERTIFIED and c.answer.max_delay_s > 0.0
    shown = [asymmetry(proof.F) for proof in c.evidence.proofs]
    limit = SYMMETRY if proven else None
    return _largest("asymmetry", c.answer.asymmetry, shown, c=c, limit=limit)


def _contraction(c: Stated) -> Check:
    """‖K^-½ F_q K^-½‖₂ with F_q = J*ᵀ S J* less the gravity gradient."""
    question, claimed, K = c.question, c.answer.contraction, c.question.spring_stiffness
    if question.criterion is not Criterion.CERTIFIED:
        words = "stated, not proven here: the published criterion has another S"
        return Check(name="contraction", ok=(claimed or 0.0) >= 0.0, detail=words)
    shown = [
        float(np.linalg.norm(F_q / np.sqrt(np.outer(K, K)), 2)) if (K > 0.0).all() else math.inf
        for F_q in (
            proof.J_star.T @ proof.stiffness @ proof.J_star - proof.F_gravity
            for proof in c.evidence.proofs
        )
    ]
    needed = question.feedback == "static_joint" and c.answer.max_delay_s > 0.0
    limit = math.nextafter(1.0, 0.0) if needed else None
    return _largest("contraction", claimed, shown, c=c, limit=limit)
