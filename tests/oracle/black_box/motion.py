"""Motions of a few instants: every instant decided, and what is said of all of them together."""

import time
from pathlib import Path

import numpy as np

import sealag
from oracle.black_box.box import BlackBox, Both
from oracle.black_box.compare import AGREEMENT, Verdict, number, same
from oracle.black_box.roots import ScanLost

BASE = ["base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw"]


def random_motion(path: Path, seed: int, *, instants: int = 3) -> Path:
    """Write a motion beside a design: its posture first, then others near it.

    Args:
        path: the project file.
        seed: decides everything.
        instants: how many.

    Returns:
        The path of the CSV.
    """
    rng = np.random.default_rng(seed)
    system = sealag.load(path)
    robot, q = system.robot, np.array(system.posture)
    frames = [f"contact:{c.frame}" for c in system.contacts]
    names = ["time_s", *(BASE if robot.floating_base else ()), *robot.joints, *frames]
    rows = []
    width = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.3))))
    for k in range(instants):
        there = q.copy()
        if k:
            there[len(q) - robot.n :] += width * rng.normal(size=robot.n)
        held = rng.random(len(frames)) < (1.0 if k == 0 else 0.9)
        rows.append([0.1 * k, *there, *held.astype(int)])
    out = path.with_suffix(".csv")
    text = [",".join(names)] + [",".join(repr(float(x)) for x in row) for row in rows]
    out.write_text("\n".join(text) + "\n")
    return out


def compare_motion(path: Path, csv: Path) -> Verdict:
    """Ask both about every instant of a motion.

    Args:
        path: the project file.
        csv: the motion.
    """
    start = time.process_time()

    def verdict(kind: str, said: str) -> Verdict:
        seconds = time.process_time() - middle, middle - start
        return Verdict(path=csv, kind=kind, said=said, seconds=seconds, ours=None)

    middle = start
    try:
        system = sealag.load(path)
        motion = system.load_motion(csv)
        found = sealag.certify(system, motion, proofs=1)
    except sealag.SealagError as error:
        return verdict("refused", " ".join(str(error).split()))
    middle = time.process_time()
    ours = []
    for k, c in enumerate(motion.contact_index):
        black = BlackBox(path, system, q=motion.q[k], contacts=motion.contact_sets[c])
        try:
            ours.append(black.both())
        except ScanLost as error:
            return verdict("undecided", str(error))
    if any(not one.decided for both in ours for one in both.answers):
        return verdict("undecided", "a root is next to the axis")
    wrong = judge_motion(ours, found)
    bases = [str(basis) for basis in found.evidence.instant_basis]
    said = f"bases {bases}, margin {found.answer.local_margin_s}"
    return verdict("disagree" if wrong else "agree", "; ".join(wrong) or said)


def judge_motion(ours: list[Both], found) -> list[str]:
    """Return what a certificate says wrong of the instants.

    Args:
        ours: the black box's answers at each.
        found: sealag's certificate.
    """
    wrong, margins = [], [_true_margin(both) for both in ours]
    answer, evidence = found.answer, found.evidence
    exact, bound = [], number(answer.max_delay_s) or 0.0
    for k, true in enumerate(margins):
        basis, said = str(evidence.instant_basis[k]), number(evidence.instant_margins_s[k])
        if basis == "open":
            continue
        assert said is not None
        if basis == "exact":
            exact.append(said)
            if not same(said, true):
                wrong.append(f"instant {k} exactly {said:.9g} s, true {true:.9g} s")
        elif said > true * (1 + AGREEMENT):
            wrong.append(f"instant {k} at least {said:.9g} s ({basis}), true {true:.9g} s")
        passive = answer.status in ("certified", "passive_only")
        if passive and true > 0.0 and bound > true * (1 + AGREEMENT):
            wrong.append(f"passive to {bound:.9g} s, instant {k} loses it at {true:.9g} s")
        if answer.status == "certified" and true <= found.question.delay_s:
            wrong.append(f"certified, instant {k} is not stable at its delay")
    if exact and not same(number(answer.local_margin_s) or 0.0, min(exact)):
        wrong.append(f"margin {answer.local_margin_s}, smallest exact {min(exact):.9g} s")
    if exact and len(exact) == len(margins) and not same(min(exact), min(margins)):
        wrong.append(f"smallest {min(exact):.9g} s, true {min(margins):.9g} s")
    if answer.stable and min(margins) == 0.0:
        wrong.append("stable, and an instant is not")
    if answer.stable is False and min(margins) > 0.0:
        wrong.append("not stable, and every instant is")
    return wrong


def _true_margin(both: Both) -> float:
    return 0.0 if any(one.on_axis for one in both.answers) else both.margin
