"""Solvers agree, and one that starves or lies costs tightness, never truth."""

import numpy as np
import pytest

from helpers.solvers import LIES, Lying
from sealag.errors import InputError
from sealag.passivity import (
    ClarabelCvxpy,
    ClarabelDirect,
    ClosedForm,
    MultiplierProblem,
    Solution,
    factorise,
    max_delay_common,
    max_delay_common_from_stiffness,
    max_delay_from_stiffness,
    max_delay_multitask,
    max_delay_polytope,
    max_delay_polytope_from_stiffness,
    proven_delays,
    refuted_delay,
)


def ends(problem, solution):
    proven = proven_delays(problem, factorise(problem, solution.W)).min()
    return proven, refuted_delay(problem, solution.P)


def one_instant(seed, m, n, rank):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    X = rng.normal(size=(m, m))
    S = X @ X.T + rng.normal(size=(m, m))
    return MultiplierProblem(J=J[None], M=(J.T @ S)[None], blocks=(m,))


SIZES = [(3, 3, 3), (6, 3, 3), (3, 6, 3), (1, 1, 1), (6, 6, 4), (6, 3, 2), (4, 4, 1)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("solver", [ClosedForm(), ClarabelDirect(), ClarabelCvxpy()])
def test_both_ends_meet_at_the_numerical_radius(size, solver):
    problem = one_instant(sum(size), *size)
    bound = max_delay_from_stiffness((problem.M @ problem.J)[0], np.ones(size[1]), tolerance=1e-10)
    proven, refuted = ends(problem, solver.solve(problem))
    assert proven <= bound.upper
    assert refuted >= bound.delay
    assert refuted / proven - 1.0 <= 1e-6


def three_crooked_tasks(seed):
    """Corollary 1 where neither 1/Σw nor 1/w(Σ) is the supremum."""
    rng = np.random.default_rng(seed)
    parts = rng.normal(size=(3, 3, 3))
    return MultiplierProblem(
        J=np.tile(np.eye(3), (3, 1))[None],
        M=np.concatenate(list(parts), axis=1)[None],
        blocks=(3, 3, 3),
    ), parts


@pytest.mark.parametrize("seed", range(3))
def test_open_corollary_is_closed_from_both_sides(seed):
    problem, parts = three_crooked_tasks(seed)
    proven, refuted = ends(problem, ClarabelDirect().solve(problem))
    other, _ = ends(problem, ClarabelCvxpy().solve(problem))
    assert refuted / proven - 1.0 <= 1e-8
    assert other == pytest.approx(proven, rel=1e-8)
    whole = max_delay_from_stiffness(parts.sum(axis=0), np.ones(3))
    assert refuted < 0.999 * whole.delay, "the upper end alone must fail here"


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_never_crosses_the_supremum(lie):
    for seed in range(3):
        for problem in (three_crooked_tasks(seed)[0], one_instant(seed, 6, 3, 3)):
            proven, refuted = ends(problem, ClarabelDirect().solve(problem))
            low, high = ends(problem, Lying(LIES[lie]).solve(problem))
            assert low <= refuted
            assert high >= proven


@pytest.mark.parametrize("iterations", [1, 2, 4, 6, 9])
def test_a_starved_solver_never_crosses_the_supremum(iterations):
    problem, _ = three_crooked_tasks(1)
    proven, refuted = ends(problem, ClarabelDirect().solve(problem))
    for starved in (
        ClarabelDirect(max_iterations=iterations),
        ClarabelCvxpy(max_iterations=iterations),
    ):
        low, high = ends(problem, starved.solve(problem))
        assert low <= refuted
        assert high >= proven


def test_a_believed_liar_would_have_been_wrong():
    problem = one_instant(0, 3, 3, 3)
    proven, refuted = ends(problem, ClarabelDirect().solve(problem))
    A = (problem.M @ problem.J)[0]
    claimed = 1.2 * proven
    W = claimed * (A + A.T) / 2.0
    assert claimed > refuted
    assert ends(problem, Solution(W=W, P=None, status="Solved"))[0] <= refuted


def crooked_tasks():
    rng = np.random.default_rng(4)
    tasks = []
    for _ in range(2):
        X = rng.normal(size=(2, 2))
        Lambda = X @ X.T + 0.05 * np.eye(2)
        tasks.append((rng.normal(size=(2, 3)), Lambda, 10.0 ** rng.uniform(0, 4, 2)))
    return tasks, rng.uniform(5, 50, 3)


def test_multitask_says_why_it_stays_open():
    tasks, D = crooked_tasks()
    good = max_delay_multitask(tasks, D, form="published")
    assert good.closed
    assert good.reason == ""
    for solver in (Lying(LIES["nothing"]), ClarabelDirect(max_iterations=1)):
        bad = max_delay_multitask(tasks, D, form="published", solver=solver)
        assert not bad.closed
        assert solver.name in bad.reason
        assert bad.delay <= good.upper
        assert bad.upper >= good.delay


def motion(seed, count, m, n):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, count)[:, None, None]
    J0, J1, J2 = rng.normal(size=(3, m, n))
    X0, X1 = rng.normal(size=(2, m, m))
    J = J0 + 0.6 * np.sin(6 * t) * J1 + 0.4 * np.cos(17 * t) * J2
    X = X0 + 0.5 * np.sin(9 * t) * X1
    Lambda = X @ np.swapaxes(X, 1, 2) + 0.2 * np.eye(m)
    return (J, Lambda, rng.uniform(10, 100, m)), rng.uniform(5, 50, n)


BINDING_SEED = 11
"""A motion on which one multiplier costs delay: several instants bind at once."""


@pytest.mark.parametrize("count", [200, 1000])
def test_common_multiplier_agrees_with_one_big_sdp(count):
    (J, Lambda, K_x), D = motion(BINDING_SEED, count, 3, 3)
    found = max_delay_common([(J, Lambda, K_x)], D, tolerance=1e-7)
    root = np.sqrt(1.0 / D)
    w, V = np.linalg.eigh(Lambda)
    half = (V * np.sqrt(w)[:, None, :]) @ np.swapaxes(V, 1, 2)
    scaled = J * root
    M = np.swapaxes(scaled, 1, 2) @ (half @ np.diag(K_x) @ half)
    everything = MultiplierProblem(J=scaled, M=M, blocks=(3,))
    proven, refuted = ends(everything, ClarabelDirect().solve(everything))
    assert found.closed
    assert found.delay == pytest.approx(proven, rel=1e-6)
    assert found.delay <= refuted
    assert found.upper >= proven
    assert found.delay < 0.99 * found.pointwise.min(), "one multiplier must cost something here"
    assert len(found.binding) < count


def test_common_multiplier_proves_every_instant_and_no_longer_delay():
    (J, Lambda, K_x), D = motion(BINDING_SEED, 100, 3, 3)
    found = max_delay_common([(J, Lambda, K_x)], D)
    w, V = np.linalg.eigh(Lambda)
    half = (V * np.sqrt(w)[:, None, :]) @ np.swapaxes(V, 1, 2)
    M = np.swapaxes(J, 1, 2) @ (half @ np.diag(K_x) @ half)

    def lowest(d):
        corner = 2 * np.diag(D) - np.swapaxes(J, 1, 2) @ found.W @ J
        W = np.broadcast_to(found.W, (len(J), 3, 3))
        rows = [np.concatenate([corner, d * M], axis=2)]
        rows.append(np.concatenate([d * np.swapaxes(M, 1, 2), W], axis=2))
        return np.linalg.eigvalsh(np.concatenate(rows, axis=1))[:, 0].min()

    assert lowest(found.delay) >= -1e-10
    assert lowest(1.001 * found.delay) < -1e-6
    np.testing.assert_allclose(found.Q, found.W / found.delay)


def test_common_multiplier_of_several_tasks_and_of_joint_stiffness():
    one, D = motion(1, 60, 2, 3)
    two, _ = motion(2, 60, 3, 3)
    both = max_delay_common([one, two], D, form="published")
    assert both.closed
    assert both.W.shape == (5, 5)
    np.testing.assert_array_equal(both.W[:2, 2:], 0.0)
    F = np.swapaxes(one[0], 1, 2) @ one[0] * 50.0
    joint = max_delay_common_from_stiffness(F, D)
    assert joint.closed
    assert joint.delay <= joint.pointwise.min() * (1 + 1e-12)
    single = max_delay_common_from_stiffness(F[0], D)
    exact = max_delay_from_stiffness(F[0], D)
    assert single.delay <= exact.upper
    assert single.upper >= exact.delay
    assert single.delay == pytest.approx(float(exact.delay), rel=1e-6)


@pytest.mark.parametrize("solver", [Lying(LIES["too large"]), ClarabelDirect(max_iterations=3)])
def test_common_multiplier_from_a_bad_solver_is_never_too_long(solver):
    task, D = motion(BINDING_SEED, 50, 3, 3)
    good, bad = max_delay_common([task], D), max_delay_common([task], D, solver=solver)
    assert bad.delay <= good.upper
    assert bad.upper >= good.delay
    assert not bad.closed
    assert solver.name in bad.reason


def test_common_multiplier_of_no_stiffness_and_of_misfits():
    (J, Lambda, K_x), D = motion(0, 5, 3, 3)
    assert max_delay_common([(J, Lambda, 0 * K_x)], D).delay == np.inf
    assert max_delay_polytope([(J, Lambda, 0 * K_x)], D).delay == np.inf
    with pytest.raises(InputError, match="At least one task"):
        max_delay_common([], D)
    with pytest.raises(InputError, match="do not fit"):
        max_delay_common([(J, Lambda, K_x), (J[:2], Lambda[:2], K_x)], D)
    with pytest.raises(InputError, match="one axis of instants"):
        max_delay_common([(J[None], Lambda, K_x)], D)
    with pytest.raises(InputError, match="tolerance"):
        max_delay_common([(J, Lambda, K_x)], D, tolerance=1.0)


def test_polytope_contains_the_motion_and_all_mixtures_of_a_window():
    task, D = motion(3, 401, 3, 3)
    found = max_delay_polytope([task], D, window=20)
    common = max_delay_common([task], D)
    assert 0.9 * common.delay <= found.delay <= common.upper
    assert (found.box + found.ball <= np.sqrt(2.0)).all()
    J, Lambda, K_x = task
    w, V = np.linalg.eigh(Lambda)
    half = (V * np.sqrt(w)[:, None, :]) @ np.swapaxes(V, 1, 2)
    M = np.swapaxes(J, 1, 2) @ (half @ np.diag(K_x) @ half)
    rng, R = np.random.default_rng(0), np.diag(1 / np.sqrt(D))
    mixed_J, mixed_M = [], []
    for first, last in found.windows:
        weights = rng.dirichlet(np.ones(last - first + 1), size=10)
        mixed_J.append(np.tensordot(weights, J[first : last + 1], axes=1) @ R)
        mixed_M.append(R @ np.tensordot(weights, M[first : last + 1], axes=1))
    mixtures = MultiplierProblem(J=np.concatenate(mixed_J), M=np.concatenate(mixed_M), blocks=(3,))
    assert (proven_delays(mixtures, factorise(mixtures, found.W)) >= found.delay).all()
    outside = MultiplierProblem(J=1.2 * mixtures.J, M=1.2 * mixtures.M, blocks=(3,))
    assert proven_delays(outside, factorise(outside, found.W)).min() < found.delay


def test_polytope_covers_what_a_coarse_motion_leaves_out():
    """Instants of a fine motion that a coarse one skips stay inside, if `between` is asked."""
    (J, Lambda, _), D = motion(3, 801, 3, 3)
    F = np.swapaxes(J, 1, 2) @ Lambda @ J * 20.0
    coarse = max_delay_polytope_from_stiffness(F[::8], D, window=1, directions=1)
    R = np.diag(1 / np.sqrt(D))
    fine = MultiplierProblem(J=np.tile(R, (801, 1, 1)), M=R @ F, blocks=(3,))
    assert proven_delays(fine, factorise(fine, coarse.W)).min() >= coarse.delay
    blind = max_delay_polytope_from_stiffness(F[::8], D, window=1, directions=1, between=False)
    assert blind.delay > coarse.delay
    assert (blind.ball <= coarse.ball).all()


def test_polytope_windows_stop_at_breaks_and_bad_choices_are_refused():
    task, D = motion(3, 101, 3, 3)
    found = max_delay_polytope([task], D, window=30, breaks=[50])
    assert found.windows == ((0, 30), (30, 49), (50, 80), (80, 100))
    assert found.vertices == 16
    hopeless = max_delay_polytope([task], D, window=100, directions=0)
    assert hopeless.delay < found.delay
    assert hopeless.delay > 0.0 or "shorter windows" in hopeless.reason
    for wrong in ({"window": 0}, {"directions": 9}, {"breaks": [0]}, {"breaks": [101]}):
        with pytest.raises(InputError):
            max_delay_polytope([task], D, **wrong)
