"""One multiplier for a motion: whatever a solver says, both ends are measured and rounding counts.

With J = 1 an entry W of the multiplier allows d = √(W (2 − W)) / F, at most 1 / F.
"""

import numpy as np
import pytest

from helpers.levels import Saying
from sealag.errors import InputError
from sealag.passivity import Instant, Motion, Problem, Solution, solve


class InTurn:
    """Proposes one multiplier after the other, and then the last one."""

    name = "a solver that gets worse"

    def __init__(self, *multipliers):
        self.multipliers, self.asked = multipliers, 0

    def solve(self, problem):
        W = self.multipliers[min(self.asked, len(self.multipliers) - 1)]
        self.asked += 1
        return Solution(W=W, P=None, status="Solved")


def allowed(W, F):
    return np.sqrt(W * (2.0 - W)) / F


def test_no_motion_is_bounded_above_its_worst_instant():
    """A solver that says nothing leaves the ends at 0 and at 1/w of the worst instant."""
    F = np.array([[3.0, 1.0], [1.0, 2.0]]) * np.array([0.4, 1.7, 1.1])[:, None, None]
    D = np.array([0.5, 0.8])
    root = 1.0 / np.sqrt(D)
    largest = np.linalg.eigvalsh(root[:, None] * F[1] * root)[-1]
    bound = solve(Problem.of_stiffness(F, D), share=Motion(), solver=Saying())
    assert bound.delay == 0.0
    assert bound.upper == pytest.approx(1.0 / largest, rel=1e-6)
    assert bound.upper >= (1.0 - 1e-14) / largest
    assert "a parrot" in bound.reason


def test_the_best_multiplier_stays_when_later_ones_are_worse():
    """The second one lets one instant run longer, and all others less long."""
    first, second = allowed(0.4, 0.9), allowed(0.1, 1.0)
    F = np.tile(np.diag([1.0, 0.1]), (40, 1, 1))
    F[:, 0, 0] -= 1e-3 * np.arange(40)
    F[30, 1, 1] = 0.9  # alone it is no worse than its neighbours: the solver does not see it first
    F[35] *= 0.05
    solver = InTurn(np.diag([1.0, 0.4]), np.diag([0.1, 1.0]))
    bound = solve(Problem.of_stiffness(F, np.ones(2)), share=Motion(), solver=solver)
    assert solver.asked > 1
    assert allowed(0.1, 0.05) > first > 2.0 * second
    assert bound.delay == pytest.approx(first, rel=1e-9)
    np.testing.assert_allclose(bound.multiplier, np.diag([1.0, 0.4]), rtol=1e-14)


def test_rounding_of_the_matrices_is_inside_the_bracket():
    """M = 4 known to 0.5 may be 3.5 or 4.5: the bracket holds 1/3.5 and 1/4.5."""
    J, M = np.ones((3, 1, 1)), np.full((3, 1, 1), 4.0)
    exact = solve(Problem(J=J, M=M, blocks=(1,)), share=Motion())
    assert exact.delay == pytest.approx(1.0 / 4.0, rel=1e-6)
    blurred = Problem(J=J, M=M, blocks=(1,), M_error=np.array([0.5]))
    bound = solve(blurred, share=Motion())
    assert bound.delay == pytest.approx(1.0 / 4.5, rel=1e-6)
    assert bound.upper == pytest.approx(1.0 / 3.5, rel=1e-6)
    both = Problem(J=2.0 * J, M=M, blocks=(1,), M_error=np.array([0.5]))
    assert solve(both, share=Motion()).delay == pytest.approx(1.0 / 9.0, rel=1e-6)


def test_what_is_refuted_is_not_taken_for_proven():
    """Two levels, and a solver that says nothing: 1/Σw(A_i) is proven and 1/w(ΣA_i) is not."""
    J = np.tile(np.eye(2), (2, 1))
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    M = np.hstack([np.eye(2) + turn, np.eye(2) - turn])
    problem = Problem(J=J, M=M, blocks=(2, 2))
    with pytest.raises(InputError, match="A_error has shape"):
        Problem(J=J, M=M, blocks=(2, 2), A_error=np.zeros(3))
    whole, single = 2.0, np.sqrt(2.0)  # w(A_1 + A_2) = w(2 I), w(A_i) = |1 ± j|
    bound = solve(problem, share=Instant(), solver=Saying())
    assert bound.delay == pytest.approx(1.0 / (2.0 * single), rel=1e-6)
    assert bound.upper == pytest.approx(1.0 / whole, rel=1e-6)
    assert "a parrot" in bound.reason
