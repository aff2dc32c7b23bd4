"""Corollary 1 against an SDP written down in the paper's own variables."""

import cvxpy as cp
import numpy as np
import pytest

from helpers.levels import Saying, problem_of
from sealag.passivity import Instant, Motion, Problem, solve


def corollary_1(tasks, D):
    """(31): [[2D − Σ J_iᵀ W_i J_i, d J_iᵀ S_i …], [⋆, W_i]] ⪰ 0, W_i = d Q_i."""
    d = cp.Variable()
    W = [cp.Variable(S.shape, symmetric=True) for _, S in tasks]
    corner = 2 * np.diag(D) - sum(J.T @ w @ J for (J, _), w in zip(tasks, W, strict=True))
    rows = [[corner, *(d * (J.T @ S) for J, S in tasks)]]
    for i, (J, S) in enumerate(tasks):
        blocks = [W[j] if j == i else np.zeros((len(S), len(tasks[j][1]))) for j in range(len(W))]
        rows.append([d * (S.T @ J), *blocks])
    block = cp.bmat(rows)
    problem = cp.Problem(cp.Maximize(d), [(block + block.T) / 2 >> 0])
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
    return float(d.value)


def problem(seed, sizes, n, form):
    rng = np.random.default_rng(seed)
    tasks, plain = [], []
    for m in sizes:
        J, X = rng.normal(size=(m, n)), rng.normal(size=(m, m))
        Lambda, K_x = X @ X.T + 0.1 * np.eye(m), rng.uniform(1, 10, m)
        w, V = np.linalg.eigh(Lambda)
        half = V @ np.diag(np.sqrt(w)) @ V.T
        plain.append((J, half @ np.diag(K_x) @ half if form == "symmetric" else Lambda * K_x))
        tasks.append((J, Lambda, K_x))
    return tasks, plain, rng.uniform(5, 50, n)


@pytest.mark.parametrize("form", ["symmetric", "published"])
@pytest.mark.parametrize("sizes", [(2, 2), (3, 3), (1, 2, 3), (6, 3)])
def test_agrees_with_the_sdp(sizes, form):
    for seed in range(2):
        tasks, plain, D = problem(seed, sizes, 3, form)
        bound = solve(problem_of(tasks, D, form=form), share=Instant())
        reference = corollary_1(plain, D)
        assert bound.delay <= reference * (1 + 1e-6)
        assert bound.delay >= reference * (1 - 3e-6)
        assert bound.upper >= reference * (1 - 1e-6)


@pytest.mark.parametrize("sizes", [(2, 2), (1, 2, 3)])
def test_levels_with_one_gain_each_need_no_solver(sizes):
    """k Λ is symmetric: the published bound is that of all levels together, and the SDP agrees."""
    for seed in range(2):
        tasks, _, D = problem(seed, sizes, 3, "published")
        tasks = [(J, Lambda, np.full(len(K), K[0])) for J, Lambda, K in tasks]
        stated = problem_of(tasks, D, form="published")
        assert stated.closed_form
        bound = solve(stated, share=Instant(), solver=None)
        reference = corollary_1([(J, Lambda * K) for J, Lambda, K in tasks], D)
        assert bound.delay == pytest.approx(reference, rel=3e-6)
        residual = bound.eased(1.0 - 1e-7).prove().residual()
        assert residual.lowest > residual.rounding
        tasks[-1][2][-1] *= 1.001
        assert problem_of(tasks, D, form="published").closed_form == (sizes[-1] == 1)


@pytest.mark.parametrize("every", [True, False])
def test_published_batch_is_closed_where_it_is_smallest_or_everywhere(every):
    """Of a batch the solver closes every bracket, or those that can be the smallest."""
    tasks, _, D = problem(3, (2, 3), 4, "published")
    sizes = np.array([1.0, 0.7, 1.3, 1.0])
    batch = [(size_of(sizes) * J, np.stack([L] * 4), K) for J, L, K in tasks]
    bound = solve(problem_of(batch, D, form="published"), share=Instant(every=every))
    single = solve(problem_of(tasks, D, form="published"), share=Instant())
    np.testing.assert_allclose(bound.delay.min(), single.delay / 1.3**2, rtol=1e-5)
    closed = bound.width <= 1e-6
    assert closed[2]
    assert closed.all() == every
    assert (bound.delay <= single.upper / sizes**2 * (1 + 1e-9)).all()


def size_of(sizes):
    return sizes[:, None, None]


def test_batch_equals_single_instants():
    tasks, _, D = problem(3, (2, 3), 4, "symmetric")
    batch = [(np.stack([J, 2 * J]), np.stack([L, L]), K) for J, L, K in tasks]
    both = solve(problem_of(batch, D), share=Instant())
    single = solve(problem_of(tasks, D), share=Instant())
    np.testing.assert_allclose(both.delay[0], single.delay, rtol=1e-9)
    np.testing.assert_allclose(both.delay[1], both.delay[0] / 4, rtol=1e-9)


def proves(A, Y):
    one = Problem(J=np.eye(len(A))[None], M=A[None], blocks=(len(A),))
    return solve(one, share=Motion(), solver=Saying(W=Y)).delay >= 1.0


def test_wrong_multipliers_prove_nothing():
    A = np.array([[1.0, 0.3], [0.3, 1.0]])
    assert proves(0.9 * A / 1.3, 0.9 * A / 1.3 + 0.01 * np.eye(2))
    assert not proves(A, 0.5 * A)
    assert not proves(1.1 * A / 1.3, 1.1 * A / 1.3)
