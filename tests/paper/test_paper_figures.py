"""The paper's figures and claims, computed small, with what must come out."""

from dataclasses import replace

import numpy as np
import pytest

from humanoids2016 import (
    PUBLISHED_LAW,
    TorqueTrace,
    Verdict,
    WalkCase,
    ablation_cases,
    figure_4,
    figure_4_claims,
    figure_5_claims,
    measured_lag,
    planned_walk,
    random_plant_table,
    robustness_cases,
    rough_grounds,
    simulate_walk,
    simulated_motion,
    unsafe_examples,
    walk_claim,
    walk_success,
)
from sealag.design import load
from sealag.walking import GroundProfile
from sealag.whole_body import StiffnessForm

pytestmark = pytest.mark.slow

HUME = load("bundled:hume")


@pytest.fixture(scope="module")
def table():
    return random_plant_table(60)


@pytest.fixture(scope="module")
def figure():
    return figure_4(HUME, planned_walk(HUME, rate=50.0))


def test_claims_of_figure_4(figure, table):
    verdicts = {claim.key: claim.verdict for claim in figure_4_claims(figure, table)}
    assert verdicts == {
        "alpha": Verdict.PROVEN,
        "abduction": Verdict.CONFIRMED,
        "stiffness": Verdict.PROVEN,
        "sufficient": Verdict.QUALIFIED,
    }


def test_a_figure_that_falls_contradicts_the_claims(figure, table):
    wrong = replace(
        figure, delay_s=figure.delay_s[::-1, ::-1], stiffness_delay_s=figure.stiffness_delay_s[::-1]
    )
    wrong_table = replace(table, certified_longer=1)
    verdicts = {claim.key: claim.verdict for claim in figure_4_claims(wrong, wrong_table)}
    for key in ("alpha", "abduction", "sufficient"):
        assert verdicts[key] is Verdict.CONTRADICTED
    assert verdicts["stiffness"] is Verdict.CONTRADICTED


def test_numbers_off_a_theorem_contradict_it(figure, table):
    partly = replace(figure, stiffness_delay_s=figure.stiffness_delay_s * [1.0, 1.0, 1.01])
    sound = replace(table, published_longer=0)
    verdicts = {claim.key: claim.verdict for claim in figure_4_claims(partly, sound)}
    assert verdicts["stiffness"] is Verdict.CONTRADICTED  # falls, not in inverse proportion
    assert verdicts["sufficient"] is Verdict.CONFIRMED


def _trace(*, beta, alpha, deviation, raw, lag, walk):
    return TorqueTrace(
        beta=beta, damping_scale=alpha, stiffness=350.0, walk=walk, sent=np.zeros((0, 6)),
        command=np.zeros((0, 6)),
        achieved=np.zeros((0, 6)), deviation=np.full(6, deviation), raw_deviation=np.full(6, raw),
        command_lag=lag, torque_lag=lag, channel=0.0158,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("sign", "lag", "verdict"),
    [(1.0, 0.017, Verdict.CONFIRMED), (-1.0, 0.030, Verdict.CONTRADICTED)],
)
def test_claims_of_figure_5_follow_the_torques(sign, lag, verdict):
    walk = simulate_walk(HUME, WalkCase(walking=replace(HUME.walking, steps=1)))
    traces = [
        _trace(beta=beta, alpha=alpha, deviation=5 + sign * (beta + alpha), lag=lag,
               raw=50 + sign * 30 * alpha, walk=walk)
        for alpha in (0.3, 1.0) for beta in (0.1, 1.0)
    ]  # fmt: skip
    verdicts = {claim.key: claim.verdict for claim in figure_5_claims(traces)}
    assert verdicts == {"beta": verdict, "damping deviation": verdict, "lag": verdict}
    other = 0.023 if sign > 0.0 else 0.017
    deviation = traces[0].deviation
    mixed = [*traces[:-1], replace(traces[-1], deviation=deviation, torque_lag=other)]
    verdicts = {claim.key: claim.verdict for claim in figure_5_claims(mixed)}
    assert set(verdicts.values()) == {Verdict.QUALIFIED}


def test_the_default_project_walks_twenty_rough_grounds_with_noise_and_wrong_models():
    cases = {k: v for k, v in robustness_cases(HUME.walking).items() if k.startswith("noise and")}
    cases[PUBLISHED_LAW] = ablation_cases(HUME.walking)[PUBLISHED_LAW]
    robust, published = walk_success(cases, rough_grounds(20))
    assert robust.gaits >= 19, robust.causes
    claim = walk_claim([robust], published)
    assert claim.verdict is Verdict.QUALIFIED  # it walks, but not with the law as printed
    assert published.walked == 0
    assert walk_claim([published], published).verdict is Verdict.CONTRADICTED


def test_figure_4_is_proportional_to_alpha_and_the_swing_leg_hardly_counts(figure):
    ratio = figure.delay_s / figure.alpha
    np.testing.assert_allclose(ratio, ratio[:, :1] * np.ones_like(ratio), rtol=1e-9)
    np.testing.assert_allclose(figure.both_legs_delay_s, figure.delay_s, rtol=0.02)
    assert (figure.both_legs_delay_s <= figure.delay_s * (1 + 1e-9)).all()


def test_the_printed_law_is_refused_and_the_corrected_one_is_shorter(figure):
    by = {(v.form, v.signal): v for v in figure.certified if v.gravity == "planned"}
    printed = figure.certified[0]
    assert printed.form is StiffnessForm.PUBLISHED
    assert "not symmetric" in printed.reason
    static = by[StiffnessForm.SYMMETRIC, "static_joint"].delay_s.min()
    motor = by[StiffnessForm.SYMMETRIC, "motor"].delay_s.min()
    assert 0.0 < static < 0.6 * motor


def test_unsafe_examples_of_theory_6():
    examples = unsafe_examples(draws=60)
    first, second, link = examples[:3]
    assert first.published_delay_s == pytest.approx(0.1, rel=1e-9)
    assert first.certified_delay_s == pytest.approx(1 / 14, rel=1e-6)
    assert first.margin_s == pytest.approx(0.0773, abs=5e-5)
    assert second.certified_delay_s == pytest.approx(0.00476, abs=5e-6)
    assert second.margin_s == pytest.approx(0.00476, abs=5e-6)
    assert link.certified_delay_s is None
    assert link.margin_s == pytest.approx(0.0745, abs=5e-5)
    assert all(example.published_is_unsafe for example in examples)
    assert not any(example.certified_is_unsafe for example in examples)
    assert len(examples) > 5


def test_random_plants_show_the_difference():
    table = random_plant_table(120, seed=40)
    assert table.certified_longer == 0
    assert table.smallest_ratio >= 1.0
    assert table.published_longer >= table.published_without_delay > 2
    assert table.other_longer > 5
    assert table.presupposed > 10
    assert table.certified_spoke > 20


def test_lag_estimate_finds_a_known_shift():
    t = np.arange(3000) * 1e-3
    sent = np.column_stack([np.sin(9 * t) + np.sin(23 * t), np.cos(14 * t)])
    acting = np.column_stack(
        [np.sin(9 * (t - 0.0174)) + np.sin(23 * (t - 0.0174)), np.cos(14 * (t - 0.0174))]
    )
    assert measured_lag(t, sent, acting) == pytest.approx(0.0174, abs=1e-4)
    assert measured_lag(t, sent, sent) == pytest.approx(0.0, abs=1e-4)


def test_hume_walks_and_the_energy_closes():
    walk = simulate_walk(HUME)
    assert walk.gait.walked, walk.gait.cause
    assert walk.gait.is_gait
    assert walk.run.audit.closure < 1e-4
    assert walk.run.measurement_age.max() > 0.01
    motion = simulated_motion(walk.run)
    assert {c[0].frame for c in motion.contact_sets} == {"left_foot", "right_foot"}
    carrying = np.array([c[0].frame for c in motion.contact_sets])[motion.contact_index]
    switches = np.count_nonzero(carrying[1:] != carrying[:-1])
    assert walk.gait.steps - 1 <= switches <= walk.gait.steps + 3
    standing = np.array([len(c) for c in motion.contact_sets])[motion.contact_index]
    forces = [walk.run.contact_force[:, k, 2] > 0.0 for k in range(len(walk.run.feet))]
    both = np.sum(forces, axis=0) == 2
    np.testing.assert_array_equal(standing == 2, both)
    assert 0.1 < both.mean() < 0.3


def test_a_walk_beyond_its_delay_ends_as_a_named_fall():
    flat = replace(HUME.walking, ground=GroundProfile.flat())
    walk = simulate_walk(HUME, WalkCase(walking=flat, delay_scale=8.0))
    assert not walk.gait.walked
    assert walk.run.outcome.value in {"fell", "diverged", "contact_unsolvable", "chattered"}
    assert str(walk.gait.steps) in walk.gait.cause
