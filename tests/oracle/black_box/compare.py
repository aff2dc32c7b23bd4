"""sealag's answer beside the black box's."""

import math
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sealag
from oracle.black_box.law import Unsettled
from oracle.black_box.loop import Answer, BlackBox, NoEquilibrium
from oracle.black_box.roots import ScanLost
from sealag.design import local_margins

AGREEMENT = 1e-6
"""Relative difference of margins."""


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
    """Return what `certify` says, and where it gives no margin what `margin` says.

    Args:
        system: the design.
    """
    found: Any = sealag.certify(system)
    stable, unstable, margin = found.stable, found.unstable_modes, _number(found.local_margin_s)
    if margin is None or stable is None:
        try:
            local = local_margins(system)
        except sealag.SealagError:
            stable = unstable = margin = None
        else:
            unstable, margin = local.unstable_modes, _number(local.delay_s)
            stable = unstable == 0
    return Theirs(
        status=str(found.status),
        stable=stable,
        unstable=unstable,
        margin=margin,
        bound=_number(found.max_delay_s) or 0.0,
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
        answer: the black box's; None if it has none.
    """

    path: Path
    kind: str
    said: str
    seconds: tuple[float, float]
    answer: Answer | None


def compare(path: Path, **broken: bool) -> Verdict:
    """Ask both about a project file.

    Args:
        path: the project file.
        broken: negative controls of the black box.
    """
    start = time.perf_counter()
    try:
        system = sealag.load(path)
        theirs = ask_sealag(system)
    except sealag.SealagError as error:
        return _verdict(path, "refused", _sentence(error), start, start, None)
    except Exception as error:
        return _verdict(path, "fault", f"sealag: {error!r}", start, start, None)
    middle = time.perf_counter()
    try:
        ours = BlackBox(path, system, **broken).answer()
    except (NoEquilibrium, ScanLost, Unsettled, sealag.SealagError) as error:
        kind, said = without_loop(error, theirs)
        return _verdict(path, kind, said, start, middle, None)
    except Exception as error:
        return _verdict(path, "fault", f"black box: {error!r}", start, middle, None)
    kind, said = judge(ours, theirs)
    return _verdict(path, kind, said, start, middle, ours)


def without_loop(error: Exception, theirs: Theirs) -> tuple[str, str]:
    """Return kind and sentence where the black box has no loop to look at.

    Args:
        error: why.
        theirs: sealag's answer.
    """
    said = f"{type(error).__name__}: {_sentence(error)}"
    if isinstance(error, Unsettled | ScanLost):
        return "undecided", said
    if theirs.status == "certified" or theirs.stable:
        return "disagree", f"{theirs.status}, stable {theirs.stable}, but {said}"
    return "refused", said


def judge(ours: Answer, theirs: Theirs) -> tuple[str, str]:
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
    if ours.on_axis and theirs.stable:
        return "disagree", "stable, but a root is on the axis"
    if not ours.decided:
        return "undecided", f"a root is {ours.nearest:.1e} from the axis"
    margin, bound, wrong = theirs.margin, theirs.bound, []
    if bool(theirs.stable) != ours.stable:
        wrong.append(f"stable {theirs.stable}, true {ours.stable}")
    if theirs.unstable != ours.unstable:
        wrong.append(f"unstable modes {theirs.unstable}, true {ours.unstable}")
    if not same(margin, ours.margin):
        wrong.append(f"margin {margin * 1e3:.6g} ms, true {ours.margin * 1e3:.6g} ms")
    if theirs.status == "certified" and theirs.stable and bound > ours.margin * (1 + AGREEMENT):
        wrong.append(f"certified to {bound * 1e3:.6g} ms, true {ours.margin * 1e3:.6g} ms")
    if wrong:
        return "disagree", "; ".join(wrong) + f" (sag {ours.rest.sag:.2g})"
    return "agree", f"margin {ours.margin * 1e3:.6g} ms, {ours.unstable} unstable"


def same(a: float, b: float) -> bool:
    """Return whether two margins agree.

    Args:
        a: s, inf allowed.
        b: s, inf allowed.
    """
    if math.isinf(a) or math.isinf(b):
        return a == b
    return abs(a - b) <= AGREEMENT * max(abs(a), abs(b))


def _number(value: float | str | None) -> float | None:
    if value is None:
        return None
    return math.inf if isinstance(value, str) else float(value)


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())


def _verdict(path, kind, said, start, middle, answer) -> Verdict:
    end = time.perf_counter()
    middle = end if middle == start else middle
    seconds = end - middle, middle - start
    return Verdict(path=path, kind=kind, said=said, seconds=seconds, answer=answer)


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
