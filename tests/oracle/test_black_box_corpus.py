"""sealag against the black box on random designs.

SEALAG_ORACLE_SEED and SEALAG_ORACLE_COUNT choose another corpus; longer ones, with larger robots:
PYTHONPATH=src:tests python -m oracle.black_box --count 5000.
"""

import os
from dataclasses import replace

import numpy as np
import pytest

import sealag
from oracle.black_box.compare import ask_sealag, compare, judge, report
from oracle.black_box.corpus import SUITE, random_design

SEED = int(os.environ.get("SEALAG_ORACLE_SEED", 20161115))
COUNT = int(os.environ.get("SEALAG_ORACLE_COUNT", 300))


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("black_box")
    return [compare(random_design(SEED + k, folder, SUITE)) for k in range(COUNT)]


def test_no_answer_differs(verdicts):
    print(f"seed {SEED}\n{report(verdicts)}")
    wrong = [v for v in verdicts if v.kind in ("disagree", "fault")]
    assert not wrong, f"seed {SEED}: {len(wrong)} of {COUNT} differ, first {wrong[0].path}"


def test_most_designs_are_decided(verdicts):
    """A corpus that is refused, or too near to the axis, compares nothing."""
    agreed = [v for v in verdicts if v.kind == "agree"]
    assert len(agreed) > COUNT / 2
    assert any(v.answer.unstable for v in agreed)
    assert any(np.isfinite(v.answer.margin) and v.answer.margin > 0.0 for v in agreed)


def test_refusals_say_why(verdicts):
    for verdict in verdicts:
        if verdict.kind == "refused":
            assert len(verdict.said.split()) > 4, verdict


def test_a_wrong_margin_is_noticed(verdicts, tmp_path):
    """The negative control: sealag's answer beside a black box whose margin is 2e-6 longer."""
    seen = 0
    for verdict in verdicts:
        ours = verdict.answer
        if verdict.kind != "agree" or not 0.0 < ours.margin < np.inf:
            continue
        theirs = ask_sealag(sealag.load(verdict.path))
        assert judge(ours, theirs)[0] == "agree"
        assert judge(replace(ours, margin=ours.margin * (1 + 2e-6)), theirs)[0] == "disagree"
        assert judge(replace(ours, unstable=1), theirs)[0] == "disagree"
        seen += 1
        if seen == 5:
            break
    assert seen


def test_a_black_box_without_contact_forces_differs(verdicts):
    broken("no_contact_forces", verdicts, lambda text: "[[contacts]]" in text)


def test_a_black_box_without_spring_damping_differs(verdicts):
    broken("no_spring_damping", verdicts, lambda text: "spring_damping" in text)


def broken(part, verdicts, has):
    """Some design that agrees and has a part no longer agrees once the part is left out."""
    some = [v for v in verdicts if v.kind == "agree" and has(v.path.read_text())][:12]
    assert some
    assert any(compare(v.path, **{part: True}).kind == "disagree" for v in some)
