"""sealag against the black box on random designs.

SEALAG_ORACLE_SEED and SEALAG_ORACLE_COUNT choose another corpus; longer ones, with larger robots:
PYTHONPATH=src:tests python -m oracle.black_box --count 5000.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sealag
from oracle.black_box.box import BlackBox, Both
from oracle.black_box.compare import Theirs, compare, judge, report
from oracle.black_box.corpus import SUITE, random_design
from oracle.black_box.motion import compare_motion, judge_motion, random_motion
from oracle.black_box.rest import NoEquilibrium
from oracle.black_box.threshold import at_threshold

pytestmark = pytest.mark.slow

SEED = int(os.environ.get("SEALAG_ORACLE_SEED", 20161115))
COUNT = int(os.environ.get("SEALAG_ORACLE_COUNT", 300))
CHUNK = 30
MOTIONS = 12
CASE = Path(__file__).parent / "black_box" / "cases" / "dampbest.toml"


@pytest.mark.parametrize("first", range(0, COUNT, CHUNK))
def test_no_answer_differs(first, tmp_path):
    seeds = range(SEED + first, SEED + min(first + CHUNK, COUNT))
    verdicts = [compare(random_design(seed, tmp_path, SUITE)) for seed in seeds]
    print(f"seeds {seeds}\n{report(verdicts)}")
    wrong = [v for v in verdicts if v.kind in ("disagree", "fault")]
    assert not wrong, f"{len(wrong)} of {len(verdicts)} differ, first {wrong[0].path}"
    agreed = [v.ours for v in verdicts if v.kind == "agree" and not v.ours.missing]
    assert len(agreed) > len(verdicts) / 4  # a corpus that is refused compares nothing
    assert any(ours.unstable for ours in agreed)
    assert any(0.0 < ours.margin < np.inf for ours in agreed)
    for verdict in verdicts:
        assert verdict.kind != "refused" or len(verdict.said.split()) > 4, verdict


def test_no_answer_differs_at_the_edge_of_stability(tmp_path):
    seed, edges = SEED, 0
    while edges < 3 and seed < SEED + 60:
        pair = at_threshold(random_design(seed, tmp_path, SUITE))
        seed += 1
        if pair is None:
            continue
        below, above = (compare(path) for path in pair)
        assert {below.kind, above.kind} <= {"agree", "refused", "undecided"}, (below, above)
        if below.kind == above.kind == "agree":
            assert below.ours.rest.stable != above.ours.rest.stable
            edges += 1
    assert edges == 3


def test_no_instant_of_a_motion_differs(tmp_path):
    verdicts = []
    for seed in range(SEED, SEED + MOTIONS):
        path = random_design(seed, tmp_path, SUITE)
        verdicts.append(compare_motion(path, random_motion(path, seed)))
    print(report(verdicts))
    assert not [v for v in verdicts if v.kind in ("disagree", "fault")]
    assert sum(v.kind == "agree" for v in verdicts) > MOTIONS / 2


def test_a_wrong_instant_is_noticed():
    path = CASE.with_name("s3_second_instant.toml")
    system = sealag.load(path)
    motion = system.load_motion(path.with_suffix(".csv"))
    found = sealag.certify(system, motion, proofs=1)
    ours = [
        BlackBox(path, system, q=motion.q[k], contacts=motion.contact_sets[c]).both()
        for k, c in enumerate(motion.contact_index)
    ]
    assert not judge_motion(ours, found)
    assert judge_motion(ours, replace(found, answer=replace(found.answer, local_margin_s=0.7)))
    assert judge_motion(ours, replace(found, answer=replace(found.answer, stable=False)))
    assert judge_motion(ours[::-1], found)


def believed(ours):
    """What sealag would say if it agreed."""
    return Theirs(
        status="not_certified",
        stable=ours.stable,
        unstable=ours.unstable,
        margin=ours.margin,
        bound=0.0,
        reasons=(),
    )


def test_a_wrong_answer_is_noticed():
    ours = BlackBox(CASE, sealag.load(CASE)).both()
    theirs = believed(ours)
    assert judge(ours, theirs)[0] == "agree"
    assert judge(ours, replace(theirs, margin=ours.margin * (1 + 3e-6)))[0] == "disagree"
    assert judge(ours, replace(theirs, unstable=1))[0] == "disagree"
    assert judge(ours, replace(theirs, stable=False))[0] == "disagree"
    assert judge(ours, replace(theirs, margin=None))[0] == "disagree"
    assert judge(ours, replace(theirs, margin=None, reasons=("a reason",)))[0] == "refused"
    proud = replace(theirs, status="certified", bound=ours.margin * 1.01)
    assert judge(ours, proud)[0] == "disagree"
    nowhere = Both(posture=ours.posture, rest=NoEquilibrium("it falls"))
    fallen = replace(theirs, stable=False, margin=0.0)
    assert judge(nowhere, theirs)[0] == "disagree"
    assert judge(nowhere, fallen)[0] == "agree"
    assert judge(nowhere, replace(fallen, status="certified"))[0] == "disagree"


@pytest.mark.parametrize(
    ("part", "left_out"),
    [
        ("[[contacts]]", "no_contact_forces"),
        ("spring_damping", "no_spring_damping"),
        ('base = "floating"', "no_base_feedback"),
    ],
)
def test_a_black_box_that_leaves_something_out_differs(part, left_out, tmp_path):
    kinds = []
    for seed in range(SEED, SEED + 40):
        path = random_design(seed, tmp_path, SUITE)
        if part not in path.read_text() or len(kinds) == 6:
            continue
        try:
            system = sealag.load(path)
            intact = BlackBox(path, system).both()
            broken = BlackBox(path, system, **{left_out: True}).both()
        except sealag.SealagError:
            continue
        if not intact.missing and all(one.decided for one in intact.answers):
            kinds.append(judge(broken, believed(intact))[0])
    assert "disagree" in kinds
