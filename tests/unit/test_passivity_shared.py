"""Multipliers that instants share: which candidate is kept, and what each part of a radius is."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.certificates import made
from sealag.passivity import (
    ClarabelDirect,
    Instant,
    Motion,
    Problem,
    Solution,
    Windows,
    read_certificate,
    solve,
)

D = np.array([3.0, 0.7])


def turning(count=24, *, least=0.4):
    """A stiffness whose directions turn and whose sizes differ: (N, 2, 2) Nm/rad."""
    angle = np.linspace(0.0, 1.4, count)
    c, s = np.cos(angle), np.sin(angle)
    R = np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)
    sizes = np.zeros((count, 2, 2))
    sizes[:, 0, 0], sizes[:, 1, 1] = np.linspace(30.0, 90.0, count), least
    return R @ sizes @ np.swapaxes(R, 1, 2)


class Primal:
    """Proposes multipliers, the given ones first, and refutes nothing."""

    name = "a primal solver"

    def __init__(self, *first):
        self.left = list(first)

    def solve(self, problem):
        W = self.left.pop(0) if self.left else ClarabelDirect().solve(problem).W
        return Solution(W=W, P=None, status="no dual")


def test_without_duals_the_instants_themselves_bound_a_motion_from_above():
    problem = Problem.of_stiffness(turning(), D)
    each = solve(problem, share=Instant())
    found = solve(problem, share=Motion(), solver=Primal())
    assert found.upper == pytest.approx(each.upper.min(), rel=1e-9)
    assert found.delay <= found.upper


def test_a_worse_candidate_does_not_replace_a_better_one():
    mixed = np.random.default_rng(0).permutation(60)
    problem = Problem.of_stiffness(turning(60)[mixed], D)
    each = solve(problem, share=Instant()).delay
    better, worse = (
        solve(problem.at(np.array([k])), share=Motion()).multiplier
        for k in (each.argmin(), each.argmax())
    )
    alone = [
        float(solve(problem, share=Motion(), solver=Primal(*[W] * 80)).delay)
        for W in (better, worse)
    ]
    assert alone[1] < 0.5 * alone[0]
    both = Primal(better, *[worse] * 80)
    assert solve(problem, share=Motion(), solver=both).delay == pytest.approx(alone[0], rel=1e-9)
    assert len(both.left) < 80, "the worse one was tried"


def test_the_error_of_the_matrices_is_paid_for():
    """1/d is a norm of the stiffness, so that an error e of M costs ‖J‖ e of it."""
    problem = Problem.of_stiffness(turning(), D)
    error = np.linspace(0.0, 0.3, len(problem.J))[:, None]
    exact, rough = (
        solve(replace(problem, M_error=M_error), share=Motion()) for M_error in (0.0 * error, error)
    )
    largest = max(np.linalg.norm(J) for J in problem.J) * 0.3
    assert 1.0 / rough.delay - 1.0 / exact.delay == pytest.approx(largest, rel=1e-6)
    assert rough.delay < exact.delay


def _norm(M, W):
    """‖M C^-ᵀ‖₂ with W = C Cᵀ."""
    return float(np.sqrt(np.linalg.eigvalsh(M @ np.linalg.inv(W) @ M.T)[-1]))


@pytest.mark.parametrize("directions", [0, 1])
def test_the_ball_is_what_the_box_leaves_and_what_lies_between_instants(directions):
    """F(t) = F_0 + t² F_1 at whole t: a line, which one direction boxes; between two instants it
    leaves its chord by F''/8 = F_1/4 at most."""
    F_0, F_1 = np.diag([40.0, 9.0]), np.array([[0.9, 0.4], [0.4, -0.2]])
    t = np.arange(6.0)
    problem = Problem.of_stiffness(F_0 + t[:, None, None] ** 2 * F_1, D)
    found = solve(problem, share=Windows(width=5, directions=directions))
    (window,) = found.windows
    W, R = found.multiplier, np.diag(1.0 / np.sqrt(D))
    between = found.delay * _norm(R @ F_1 / 4.0, W)
    left = (
        0.0
        if directions
        else found.delay * max(_norm(M - problem.M.mean(axis=0), W) for M in problem.M)
    )
    assert window.radius == pytest.approx(left + between, rel=1e-6)
    assert window.corner + window.radius == pytest.approx(np.sqrt(2.0), rel=1e-6)


def test_a_law_that_answers_to_more_than_the_motors_is_coupled():
    certificate = read_certificate(made("baxter"))
    question, loop = certificate.question, certificate.evidence.local_loop
    assert not loop.coupled(question)
    aside = next(k for k, name in enumerate(loop.states) if name.startswith("z"))
    for share, coupled in ((1e-12, False), (1e-2, True)):
        A_1 = loop.A_1.copy()
        A_1[0, aside] = share * np.abs(A_1).max()
        assert replace(loop, A_1=A_1).coupled(question) is coupled
        assert not replace(loop, A_1=A_1).coupled(replace(question, feedback="joint"))
