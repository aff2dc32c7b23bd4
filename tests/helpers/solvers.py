"""Solvers that stop, lie or forget."""

import numpy as np

from sealag.passivity import ClarabelDirect, Solution


class Lying:
    """Says `Solved` whatever it returns."""

    name = "a liar"

    def __init__(self, change):
        self.change = change

    def solve(self, problem):
        true = ClarabelDirect().solve(problem)
        W, P = self.change(true.W, true.P)
        return Solution(W=W, P=P, status="Solved")


LIES = {
    "too large": lambda W, P: (3.0 * W, P),
    "too small": lambda W, P: (0.1 * W, P),
    "not positive": lambda W, P: (-W, -P),
    "not a number": lambda W, P: (np.nan * W, np.nan * P),
    "nothing": lambda W, P: (None, None),
    "zero": lambda W, P: (0.0 * W, 0.0 * P),
    "wrong shape": lambda W, P: (W[:1], P[..., :1]),
    "noise": lambda W, P: (
        W + 0.3 * np.linalg.norm(W) * np.random.default_rng(0).normal(size=W.shape),
        P + 0.3 * np.linalg.norm(P) * np.random.default_rng(1).normal(size=P.shape),
    ),
    "infinite": lambda W, P: (np.inf * np.ones_like(W), P),
}


class Forgetful:
    """Answers so many times, then no more."""

    name = "a forgetful solver"

    def __init__(self, answers):
        self.answers = answers

    def solve(self, problem):
        self.answers -= 1
        if self.answers < 0:
            return Solution(W=None, P=None, status="forgot")
        return ClarabelDirect().solve(problem)
