"""Claims of a certificate that follow from, or contradict, its other numbers."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from sealag.passivity._certificate import content_digest
from sealag.passivity._checks import Check
from sealag.passivity._definite import Reader
from sealag.passivity._inequalities import AGREEMENT, SYMMETRY, asymmetry
from sealag.typing import Array

_WORDS = {
    "feedback": ("motor", "static_joint", "static_joint_tank", "joint"),
    "gravity": ("feedback", "planned", "none"),
    "stiffness_form": ("symmetric", "published", "force"),
    "task_inertia": ("lambda_ts", "lambda_star"),
    "criterion": ("certified", "published"),
}


def content_check(data: dict[str, Any], odd: tuple[str, ...]) -> Check:
    """Check that no digit differs from what was written: digest and form of every number.

    Args:
        data: the certificate as plain data.
        odd: numbers of the file whose digits are not those of their double.
    """
    same = content_digest(data) == data["hashes"].get("content")
    if odd:
        detail = f"the number {odd[0]} is {float(odd[0])!r}"
    else:
        detail = "the digest agrees" if same else "the digest is of other content"
    return Check(name="content is as written", ok=same and not odd, detail=detail)


def largest_delay(data: dict[str, Any]) -> float:
    """Return the claimed bound; null is a bound without end.

    Args:
        data: the certificate as plain data.
    """
    return math.inf if data["max_delay_s"] is None else float(data["max_delay_s"])


def claim_checks(data: dict[str, Any], number: Reader) -> Iterator[Check]:
    """Check instants, smallest bound, verdict, and what else the file says of the motion.

    Args:
        data: the certificate as plain data.
        number: how its numbers are read: doubles or rationals.

    Raises:
        ValueError: numbers do not fit each other.
    """
    bounds = [math.inf if b is None else float(b) for b in data["bounds_s"]]
    proven = [proof["instant"] for proof in data["proofs"]]
    if not all(0 <= at < len(bounds) for at in proven):
        raise ValueError("a proof belongs to no instant")
    yield from _instants(data, bounds, proven)
    yield _levels(data)
    yield _verdict(data)
    yield _published(data)
    yield _conservatism(data)
    worst = [proof for proof in data["proofs"] if proof["instant"] == data["worst"]["instant"]]
    yield Check(
        name="proof of the worst instant",
        ok=bool(worst) or not 0.0 < largest_delay(data) < math.inf,
        detail=f"{len(proven)} instants have proofs",
    )
    yield _direction(data)
    yield _upper(data, number, worst[0] if worst else None)
    if data["criterion"] == "certified":
        yield _contraction(data)
    yield _asymmetry(data)


def _instants(data: dict[str, Any], bounds: list[float], proven: list[int]) -> Iterator[Check]:
    times = np.array(data["time_s"], dtype=float)
    worst, claimed, smallest = data["worst"], largest_delay(data), min(bounds)
    yield Check(
        name="instants",
        ok=len(bounds) == len(times) == data["instants"]
        and bool((np.diff(times) > 0.0).all())
        and len(set(proven)) == len(proven),
        detail=f"{len(bounds)} bounds, {len(times)} times, {data['instants']} claimed",
    )
    yield Check(
        name="smallest bound",
        ok=claimed == smallest and smallest >= 0.0,
        detail=f"{claimed:.9g} s claimed, {smallest:.9g} s in the list",
    )
    at = worst["instant"]
    yield Check(
        name="worst instant",
        ok=0 <= at < len(bounds) and bounds[at] == smallest and times[at] == worst["time_s"],
        detail=f"instant {at} at {worst['time_s']} s",
    )
    shared = [data["common_multiplier_delay_s"], data["time_varying_delay_s"], 0.0]
    known = [float(delay) for delay in shared if delay is not None]
    yield Check(
        name="shared multipliers prove no more than each instant's own",
        ok=max(known) <= smallest * (1.0 + 1e-6) and min(known) == 0.0,
        detail=f"{max(known):.9g} s, {smallest:.9g} s",
    )


def _levels(data: dict[str, Any]) -> Check:
    """Priority levels are rows of J*, from the first to the last."""
    edges = data["levels"]
    rows = {len(proof["J_star"]) for proof in data["proofs"]} or {edges[-1]}
    good = edges[0] == 0 and {edges[-1]} == rows and sorted(set(edges)) == edges
    return Check(name="priority levels", ok=good, detail=f"rows {edges}")


def _verdict(data: dict[str, Any]) -> Check:
    """Status, reasons and delays agree; a bound of 0 is where a condition fails.

    A bound over the whole motion that a solver left open below the design's delay is no answer, and
    a law that loses its stability before its bound is not covered by it.
    """
    largest, delay, yes = largest_delay(data), float(data["delay_s"]), not data["reasons"]
    shared = [data[name] for name in data["left_open"] if name != "max_delay_s"]
    margin, certified = data["local_margin_s"], data["criterion"] == "certified"
    covered = data["criterion"] == "published" or data["feedback"] != "joint"
    undercut = certified and data["stable"] and margin is not None and margin < largest
    enough = delay <= largest and all(bound is None or delay <= bound for bound in shared)
    return Check(
        name="verdict",
        ok=data["status"] == ("certified" if yes else "not_certified")
        and all(data[key] in words for key, words in _WORDS.items())
        and delay >= 0.0
        and (yes == (enough and not undercut) or (largest == 0.0 and not yes))
        and (covered or largest == 0.0),
        detail=f"{data['status']} by the {data['criterion']} criterion at {delay} s",
    )


def _published(data: dict[str, Any]) -> Check:
    if data["criterion"] == "published":
        same = data["published_max_delay_s"] == data["max_delay_s"]
        detail = "it is this certificate's bound"
    else:
        same = data["published_max_delay_s"] is None or data["published_max_delay_s"] >= 0.0
        detail = "the maker's word: its proof is a certificate by the published criterion"
    return Check(name="published bound", ok=same, detail=detail)


def _conservatism(data: dict[str, Any]) -> Check:
    """Margin over bound; at least 1 where a design is certified."""
    ratio, margin, largest = (
        data["conservatism"],
        data["local_margin_s"] or 0.0,
        largest_delay(data),
    )
    expected = margin / largest if margin > 0.0 and 0.0 < largest < math.inf else None
    passive = data["criterion"] == data["status"] == "certified"
    return Check(
        name="conservatism",
        ok=ratio == expected and not (passive and ratio is not None and ratio < 1.0),
        detail=f"local margin over bound is {ratio}",
    )


def _direction(data: dict[str, Any]) -> Check:
    """Shares of the damping power y* D_θ y."""
    real, imaginary = np.array(data["worst_motion"], dtype=float)
    power = np.array(data["D_theta"], dtype=float) * (real**2 + imaginary**2)
    direction = data["worst"]["direction"]
    gap = np.abs(np.array(list(direction.values()), dtype=float) - power / power.sum()).max()
    return Check(
        name="limiting direction",
        ok=list(direction) == list(data["joints"]) and gap <= AGREEMENT,
        detail=f"shares of {len(direction)} joints in the worst motion's damping, to {gap:.1e}",
    )


def _upper(data: dict[str, Any], number: Reader, proof: dict[str, Any] | None) -> Check:
    """(29) and (31) at d ask for d |y* F y| ≤ y* D_θ y of every motion y."""
    name, largest, upper = "upper end", largest_delay(data), data["max_delay_upper_s"]
    if proof is None:
        expected = 0.0 if largest == 0.0 else None
        words = "nothing is claimed where no bound is positive and finite"
        return Check(name=name, ok=upper == expected, detail=words)
    a, b = number(data["worst_motion"])
    F, D, d = number(proof["F"]), number(data["D_theta"]), number([upper])[0]
    power = sum(D * (a * a + b * b))
    real, imaginary = a @ F @ a + b @ F @ b, a @ F @ b - b @ F @ a
    room = number([(1.0 + AGREEMENT) ** 2])[0]
    refuted = d * d * (real * real + imaginary * imaginary) * room >= power * power > 0
    return Check(
        name=name,
        ok=upper >= largest and bool(refuted),
        detail=f"the worst motion turns active by {upper:.9g} s, to {AGREEMENT:.0e}",
    )


def _shown(claimed: float, shown: float, *, complete: bool) -> bool:
    """Whether a largest value over a motion is not below what is shown, and equal if all is."""
    room = AGREEMENT * max(shown, 1.0)
    return claimed >= shown - room and (not complete or claimed <= shown + room)


def _asymmetry(data: dict[str, Any]) -> Check:
    claimed = math.inf if data["asymmetry"] is None else float(data["asymmetry"])
    shown = [asymmetry(np.array(proof["F"], dtype=float)) for proof in data["proofs"]]
    most = max(shown, default=0.0)
    proven = data["criterion"] == "certified" and largest_delay(data) > 0.0
    return Check(
        name="asymmetry",
        ok=_shown(claimed, most, complete=len(shown) == data["instants"])
        and not (proven and claimed > SYMMETRY),
        detail=f"{claimed:.2e} claimed, {most:.2e} at {len(shown)} instants with a proof",
    )


def _contraction(data: dict[str, Any]) -> Check:
    """‖K^-½ F_q K^-½‖₂ with F_q = J*ᵀ S J* less the gravity gradient."""
    K = np.array(data["spring_stiffness"], dtype=float)
    shown = [_factor(proof, K) for proof in data["proofs"]] if (K > 0.0).all() else [math.inf]
    claimed, most = float(data["contraction"]), max(shown, default=0.0)
    needed = data["feedback"] == "static_joint" and largest_delay(data) > 0.0
    return Check(
        name="contraction",
        ok=_shown(claimed, most, complete=len(shown) == data["instants"])
        and not (needed and claimed >= 1.0),
        detail=f"{claimed:.6g} claimed, {most:.6g} at {len(shown)} instants with a proof",
    )


def _factor(proof: dict[str, Any], K: Array) -> float:
    J, S, G = (np.array(proof[key], dtype=float) for key in ("J_star", "stiffness", "F_gravity"))
    return float(np.linalg.norm((J.T @ S @ J - G) / np.sqrt(np.outer(K, K)), 2))
