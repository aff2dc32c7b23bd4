"""A solver that stops early, lies or forgets ends in `not_certified` with its own words."""

import functools
import json
from dataclasses import replace

import pytest

import sealag
from helpers.certificates import failures, half_a_step, plain
from helpers.designs import EXAMPLES
from helpers.solvers import LIES, Forgetful, Lying
from sealag.cli import main
from sealag.passivity import ClarabelCvxpy, ClarabelDirect, Criterion

BAD = {
    "starved": (ClarabelDirect(max_iterations=1), "Clarabel left the bracket open: MaxIterations"),
    "starved CVXPY": (ClarabelCvxpy(max_iterations=1), "CVXPY + Clarabel left the bracket open"),
    **{lie: (Lying(change), "a liar left the bracket open: Solved") for lie, change in LIES.items()
       if lie != "noise"},
    "forgetful": (Forgetful(0), "a forgetful solver left the bracket open: forgot"),
}  # fmt: skip


def late(system, d_1):
    """The same design with another constant total delay, s, its controller's hold in it."""
    bare = replace(system.delays, sample_time=0.0)
    hold = bare.sampled().d_1 - bare.d_1
    found = replace(system, delays=bare.scaled((d_1 - hold) / bare.d_1))
    assert found.delays.d_1 == pytest.approx(d_1, rel=1e-12)
    return found


@pytest.fixture(scope="module")
def walk():
    """Hume under a delay that its bound with one multiplier just covers, and half a step."""
    system = late(sealag.load("bundled:hume"), 0.115)
    return system, half_a_step(system)


def test_a_good_solver_certifies_both_designs(walk):
    certificate = sealag.certify(*walk, time_varying=True)
    assert certificate.answer.status == "passive_only"  # a step on point feet stands nowhere
    assert certificate.answer.left_open == {}
    assert certificate.question.delay_s <= certificate.answer.time_varying_delay_s
    answer = sealag.certify(crawl(), criterion="published").answer
    assert answer.left_open == {}
    assert answer.max_delay_s > 0.095  # as printed; the loop is stable up to 74 ms only
    (reason,) = answer.reasons
    assert "loses its stability at 73.639 ms" in reason


@pytest.mark.parametrize("name", BAD)
def test_a_bad_solver_of_a_motion_is_not_certified(name, walk):
    solver, words = BAD[name]
    certificate = sealag.certify(*walk, solver=solver)
    assert certificate.answer.status == "not_certified"
    assert len(certificate.answer.reasons) == 1
    assert "one multiplier" in certificate.answer.reasons[0]
    assert words in certificate.answer.reasons[0]
    assert words in certificate.answer.left_open["common_multiplier_delay_s"]
    assert (
        certificate.answer.common_multiplier_delay_s
        < certificate.question.delay_s
        <= certificate.answer.max_delay_s
    )
    assert failures(plain(certificate), exact=True) == []


def test_a_bad_solver_of_polytopes_is_not_certified(walk):
    """The common multiplier is found, then the solver forgets."""
    good = sealag.certify(*walk)
    for answers in range(1, 20):
        certificate = sealag.certify(*walk, time_varying=True, solver=Forgetful(answers))
        if certificate.answer.common_multiplier_delay_s == good.answer.common_multiplier_delay_s:
            break
    assert certificate.answer.status == "not_certified"
    assert "matrices that move" in certificate.answer.reasons[0]
    assert set(certificate.answer.left_open) == {"time_varying_delay_s"}
    assert failures(plain(certificate)) == []


def test_a_bad_solver_whose_part_is_enough_costs_nothing(walk):
    """What one iteration proves is proven: tightness is lost, no truth."""
    system, motion = walk
    starved = ClarabelDirect(max_iterations=1)
    proven = sealag.certify(system, motion, solver=starved).answer.common_multiplier_delay_s
    certificate = sealag.certify(late(system, 0.99 * proven), motion, solver=starved)
    assert proven > 0.01
    assert certificate.answer.status == "passive_only"
    assert "common_multiplier_delay_s" in certificate.answer.left_open
    assert failures(plain(certificate), exact=True) == []


def crawl():
    """Two priority levels under a delay between 1/Σw and the bound of (31)."""
    return late(sealag.load(EXAMPLES / "anymal_crawl.toml"), 0.095)


@pytest.mark.parametrize(
    ("solver", "words"),
    [
        (ClarabelDirect(max_iterations=1), "Clarabel left the bracket open: MaxIterations"),
        (Lying(LIES["too large"]), "a liar left the bracket open: Solved"),
        (Lying(LIES["not a number"]), "a liar left the bracket open: Solved"),
    ],
)
def test_a_bad_solver_of_two_levels_is_not_certified(solver, words):
    certificate = sealag.certify(crawl(), criterion="published", solver=solver)
    assert certificate.answer.status == "not_certified"
    assert words in certificate.answer.reasons[0]
    assert words in certificate.answer.left_open["max_delay_s"]
    assert (
        certificate.answer.max_delay_s
        < certificate.question.delay_s
        < certificate.answer.max_delay_upper_s
    )
    assert failures(plain(certificate), exact=True) == []


@pytest.mark.parametrize("answers", [1, 0])
def test_a_bound_without_a_proof_is_withdrawn(answers):
    """Between bound and multipliers the solver forgets: no error, and no bound."""
    solver = Forgetful(answers)
    certificate = sealag.certify(crawl(), criterion=Criterion.PUBLISHED, solver=solver)
    assert certificate.answer.status == "not_certified"
    assert "forgot" in " ".join(certificate.answer.reasons)
    assert (certificate.answer.max_delay_s == 0.0) == (answers == 1)
    assert failures(plain(certificate)) == []


def test_the_command_line_says_it_too(walk, tmp_path, monkeypatch, capsys):
    system, motion = walk
    path = tmp_path / "walk.npz"
    system.save_motion(motion, path)
    monkeypatch.setattr("sealag.design.load", lambda project: system)

    def answer(*options):
        out = tmp_path / "c.json"
        with pytest.raises(SystemExit) as stop:
            main(["certify", "bundled:hume", "--motion", str(path), "--out", str(out), *options])
        return stop.value.code, capsys.readouterr().out

    code, text = answer("--json")
    assert (code, json.loads(text)["status"]) == (1, "passive_only")
    assert answer("--json", "--allow-unstable")[0] == 0
    starved = functools.partial(sealag.certify, solver=ClarabelDirect(max_iterations=1))
    monkeypatch.setattr("sealag.design.certify", starved)
    code, text = answer("--json", "--allow-unstable")
    found = json.loads(text)
    assert (code, found["status"]) == (1, "not_certified")
    assert "MaxIterations after 1 iterations" in found["reasons"][0]
    assert "MaxIterations" in found["left_open"]["common_multiplier_delay_s"]
    code, text = answer()
    assert code == 1
    assert "not certified because it is open whether" in text
    assert "open whether common_multiplier_delay_s is longer: Clarabel" in text


def test_a_forged_yes_is_found(walk):
    data = plain(sealag.certify(*walk, solver=ClarabelDirect(max_iterations=1)))
    assert failures(data) == []
    for status, reasons in (("certified", []), ("passive_only", ["it is unstable"])):
        data.update(status=status, reasons=reasons)
        assert failures(data) == ["verdict"]
