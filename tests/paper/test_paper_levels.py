"""Corollary 1 on Hume: one priority level against two."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from humanoids2016 import Verdict, level_claim, level_table, planned_walk
from sealag.design import load
from sealag.whole_body import StiffnessForm

pytestmark = pytest.mark.slow

HUME = load("bundled:hume")


@pytest.fixture(scope="module")
def motion():
    return planned_walk(HUME, rate=20.0)


@pytest.fixture(scope="module")
def table(motion):
    return level_table(HUME, motion, instants=8)


def test_levels_agree_with_an_independent_semidefinite_program(table, motion):
    """(31) as printed, Q_i free, handed to CVXPY; W_i = d Q_i makes it linear in (d, W_i)."""
    for bounds, priorities in zip(table.levels, ((1, 2), (2, 1)), strict=True):
        tasks = tuple(
            replace(task, priority=p) for task, p in zip(HUME.law.tasks, priorities, strict=True)
        )
        law = replace(HUME.law, tasks=tasks, stiffness_form=StiffnessForm.PUBLISHED)
        spaces = replace(HUME, law=law).spaces(motion)
        at = int(np.argmin(np.abs(motion.time - table.time[0])))
        J, S = spaces.J_star[at], spaces.Lambda[at] @ spaces.K_x
        root = np.diag(HUME.actuators.motor_damping**-0.5)
        J, M = J @ root, root @ J.T @ S
        d, W = cp.Variable(), [cp.Variable((3, 3), symmetric=True) for _ in range(2)]
        corner = 2.0 * np.eye(J.shape[1]) - sum(
            J[3 * k : 3 * k + 3].T @ W[k] @ J[3 * k : 3 * k + 3] for k in range(2)
        )
        zero = np.zeros((3, 3))
        whole = cp.bmat([
            [corner, d * M[:, :3], d * M[:, 3:]],
            [d * M[:, :3].T, W[0], zero],
            [d * M[:, 3:].T, zero, W[1]],
        ])  # fmt: skip
        problem = cp.Problem(cp.Maximize(d), [whole >> 0])
        problem.solve(solver=cp.CLARABEL)
        assert bounds.delay_s[0] == pytest.approx(float(d.value), rel=1e-5)


def test_two_levels_are_sometimes_larger_so_the_conclusion_is_qualified(table):
    claim = level_claim(table)
    assert claim.verdict is Verdict.QUALIFIED
    assert table.single[0] == pytest.approx(0.12588, abs=2e-5)
    assert table.levels[0].delay_s[0] == pytest.approx(0.12607, abs=2e-5)


def test_smaller_bounds_confirm_it(table):
    smaller = tuple(replace(one, delay_s=0.9 * table.single) for one in table.levels)
    assert level_claim(replace(table, levels=smaller)).verdict is Verdict.CONFIRMED
