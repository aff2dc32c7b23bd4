"""The closed form against Theorem 1 as one SDP, solved by CVXPY and Clarabel."""

import cvxpy as cp
import numpy as np
import pytest

from helpers.levels import instant_bound
from sealag.passivity import max_delay

SIZES = [
    (6, 3, 3),
    (3, 3, 3),
    (3, 6, 3),
    (1, 1, 1),
    (6, 6, 6),
    (2, 4, 2),
    (6, 6, 4),
    (6, 3, 2),
    (4, 4, 1),
]


def theorem_1(J, S, D):
    """sup d over W ≻ 0 (W = dQ): [[2D − JᵀWJ, dF],[dFᵀ, …]] ⪰ 0 with F = JᵀS, one SDP.

    (29) times −2 with W = d Q: [[2D − JᵀWJ, −d JᵀS], [−d SᵀJ, W]] ⪰ 0. Everything is scaled to
    a norm near 1 before it is solved, and the delay scaled back.
    """
    scale = np.linalg.norm(J.T @ S @ J) / np.linalg.norm(D)
    R = np.diag(1.0 / np.sqrt(np.diag(D)))
    J, S = J @ R, S / scale
    n, m = J.shape[1], J.shape[0]
    W, d = cp.Variable((m, m), symmetric=True), cp.Variable()
    block = cp.bmat([[2 * np.eye(n) - J.T @ W @ J, -d * (J.T @ S)], [-d * (S.T @ J), W]])
    problem = cp.Problem(cp.Maximize(d), [(block + block.T) / 2 >> 0])
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
    return float(d.value) / scale


def random_problem(rng, m, n, rank):
    J = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    X = rng.normal(size=(m, m))
    Lambda = X @ X.T + 0.1 * np.eye(m)
    return J, Lambda, 10.0 ** rng.uniform(0, 2, m), rng.uniform(1, 10, n)


@pytest.mark.parametrize("form", ["symmetric", "published"])
@pytest.mark.parametrize("size", SIZES)
def test_agrees_with_the_sdp(size, form):
    rng = np.random.default_rng(hash((*size, len(form))) % 2**32)
    for _ in range(3):
        J, Lambda, K_x, D = random_problem(rng, *size)
        w, V = np.linalg.eigh(Lambda)
        half = V @ np.diag(np.sqrt(w)) @ V.T
        S = half @ np.diag(K_x) @ half if form == "symmetric" else Lambda @ np.diag(K_x)
        bound = max_delay(J, Lambda, K_x, D, form=form)
        # The printed block is J*ᵀ S: its delay is in velocities J*θ̇, so F = J*ᵀ S on x̃.
        reference = theorem_1(J, S, np.diag(D))
        assert bound.width <= 1e-6
        assert bound.delay <= reference * (1 + 1e-6)
        assert bound.upper >= reference * (1 - 1e-6)


def near_rotation(seed):
    """J* = R, Λ K_x nearly a rotation: the radius is reached far from φ = 0."""
    rng = np.random.default_rng(seed)
    c, s = np.cos(1.2), np.sin(1.2)
    A = np.array([[c, -s, 0.3], [s, c, 0.0], [0.1, 0.0, 0.2]]) + 0.05 * rng.normal(size=(3, 3))
    return A


@pytest.mark.parametrize("seed", range(4))
def test_radius_reached_away_from_zero_angle(seed):
    A = near_rotation(seed)
    D = np.array([1.0, 2.0, 3.0])
    bound = instant_bound(A, D)
    reference = theorem_1(np.eye(3), A, np.diag(D))
    assert bound.angle > 0.1
    assert bound.delay <= reference * (1 + 1e-6)
    assert bound.upper >= reference * (1 - 1e-6)
    R = np.diag(1 / np.sqrt(D))
    shortcut = 1 / np.linalg.eigvalsh(R @ (A + A.T) @ R / 2)[-1]
    assert shortcut > 1.05 * reference, "the shortcut must fail here, or this test shows nothing"
