"""sealag's answer beside the black box's."""

import math
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sealag
from oracle.black_box.box import BlackBox, Both
from oracle.black_box.law import Unsettled
from oracle.black_box.rest import NoEquilibrium
from oracle.black_box.roots import ScanLost

AGREEMENT = 1e-6
"""Relative difference of margins."""
ELSEWHERE = 1e-6
"""rad, m: equilibria further apart than this are two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Theirs:
    """What sealag says.

    Attributes:
        status: of the certificate.
        stable: whether no root is unstable; None if it does not say.
        unstable: their number; None likewise.
        margin: s; None likewise.
        bound: certified delay, s.
        reasons: against certification.
    """

    status: str
    stable: bool | None
    unstable: int | None
    margin: float | None
    bound: float
    reasons: tuple[str, ...]


def ask_sealag(system: Any) -> Theirs:
    """Return what `certify` says.

    Args:
        system: the design.
    """
    found = sealag.certify(system, proofs=1).answer
    return Theirs(
        status=str(found.status),
        stable=found.stable,
        unstable=found.unstable_modes,
        margin=number(found.local_margin_s),
        bound=number(found.max_delay_s) or 0.0,
        reasons=tuple(found.reasons),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What came of one design.

    Attributes:
        path: its project file.
        kind: agree | refused | undecided | disagree | fault.
        said: in a sentence.
        seconds: of the black box, and of sealag.
        ours: the black box's answers; None if it has none.
    """

    path: Path
    kind: str
    said: str
    seconds: tuple[float, float]
    ours: Both | None


def compare(path: Path, **broken: bool) -> Verdict:
    """Ask both about a project file.

    Args:
        path: the project file.
        broken: negative controls of the black box.
    """
    start = time.process_time()
    try:
        system = sealag.load(path)
        theirs = ask_sealag(system)
    except sealag.SealagError as error:
        return _verdict(path, "refused", _sentence(error), start, start, None)
    except Exception as error:
        return _verdict(path, "fault", f"sealag: {error!r}", start, start, None)
    middle = time.process_time()
    try:
        black = BlackBox(path, system, **broken)
        ours = black.both()
        kind, said = judge(ours, theirs)
        if kind in ("disagree", "undecided"):
            there = _at_their_rest(black, ours, system)
            if there is not None and judge(there, theirs)[0] == "agree":
                ours, kind, said = there, "agree", f"at another equilibrium than: {said}"
    except ScanLost as error:
        return _verdict(path, "undecided", f"ScanLost: {error}", start, middle, None)
    except Exception as error:
        return _verdict(path, "fault", f"black box: {error!r}", start, middle, None)
    return _verdict(path, kind, said, start, middle, ours)


def _at_their_rest(black: BlackBox, ours: Both, system: Any) -> Both | None:
    """The answers at sealag's equilibrium, if it is one and another than the black box's."""
    theirs = system.rest()
    if not theirs.found:
        return None
    if not isinstance(ours.rest, Exception):
        apart = np.abs(ours.rest.state.theta - theirs.theta).max(initial=0.0)
        if apart < ELSEWHERE:
            return None
    try:
        rest = black.answer(black.rest((theirs.q, theirs.theta)))
    except (NoEquilibrium, Unsettled, sealag.SealagError):
        return None
    return Both(posture=ours.posture, rest=rest)


def judge(ours: Both, theirs: Theirs) -> tuple[str, str]:
    """Return kind and sentence for two answers.

    Args:
        ours: the black box's.
        theirs: sealag's.
    """
    if theirs.stable is None or theirs.margin is None:
        reasons = "; ".join(theirs.reasons)
        if theirs.status == "certified":
            return "disagree", "certified, and its margin or stability not known"
        return ("refused", reasons) if reasons else ("disagree", "neither an answer nor a reason")
    certified, said = theirs.status == "certified", f"{theirs.status}, stable {theirs.stable}"
    silent = not theirs.stable and theirs.margin == 0.0
    if isinstance(ours.rest, Exception) and certified:
        return _unless_unsettled(ours, f"{said}, but {_named(ours.rest)}")
    if ours.missing:
        why = "; ".join(_named(one) for one in ours.missing)
        if silent:
            return "agree", f"no loop: {why}"
        return _unless_unsettled(ours, f"{said}, margin {theirs.margin * 1e3:.6g} ms, but {why}")
    if any(one.on_axis for one in ours.answers):
        wrong = "" if silent else f"{said}, margin {theirs.margin:.6g} s, but "
        return ("disagree" if wrong else "agree"), f"{wrong}a root is on the axis"
    if not all(one.decided for one in ours.answers):
        nearest = min(one.nearest for one in ours.answers)
        return "undecided", f"a root is {nearest:.1e} from the axis"
    wrong = "; ".join(_differences(ours, theirs))
    if wrong:
        return "disagree", f"{wrong} ({_described(ours)})"
    return "agree", f"margin {ours.margin * 1e3:.6g} ms, {ours.unstable} unstable"


def _unless_unsettled(ours: Both, said: str) -> tuple[str, str]:
    """A disagreement, unless the ticks leave open whether there is a law."""
    unsettled = any(isinstance(one, Unsettled) for one in ours.missing)
    return ("undecided" if unsettled else "disagree"), said


def _differences(ours: Both, theirs: Theirs) -> list[str]:
    """What sealag says of two loops that is wrong."""
    wrong, margin, bound = [], theirs.margin or 0.0, theirs.bound
    if bool(theirs.stable) != ours.stable:
        wrong.append(f"stable {theirs.stable}, true {ours.stable}")
    nowhere = any("no equilibrium" in why for why in theirs.reasons)
    if theirs.unstable != ours.unstable and not (nowhere and not ours.stable):
        wrong.append(f"unstable modes {theirs.unstable}, true {ours.unstable}")
    if not same(margin, ours.margin):
        wrong.append(f"margin {margin * 1e3:.6g} ms, true {ours.margin * 1e3:.6g} ms")
    if theirs.status == "certified" and not ours.stable:
        wrong.append("certified, and unstable without delay")
    if theirs.status in ("certified", "passive_only"):
        if theirs.stable and bound > ours.margin * (1 + AGREEMENT):
            wrong.append(f"certified to {bound * 1e3:.6g} ms, true {ours.margin * 1e3:.6g} ms")
        over = sorted({joint for one in ours.answers for joint in one.overloaded})
        if over:
            wrong.append(f"{theirs.status}, and {', '.join(over)} cannot carry the load")
    return wrong


def _described(ours: Both) -> str:
    return ", ".join(
        f"{one.margin * 1e3:.6g} ms, {one.unstable} unstable at sag {one.state.sag:.2g}"
        for one in ours.answers
    )


def same(a: float, b: float) -> bool:
    """Return whether two margins agree.

    Args:
        a: s, inf allowed.
        b: s, inf allowed.
    """
    if math.isinf(a) or math.isinf(b):
        return a == b
    return abs(a - b) <= AGREEMENT * max(abs(a), abs(b))


def number(value: float | str | None) -> float | None:
    """Return a time that a certificate states, s; inf for one that no delay reaches.

    Args:
        value: number, word, or None for not known.
    """
    if value is None:
        return None
    return math.inf if isinstance(value, str) else float(value)


def _named(error: Exception) -> str:
    return f"{type(error).__name__}: {_sentence(error)}"


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())


def _verdict(path, kind, said, start, middle, ours) -> Verdict:
    end = time.process_time()
    middle = end if middle == start else middle
    seconds = end - middle, middle - start
    return Verdict(path=path, kind=kind, said=said, seconds=seconds, ours=ours)


def report(verdicts: Sequence[Verdict] | Iterable[Verdict]) -> str:
    """Return counts, costs, and a line for each design that did not agree.

    Args:
        verdicts: of a corpus.
    """
    verdicts = list(verdicts)
    counts = Counter(v.kind for v in verdicts)
    ours, theirs = (sum(v.seconds[k] for v in verdicts) for k in (0, 1))
    lines = [
        ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())),
        f"black box {ours:.1f} s, sealag {theirs:.1f} s for {len(verdicts)} designs",
    ]
    for kind in ("fault", "disagree", "undecided", "refused"):
        lines += [f"{kind}: {v.path}: {v.said}" for v in verdicts if v.kind == kind]
    return "\n".join(lines)
