"""Tasks of several priority levels as one problem, and solvers that say what they are told."""

import numpy as np

from sealag.passivity import Instant, Problem, Solution, solve


def problem_of(tasks, D, *, form="symmetric"):
    """The problem of (J*_i, Λ_i, K_x,i), one level each, of a common batch."""
    edges = np.cumsum([0, *(len(K_x) for *_, K_x in tasks)])
    J_star = np.concatenate([J for J, _, _ in tasks], axis=-2)
    batch, m = J_star.shape[:-2], edges[-1]
    Lambda = np.zeros((*batch, m, m))
    for (_, inertia, _), first, after in zip(tasks, edges, edges[1:]):
        Lambda[..., first:after, first:after] = inertia
    K_x = np.concatenate([K_x for *_, K_x in tasks])
    return Problem.of_tasks(J_star, Lambda, K_x, D, levels=edges, form=form)


def instant_bound(F, D, *, tolerance=1e-6):
    """The bound of a delayed stiffness with a multiplier for each instant."""
    return solve(Problem.of_stiffness(F, D), share=Instant(tolerance=tolerance))


class Saying:
    """Proposes what it was given."""

    name = "a parrot"

    def __init__(self, W=None, P=None):
        self.W, self.P = W, P

    def solve(self, problem):
        return Solution(W=self.W, P=self.P, status="Solved")
