"""Solvers agree, and one that starves or lies costs tightness, never truth."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.levels import Saying, instant_bound, problem_of
from helpers.solvers import LIES, Lying
from sealag.errors import InputError
from sealag.passivity import (
    ClarabelCvxpy,
    ClarabelDirect,
    Instant,
    Motion,
    Problem,
    Windows,
    solve,
)


def ends(problem, solver):
    """What a solver's multipliers prove and refute."""
    bound = solve(problem, share=Motion(), solver=solver)
    return float(bound.delay), float(bound.upper)


def proves(problem, W, delay):
    """Whether a multiplier proves a delay at all instants of a problem."""
    return solve(problem, share=Motion(), solver=Saying(W=W)).delay >= delay


def one_instant(seed, m, n, rank):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    X = rng.normal(size=(m, m))
    S = X @ X.T + rng.normal(size=(m, m))
    return Problem(J=J[None], M=(J.T @ S)[None], blocks=(m,))


SIZES = [(3, 3, 3), (6, 3, 3), (3, 6, 3), (1, 1, 1), (6, 6, 4), (6, 3, 2), (4, 4, 1)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("solver", [ClarabelDirect(), ClarabelCvxpy()])
def test_both_ends_meet_at_the_numerical_radius(size, solver):
    problem = one_instant(sum(size), *size)
    bound = instant_bound((problem.M @ problem.J)[0], np.ones(size[1]), tolerance=1e-10)
    proven, refuted = ends(problem, solver)
    assert proven <= bound.upper
    assert refuted >= bound.delay
    assert refuted / proven - 1.0 <= 1e-6
    closed = solve(problem, share=Instant(tolerance=1e-10)).eased(1.0 - 5e-7).prove(0)
    assert proven <= closed.upper
    assert refuted >= closed.delay
    assert closed.residual().lowest >= closed.residual().rounding


def three_asymmetric_tasks(seed):
    """Corollary 1 where neither 1/Σw nor 1/w(Σ) is the supremum."""
    rng = np.random.default_rng(seed)
    parts = rng.normal(size=(3, 3, 3))
    return Problem(
        J=np.tile(np.eye(3), (3, 1))[None],
        M=np.concatenate(list(parts), axis=1)[None],
        blocks=(3, 3, 3),
    ), parts


@pytest.mark.parametrize("seed", range(3))
def test_open_corollary_is_closed_from_both_sides(seed):
    problem, parts = three_asymmetric_tasks(seed)
    proven, refuted = ends(problem, ClarabelDirect())
    other, _ = ends(problem, ClarabelCvxpy())
    assert refuted / proven - 1.0 <= 1e-8
    assert other == pytest.approx(proven, rel=1e-8)
    whole = instant_bound(parts.sum(axis=0), np.ones(3))
    assert refuted < 0.999 * whole.delay, "the upper end alone must fail here"


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_never_crosses_the_supremum(lie):
    for seed in range(3):
        for problem in (three_asymmetric_tasks(seed)[0], one_instant(seed, 6, 3, 3)):
            proven, refuted = ends(problem, ClarabelDirect())
            low, high = ends(problem, Lying(LIES[lie]))
            assert low <= refuted
            assert high >= proven


@pytest.mark.parametrize("iterations", [1, 2, 4, 6, 9])
def test_a_starved_solver_never_crosses_the_supremum(iterations):
    problem, _ = three_asymmetric_tasks(1)
    proven, refuted = ends(problem, ClarabelDirect())
    for starved in (
        ClarabelDirect(max_iterations=iterations),
        ClarabelCvxpy(max_iterations=iterations),
    ):
        low, high = ends(problem, starved)
        assert low <= refuted
        assert high >= proven


def test_a_believed_liar_would_have_been_wrong():
    problem = one_instant(0, 3, 3, 3)
    proven, refuted = ends(problem, ClarabelDirect())
    A = (problem.M @ problem.J)[0]
    claimed = 1.2 * proven
    W = claimed * (A + A.T) / 2.0
    assert claimed > refuted
    assert ends(problem, Saying(W=W))[0] <= refuted


def asymmetric_tasks():
    rng = np.random.default_rng(4)
    tasks = []
    for _ in range(2):
        X = rng.normal(size=(2, 2))
        Lambda = X @ X.T + 0.05 * np.eye(2)
        tasks.append((rng.normal(size=(2, 3)), Lambda, 10.0 ** rng.uniform(0, 4, 2)))
    return tasks, rng.uniform(5, 50, 3)


def test_multitask_says_why_it_stays_open():
    problem = problem_of(*asymmetric_tasks(), form="published")
    good = solve(problem, share=Instant())
    assert good.width <= 1e-6
    assert good.reason == ""
    for solver in (Lying(LIES["nothing"]), ClarabelDirect(max_iterations=1)):
        bad = solve(problem, share=Instant(), solver=solver)
        assert bad.width > 1e-6
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
    problem = Problem.of_tasks(J, Lambda, K_x, D)
    found = solve(problem, share=Motion(tolerance=1e-7))
    root = np.sqrt(1.0 / D)
    w, V = np.linalg.eigh(Lambda)
    half = (V * np.sqrt(w)[:, None, :]) @ np.swapaxes(V, 1, 2)
    scaled = J * root
    M = np.swapaxes(scaled, 1, 2) @ (half @ np.diag(K_x) @ half)
    everything = Problem(J=scaled, M=M, blocks=(3,))
    solution = ClarabelDirect().solve(everything)
    proven, refuted = ends(everything, Saying(W=solution.W, P=solution.P))
    assert found.reason == ""
    assert found.delay == pytest.approx(proven, rel=1e-6)
    assert found.delay <= refuted
    assert found.upper >= proven
    pointwise = solve(problem, share=Instant()).delay.min()
    assert found.delay < 0.99 * pointwise, "one multiplier must cost something here"
    assert len(found.binding) < count


def test_common_multiplier_proves_every_instant_and_no_longer_delay():
    (J, Lambda, K_x), D = motion(BINDING_SEED, 100, 3, 3)
    found = solve(Problem.of_tasks(J, Lambda, K_x, D), share=Motion())
    W = found.multiplier
    w, V = np.linalg.eigh(Lambda)
    half = (V * np.sqrt(w)[:, None, :]) @ np.swapaxes(V, 1, 2)
    M = np.swapaxes(J, 1, 2) @ (half @ np.diag(K_x) @ half)

    def lowest(d):
        corner = 2 * np.diag(D) - np.swapaxes(J, 1, 2) @ W @ J
        rows = [np.concatenate([corner, d * M], axis=2)]
        rows.append(
            np.concatenate([d * np.swapaxes(M, 1, 2), np.broadcast_to(W, (len(J), 3, 3))], axis=2)
        )
        return np.linalg.eigvalsh(np.concatenate(rows, axis=1))[:, 0].min()

    assert lowest(found.delay) >= -1e-10
    assert lowest(1.001 * found.delay) < -1e-6
    eased = found.eased(1.0 - 1e-7).residual()
    assert eased.lowest > eased.rounding
    longer = replace(found, delay=1.001 * found.delay).residual()
    assert longer.lowest < -longer.rounding


def test_common_multiplier_of_several_tasks_and_of_joint_stiffness():
    one, D = motion(1, 60, 2, 3)
    two, _ = motion(2, 60, 3, 3)
    both = solve(problem_of([one, two], D, form="published"), share=Motion())
    assert both.reason == ""
    assert both.multiplier.shape == (5, 5)
    np.testing.assert_array_equal(both.multiplier[:2, 2:], 0.0)
    F = np.swapaxes(one[0], 1, 2) @ one[0] * 50.0
    joint = solve(Problem.of_stiffness(F, D), share=Motion())
    assert joint.reason == ""
    assert joint.delay <= instant_bound(F, D).delay.min() * (1 + 1e-12)
    single = solve(Problem.of_stiffness(F[0], D), share=Motion())
    exact = instant_bound(F[0], D)
    assert single.delay <= exact.upper
    assert single.upper >= exact.delay
    assert single.delay == pytest.approx(float(exact.delay), rel=1e-6)


@pytest.mark.parametrize("solver", [Lying(LIES["too large"]), ClarabelDirect(max_iterations=3)])
def test_common_multiplier_from_a_bad_solver_is_never_too_long(solver):
    task, D = motion(BINDING_SEED, 50, 3, 3)
    problem = Problem.of_tasks(*task, D)
    good, bad = solve(problem, share=Motion()), solve(problem, share=Motion(), solver=solver)
    assert bad.delay <= good.upper
    assert bad.upper >= good.delay
    assert solver.name in bad.reason


def test_common_multiplier_of_no_stiffness_and_of_misfits():
    (J, Lambda, K_x), D = motion(0, 5, 3, 3)
    nothing = Problem.of_tasks(J, Lambda, 0 * K_x, D)
    assert solve(nothing, share=Motion()).delay == np.inf
    assert solve(nothing, share=Windows()).delay == np.inf
    with pytest.raises(InputError, match="do not fit"):
        Problem.of_tasks(J, Lambda[:2], K_x, D)
    with pytest.raises(InputError, match="do not fit"):
        Problem(J=J, M=np.swapaxes(J, 1, 2)[:2], blocks=(3,))
    with pytest.raises(InputError, match="one axis of instants"):
        solve(Problem.of_tasks(J[None], Lambda, K_x, D), share=Motion())
    with pytest.raises(InputError, match="tolerance"):
        solve(Problem.of_tasks(J, Lambda, K_x, D), share=Motion(tolerance=1.0))


def test_polytope_contains_the_motion_and_all_mixtures_of_a_window():
    task, D = motion(3, 401, 3, 3)
    problem = Problem.of_tasks(*task, D)
    found = solve(problem, share=Windows(width=20))
    common = solve(problem, share=Motion())
    assert 0.9 * common.delay <= found.delay <= common.upper
    assert all(one.corner + one.radius <= np.sqrt(2.0) for one in found.windows)
    J, Lambda, K_x = task
    w, V = np.linalg.eigh(Lambda)
    half = (V * np.sqrt(w)[:, None, :]) @ np.swapaxes(V, 1, 2)
    M = np.swapaxes(J, 1, 2) @ (half @ np.diag(K_x) @ half)
    rng, R = np.random.default_rng(0), np.diag(1 / np.sqrt(D))
    mixed_J, mixed_M = [], []
    for one in found.windows:
        weights = rng.dirichlet(np.ones(one.last - one.first + 1), size=10)
        mixed_J.append(np.tensordot(weights, J[one.first : one.last + 1], axes=1) @ R)
        mixed_M.append(R @ np.tensordot(weights, M[one.first : one.last + 1], axes=1))
    mixtures = Problem(J=np.concatenate(mixed_J), M=np.concatenate(mixed_M), blocks=(3,))
    assert proves(mixtures, found.multiplier, found.delay)
    outside = Problem(J=1.2 * mixtures.J, M=1.2 * mixtures.M, blocks=(3,))
    assert not proves(outside, found.multiplier, found.delay)


def test_polytope_covers_what_a_coarse_motion_leaves_out():
    """Instants of a fine motion that a coarse one skips stay inside, if `between` is asked."""
    (J, Lambda, _), D = motion(3, 801, 3, 3)
    F = np.swapaxes(J, 1, 2) @ Lambda @ J * 20.0
    problem = Problem.of_stiffness(F[::8], D)
    coarse = solve(problem, share=Windows(width=1, directions=1))
    R = np.diag(1 / np.sqrt(D))
    fine = Problem(J=np.tile(R, (801, 1, 1)), M=R @ F, blocks=(3,))
    assert proves(fine, coarse.multiplier, coarse.delay)
    blind = solve(problem, share=Windows(width=1, directions=1, between=False))
    assert blind.delay > coarse.delay
    assert all(a.radius <= b.radius for a, b in zip(blind.windows, coarse.windows, strict=True))


def test_polytope_windows_stop_at_breaks_and_bad_choices_are_refused():
    task, D = motion(3, 101, 3, 3)
    problem = Problem.of_tasks(*task, D)
    found = solve(problem, share=Windows(width=30, breaks=[50]))
    edges = [(one.first, one.last) for one in found.windows]
    assert edges == [(0, 30), (30, 49), (50, 80), (80, 100)]
    assert all(len(one.J) == len(one.M) == 3 for one in found.windows)
    hopeless = solve(problem, share=Windows(width=100, directions=0))
    assert hopeless.delay < found.delay
    assert hopeless.delay > 0.0 or "shorter windows" in hopeless.reason
    for wrong in ({"width": 0}, {"directions": 9}, {"breaks": [0]}, {"breaks": [101]}):
        with pytest.raises(InputError):
            solve(problem, share=Windows(**wrong))
