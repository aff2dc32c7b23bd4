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
from oracle.black_box.compare import Theirs, compare, judge, report
from oracle.black_box.corpus import SUITE, random_design
from oracle.black_box.law import Unsettled
from oracle.black_box.loop import BlackBox, NoEquilibrium
from oracle.black_box.threshold import at_threshold

SEED = int(os.environ.get("SEALAG_ORACLE_SEED", 20161115))
COUNT = int(os.environ.get("SEALAG_ORACLE_COUNT", 300))
CHUNK = 30
CASE = Path(__file__).parent / "black_box" / "cases" / "dampbest.toml"


@pytest.mark.parametrize("first", range(0, COUNT, CHUNK))
def test_no_answer_differs(first, tmp_path):
    seeds = range(SEED + first, SEED + min(first + CHUNK, COUNT))
    verdicts = [compare(random_design(seed, tmp_path, SUITE)) for seed in seeds]
    print(f"seeds {seeds}\n{report(verdicts)}")
    wrong = [v for v in verdicts if v.kind in ("disagree", "fault")]
    assert not wrong, f"{len(wrong)} of {len(verdicts)} differ, first {wrong[0].path}"
    agreed = [v for v in verdicts if v.kind == "agree"]
    assert len(agreed) > len(verdicts) / 2  # a corpus that is refused compares nothing
    assert any(v.answer.unstable for v in agreed)
    assert any(0.0 < v.answer.margin < np.inf for v in agreed)
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
        if below.answer and above.answer:
            assert below.answer.stable != above.answer.stable
            edges += 1
    assert edges == 3


def believed(answer):
    """What sealag would say if it agreed."""
    return Theirs(
        status="not_certified",
        stable=answer.stable,
        unstable=answer.unstable,
        margin=answer.margin,
        bound=0.0,
        reasons=(),
    )


def test_a_wrong_answer_is_noticed():
    black = BlackBox(CASE, sealag.load(CASE))
    ours, theirs = black.answer(), believed(black.answer())
    assert judge(ours, theirs)[0] == "agree"
    assert judge(ours, replace(theirs, margin=ours.margin * (1 + 3e-6)))[0] == "disagree"
    assert judge(ours, replace(theirs, unstable=1))[0] == "disagree"
    assert judge(ours, replace(theirs, stable=False))[0] == "disagree"
    assert judge(ours, replace(theirs, margin=None))[0] == "disagree"
    assert judge(ours, replace(theirs, margin=None, reasons=("a reason",)))[0] == "refused"
    proud = replace(theirs, status="certified", bound=ours.margin * 1.01)
    assert judge(ours, proud)[0] == "disagree"


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
            intact = BlackBox(path, system).answer()
            broken = BlackBox(path, system, **{left_out: True}).answer()
        except (NoEquilibrium, Unsettled, sealag.SealagError):
            continue
        if intact.decided:
            kinds.append(judge(broken, believed(intact))[0])
    assert "disagree" in kinds
