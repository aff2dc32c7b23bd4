"""Certificates by (31) as printed carry one multiplier for each priority level."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.certificates import failures, made
from helpers.levels import problem_of
from helpers.solvers import Forgetful
from sealag.errors import SolverError
from sealag.passivity import Instant, max_delay, solve

SEED = 31


def random_tasks(rng, n=5, rows=(2, 3)):
    tasks = []
    for m in rows:
        root = rng.standard_normal((m, m))
        gains = 10.0 ** rng.uniform(0, 2, m)
        tasks.append((rng.standard_normal((m, n)), root @ root.T + 0.1 * np.eye(m), gains))
    return tasks, 10.0 ** rng.uniform(0, 2, n)


def printed(tasks, D, Qs, d):
    """(31): [[−D + ½ d Σ J_iᵀQ_iJ_i, ½ d M_1 …], [⋆, −½ d diag(Q_i)]], largest eigenvalue."""
    corner = -np.diag(D)
    m = sum(len(Q) for Q in Qs)
    block = np.zeros((m, m))
    M, first = [], 0
    for (J, Lambda, K_x), Q in zip(tasks, Qs, strict=True):
        corner = corner + 0.5 * d * J.T @ Q @ J
        M.append(J.T @ Lambda @ np.diag(K_x))
        block[first : first + len(Q), first : first + len(Q)] = -0.5 * d * Q
        first += len(Q)
    M = 0.5 * d * np.hstack(M)
    return float(np.linalg.eigvalsh(np.block([[corner, M], [M.T, block]]))[-1])


def test_multipliers_prove_the_printed_inequality_up_to_the_bound():
    """By 1/Σw, and by a solver between 1/Σw and the bound."""
    rng = np.random.default_rng(SEED)
    for _ in range(6):
        tasks, D = random_tasks(rng)
        parts = [float(max_delay(*task, D, form="published").delay) for task in tasks]
        split = 1.0 / sum(1.0 / part for part in parts)
        bound = solve(problem_of(tasks, D, form="published"), share=Instant())
        best = float(bound.delay)
        assert best > split * 1.001
        for delay in (0.5 * split, split * (1.0 - 1e-7), best * (1.0 - 1e-6)):
            found = replace(bound, delay=np.array(delay)).prove()
            assert [block.shape for block in found.blocks] == [(2, 2), (3, 3)]
            assert printed(tasks, D, [block / delay for block in found.blocks], delay) < 1e-9
        with pytest.raises(SolverError):
            replace(bound, delay=1.01 * bound.delay).prove()


def test_a_task_without_stiffness_takes_next_to_no_damping():
    rng = np.random.default_rng(SEED)
    tasks, D = random_tasks(rng)
    J, Lambda, K_x = tasks[1]
    alone = float(max_delay(*tasks[0], D, form="published").delay)
    tasks[1] = (J, Lambda, 0.0 * K_x)
    bound = solve(problem_of(tasks, D, form="published"), share=Instant()).eased(1.0 - 1e-7)
    assert bound.delay == pytest.approx(alone, rel=1e-6)
    delay = float(bound.delay)
    assert printed(tasks, D, [block / delay for block in bound.prove().blocks], delay) < 1e-9


@pytest.mark.parametrize("form", ["symmetric", "force"])
def test_symmetric_levels_are_proven_without_a_solver(form):
    """1/w(Σ A_i) is the bound, beyond 1/Σw, and the solver is not called."""
    rng = np.random.default_rng(SEED)
    tasks, D = random_tasks(rng)
    bound = solve(problem_of(tasks, D, form=form), share=Instant(), solver=Forgetful(0))
    split = 1.0 / sum(1.0 / float(max_delay(*task, D, form=form).delay) for task in tasks)
    assert bound.delay > 1.001 * split
    residual = bound.eased(1.0 - 1e-7).prove(solver=Forgetful(0)).residual()
    assert residual.lowest > residual.rounding


@pytest.mark.parametrize("exact", [False, True])
def test_a_certificate_of_two_levels_holds_and_each_level_matters(exact):
    data = made("crawl")
    proof = data["proofs"][0]
    assert [len(block) for block in proof["W"]] == list(np.diff(data["levels"])) == [6, 3]
    assert failures(data, exact=exact) == []
    for level in (0, 1):
        for factor in (0.5, 2.0):
            broken = made("crawl")
            block = broken["proofs"][0]
            for key in ("W", "Q"):
                block[key][level] = (factor * np.array(block[key][level])).tolist()
            assert failures(broken, exact=exact) == ["instant 0: matrix inequality"]


def test_levels_are_kept_apart():
    broken = made("crawl")
    broken["proofs"][0]["stiffness"][0][7] = 1.0
    assert "instant 0: priority levels" in failures(broken)
    broken = made("crawl")
    broken["levels"] = [0, 3, 9]
    assert "`proofs[0].W[0]` has 6 entries where 3 are needed" in failures(broken)[0]
