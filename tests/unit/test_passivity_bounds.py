"""Bounds at the edges: refused input, units, batches, zero and nearly singular problems."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.levels import instant_bound
from sealag.errors import InputError, SolverError
from sealag.passivity import Instant, Motion, Problem, max_delay, solve

J = np.array([[1.0, 0.2, 0.0], [0.0, 1.0, 0.3], [0.1, 0.0, 1.0]])
LAMBDA = np.diag([1.0, 2.0, 3.0])
K_X = np.array([10.0, 20.0, 5.0])
D = np.array([1.0, 2.0, 4.0])


def test_symmetric_stiffness_has_its_spectral_radius():
    F = np.diag([1.0, 8.0, 2.0])
    bound = instant_bound(F, D)
    assert bound.delay == pytest.approx(0.25, rel=1e-12)
    assert bound.delay <= 0.25 <= bound.upper
    np.testing.assert_allclose(bound.direction, [0.0, 1.0, 0.0], atol=1e-12)


def test_full_matrices_mean_the_same_as_diagonals():
    one = max_delay(J, LAMBDA, K_X, D)
    other = max_delay(J, LAMBDA, np.diag(K_X), np.diag(D))
    assert other.delay == pytest.approx(float(one.delay), rel=1e-12)


def test_any_batch_shape():
    batch = np.stack([J, 2 * J, 3 * J])[:, None] * np.array([1.0, -1.0])[:, None, None]
    bound = max_delay(batch, LAMBDA, K_X, D)
    single = max_delay(J, LAMBDA, K_X, D)
    assert bound.delay.shape == (3, 2)
    assert bound.direction.shape == (3, 2, 3)
    np.testing.assert_allclose(bound.delay[:, 0] * [1, 4, 9], single.delay, rtol=1e-12)
    np.testing.assert_allclose(bound.direction.sum(axis=-1), 1.0)


@pytest.mark.parametrize("form", ["symmetric", "published", "force"])
def test_zero_stiffness_allows_every_delay(form):
    for J_star, gain in ((0 * J, K_X), (J, 0 * K_X)):
        bound = max_delay(J_star, LAMBDA, gain, D, form=form)
        assert bound.delay == np.inf
        assert bound.upper == np.inf
        assert bound.width == 0.0


@pytest.mark.parametrize("form", ["symmetric", "published"])
@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_change_nothing(unit, form):
    one = max_delay(J, LAMBDA, K_X, D, form=form)
    rows = max_delay(J * unit, LAMBDA / unit**2, K_X, D, form=form)
    gains = max_delay(J, LAMBDA, K_X * unit, D * unit, form=form)
    for other in (rows, gains):
        assert other.delay == pytest.approx(float(one.delay), rel=1e-6)
        assert other.width <= 1e-6
        assert other.delay <= one.upper
        assert one.delay <= other.upper


def test_singular_inertia_costs_no_width_where_its_kernel_is_out_of_reach():
    rng = np.random.default_rng(1)
    reach = rng.normal(size=(6, 3))
    Lambda = np.linalg.pinv(reach @ reach.T, rcond=1e-10, hermitian=True)
    gains = np.array([100.0, 100, 100, 50, 50, 50])
    bound = max_delay(reach @ rng.normal(size=(3, 3)), (Lambda + Lambda.T) / 2, gains, D)
    assert bound.width <= 1e-6


def test_nearly_singular_jacobian_and_inertia_keep_the_bracket():
    for small in (1e-4, 1e-8, 1e-12, 0.0):
        thin = np.diag([1.0, 1.0, small]) @ J
        Lambda = np.diag([1.0, 2.0, small])
        bound = max_delay(thin, Lambda, K_X, D)
        root = np.diag(np.sqrt(np.diag(Lambda)))
        S = root @ np.diag(K_X) @ root
        R = np.diag(1 / np.sqrt(D))
        exact = 1 / np.linalg.eigvalsh(R @ thin.T @ S @ thin @ R)[-1]
        assert bound.delay <= exact * (1 + 1e-14)
        assert bound.upper >= exact * (1 - 1e-14)
        assert bound.width <= 1e-6


def test_repeated_eigenvalues():
    bound = instant_bound(np.eye(4) * 5.0, np.ones(4))
    assert bound.delay == pytest.approx(0.2, rel=1e-12)
    assert bound.delay <= 0.2 <= bound.upper


BAD = {
    "J_star has entries": {"J_star": np.where(J == 1.0, np.nan, J)},
    "K_x has entries": {"K_x": np.array([1.0, np.inf, 1.0])},
    "Lambda is not positive semidefinite": {"Lambda": np.diag([1.0, 1.0, -1.0])},
    "Lambda is not symmetric": {"Lambda": LAMBDA + np.eye(3, k=1)},
    "K_x is not positive semidefinite": {"K_x": np.array([1.0, -1.0, 1.0])},
    r"D_theta\[1\] is 0": {"D_theta": np.array([1.0, 0.0, 1.0])},
    r"D_theta\[2\] is -3": {"D_theta": np.array([1.0, 1.0, -3.0])},
    "D_theta has entries": {"D_theta": np.array([1.0, np.nan, 1.0])},
    "D_theta has shape": {"D_theta": np.ones(4)},
    "D_theta is not symmetric": {"D_theta": np.eye(3) + np.eye(3, k=1)},
    "D_theta is not positive definite": {"D_theta": np.diag([1.0, 1.0, 0.0])},
    "K_x has shape": {"K_x": np.ones(2)},
    "J_star has shape": {"J_star": np.ones(3)},
    "form is": {"form": "odd"},
    "tolerance is": {"tolerance": 0.0},
}


@pytest.mark.parametrize(("words", "change"), list(BAD.items()), ids=list(BAD))
def test_bad_input_is_refused(words, change):
    arguments = {"J_star": J, "Lambda": LAMBDA, "K_x": K_X, "D_theta": D, **change}
    with pytest.raises(InputError, match=words):
        max_delay(**arguments)


def test_bad_stiffness_is_refused():
    for F in (np.ones((2, 3)), np.full((3, 3), np.nan), np.zeros((0, 0)), np.float64(3)):
        with pytest.raises(InputError, match="F has"):
            Problem.of_stiffness(F, D)


@pytest.mark.parametrize(
    ("m", "n", "rank"), [(3, 3, 3), (6, 3, 3), (2, 4, 2), (6, 6, 4), (4, 4, 1)]
)
@pytest.mark.parametrize("form", ["symmetric", "published"])
def test_multiplier_satisfies_the_printed_inequality(m, n, rank, form):
    rng = np.random.default_rng(m + 10 * n)
    jacobian = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    X = rng.normal(size=(m, m))
    Lambda, gains, damping = X @ X.T + 0.1 * np.eye(m), rng.uniform(1, 50, m), rng.uniform(1, 9, n)
    bound = max_delay(jacobian, Lambda, gains, damping, form=form).eased(1 - 1e-5)
    found = bound.prove()
    delay, Q = float(found.delay), found.multiplier / found.delay
    w, V = np.linalg.eigh(Lambda)
    half = V * np.sqrt(w) @ V.T
    S = half @ np.diag(gains) @ half if form == "symmetric" else Lambda * gains

    def lowest(d, Q):
        corner = -np.diag(damping) + 0.5 * d * jacobian.T @ Q @ jacobian
        side = 0.5 * d * jacobian.T @ S
        printed = -np.block([[corner, side], [side.T, -0.5 * d * Q]])
        unit = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(printed)), 1e-12))
        return np.linalg.eigvalsh(unit[:, None] * printed * unit)[0]

    assert lowest(delay, Q) >= -1e-13
    assert found.residual().lowest > found.residual().rounding
    longer = replace(found, delay=1.01 * found.delay)
    assert lowest(1.01 * delay, Q) < -1e-10, "the check must see a delay that is too long"
    assert longer.residual().lowest < -longer.residual().rounding


def test_no_multiplier_above_the_supremum():
    bound = max_delay(J, LAMBDA, K_X, D)
    with pytest.raises(SolverError, match="at the supremum"):
        replace(bound, delay=1.000001 * bound.upper).prove()
    with pytest.raises(InputError, match="positive finite"):
        replace(bound, delay=np.array(np.nan)).prove()
    with pytest.raises(InputError, match="one instant"):
        max_delay(np.stack([J, J]), LAMBDA, K_X, D).prove()
    with pytest.raises(InputError, match="no multiplier to measure"):
        bound.residual()
    with pytest.raises(InputError, match="no single direction"):
        _ = solve(bound.problem, share=Motion()).direction


def test_levels_that_are_coupled_or_do_not_fit_are_refused():
    for levels in ((0, 2), (0, 2, 2, 3), (1, 3), (0,)):
        with pytest.raises(InputError, match="levels is"):
            Problem.of_tasks(J, LAMBDA, K_X, D, levels=levels)
    coupled = LAMBDA + 0.1 * (np.eye(3, k=1) + np.eye(3, k=-1))
    with pytest.raises(InputError, match="Lambda couples"):
        Problem.of_tasks(J, coupled, K_X, D, levels=(0, 2, 3))
    with pytest.raises(InputError, match="K_x couples"):
        Problem.of_tasks(J, LAMBDA, coupled, D, levels=(0, 2, 3))
    Problem.of_tasks(J, coupled, K_X, D, levels=(0, 2, 3), form="force")


def test_a_refused_instant_has_no_delay_and_says_why():
    bound = max_delay(np.stack([J, 2 * J]), LAMBDA, K_X, D)
    refused = bound.refused([1], "the second is refused")
    assert refused.delay[1] == refused.upper[1] == 0.0
    assert refused.delay[0] == bound.delay[0]
    assert refused.refusals == ("the second is refused",)
    assert solve(bound.problem, share=Instant()).refusals == ()


def test_instants_that_are_not_there_are_named():
    """Of a single instant, which has no number, and of a motion that is shorter."""
    F = np.diag([1.0, 8.0, 2.0])
    single, motion = instant_bound(F, D), instant_bound(np.stack([F, 2 * F]), D)
    for ask in ("prove", "worst_motion"):
        with pytest.raises(InputError, match="no instant 0; the problem has one instant, without"):
            getattr(single, ask)(0)
        with pytest.raises(InputError, match=r"no instant 2; the problem has \(2,\) instants"):
            getattr(motion, ask)(2)
    assert single.eased(0.999).prove().residual().lowest > 0.0
    assert motion.eased(0.999).prove(1).residual().lowest > 0.0
    np.testing.assert_array_equal(single.worst_motion(), motion.worst_motion(0))
