"""A multiplier W of one instant for a delay below the supremum, without a solver where that goes.

One level: W⁻¹ = J* Y⁻¹ J*ᵀ + εI from a multiplier Y in joint coordinates, with ε as large as the
room that Y leaves. It exists for any m, n and rank of J*: where J* loses rank, W grows as d nears
the supremum, which is then not attained. Several levels: the damping is divided among them,
D_θ = Σ D_i, so that (29) holds for level i with D_i; the sum of these is (31).
"""

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.passivity._measure import factorise, proven_delays
from sealag.passivity._problem import Problem
from sealag.passivity._radius import bracket
from sealag.passivity._solvers import Solver
from sealag.typing import Array

_LEAST = 1e-9
"""Share of the damping that even a level without stiffness gets. Ten times more costs delay that
the bounds claim; ten times less leaves its multiplier to rounding."""


def multiplier_for(problem: Problem, delay: float, *, solver: Solver) -> Array:
    """Compute W ≻ 0, (m, m), with which (29) or (31) holds at a delay below the bound.

    Args:
        problem: one instant.
        delay: d, s.
        solver: where multipliers of several levels come from that have no closed form.

    Raises:
        InputError: the delay is not a positive finite time.
        SolverError: the delay is not below the supremum, or too close to it, or the solver found
            nothing that proves it.
    """
    if not (np.isfinite(delay) and delay > 0.0):
        raise InputError(f"delay is {delay:g} s; a positive finite time is needed.")
    one, status = problem.motion(), "it is at the supremum"
    parts = _damping_parts(problem, delay)
    if parts is not None:
        W = _divided(problem, parts, delay)
    else:
        found = solver.solve(one)
        W, status = _eased(one, found.W, delay), f"{solver.name} says {found.status}"
    if W is None or proven_delays(one, factorise(one, W))[0] < delay:
        raise SolverError(f"No multiplier proves the delay {delay:.6g} s: {status}.")
    return W


def _damping_parts(problem: Problem, delay: float) -> list[Array] | None:
    """The damping of each level, D^-½ D_i D^-½ (n, n); None where only a solver finds it.

    One level has all. Symmetric levels need d A_i, for delays up to 1/w(Σ A_i); others at most
    d w(A_i) I, for delays up to 1/Σ w(A_i). What is left is shared equally.
    """
    n, count = problem.J.shape[-1], len(problem.blocks)
    if count == 1:
        return [np.eye(n)]
    A = [problem.scaled_stiffness(rows) for rows in problem.rows]
    if problem.semidefinite:
        needs = [delay * one for one in A]
    else:
        radii = [1.0 / float(bracket(one, np.zeros(()), tolerance=1e-9).delay) for one in A]
        needs = [delay * radius * np.eye(n) for radius in radii]
    rest = (np.eye(n) - sum(needs)) / count
    if not np.linalg.eigvalsh(rest)[0] > _LEAST:
        return None
    return [need + rest for need in needs]


def _divided(problem: Problem, parts: list[Array], delay: float) -> Array | None:
    """Each level's closed form with its part of the damping."""
    whole = np.zeros((len(problem.J), len(problem.J)))
    for rows, part in zip(problem.rows, parts, strict=True):
        root = np.linalg.inv(np.linalg.cholesky(part))
        W = _closed_form(problem.J[rows] @ root.T, root @ problem.M[:, rows], delay)
        if W is None:
            return None
        whole[rows, rows] = W
    return whole


def _eased(problem: Problem, W: Array | None, delay: float) -> Array | None:
    """A solver's multiplier of its own longest delay, for a shorter one with room for rounding."""
    longest = float(proven_delays(problem, factorise(problem, W))[0])
    return None if W is None or longest < delay else np.sqrt(delay / longest) * W


def _closed_form(J: Array, M: Array, delay: float) -> Array | None:
    """W of one level, (m, m), from J (m, n) and M (n, m); None where no room is left."""
    A = delay * (M @ J)
    Y = _middle(A)
    if not np.isfinite(Y).all():
        return None
    values, vectors = np.linalg.eigh(Y)
    if not values[0] > 0.0:
        return None
    half = (vectors / np.sqrt(values)).T
    room = 2.0 * np.eye(len(Y)) - Y - (A @ half.T) @ (A @ half.T).T
    lowest = float(np.linalg.eigvalsh(room)[0])
    if not lowest > 0.0:
        return None
    load = float(np.linalg.norm(delay * M)) ** 2
    epsilon = 0.25 * lowest / load if load > 0.0 else 1.0
    sides, sizes, _ = np.linalg.svd(J @ half.T, full_matrices=True)
    squares = np.zeros(len(J))
    squares[: len(sizes)] = sizes**2
    return (sides / (squares + epsilon)) @ sides.T


def _middle(A: Array) -> Array:
    """Y with [[2I − Y, A], [Aᵀ, Y]] ⪰ 0 and room for rounding, (n, n).

    Every Y lies between the maximal solution of Y + A Y⁻¹ Aᵀ = 2I and 2I less the maximal solution
    of V + Aᵀ V⁻¹ A = 2I, which exist if and only if w(A) ≤ 1; the mean is returned.
    """
    return (_maximal(A.T) + 2.0 * np.eye(len(A)) - _maximal(A)) / 2.0


def _maximal(A: Array) -> Array:
    """Maximal solution X of X + Aᵀ X⁻¹ A = 2I by cyclic reduction (Meini, Math. Comp. 2002), which
    converges quadratically; not finite or no solution where there is none."""
    X = rest = 2.0 * np.eye(len(A))
    for _ in range(60):
        try:
            left, right = np.linalg.solve(rest, A), np.linalg.solve(rest, A.T)
        except np.linalg.LinAlgError:
            break
        change = A.T @ left
        X, rest, A = X - change, rest - change - A @ right, A @ left
        if not np.isfinite(X).all() or np.linalg.norm(change) <= 1e-17 * np.linalg.norm(X):
            break
    return (X + X.T) / 2.0
