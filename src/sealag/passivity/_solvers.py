"""Solvers behind one interface: Clarabel directly, and Clarabel through CVXPY.

A solver turns a `Problem` into a `Solution`, a mere candidate, which `solve` measures. One that
stops early or lies costs tightness, never truth.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sealag.passivity._problem import Problem, transposed
from sealag.typing import Array

_RANK = 1e-10
"""Relative size of a direction of J from which W acts on it. Ten times less leaves the SDP to
rounding; ten times more gives up delay where a Jacobian is nearly singular."""

_FREE = 1e-10
"""Share of the delay that a finite W costs on directions that no J reaches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """What a solver says; nothing in it is believed before it is measured.

    Attributes:
        W: (m, m) multiplier, or None.
        P: (N, n, n) dual multipliers, or None.
        status: the solver's own words.
    """

    W: Array | None
    P: Array | None
    status: str


class Solver(Protocol):
    """Anything that proposes multipliers for a problem."""

    @property
    def name(self) -> str:
        """What the solver is called in results."""
        ...

    def solve(self, problem: Problem) -> Solution:
        """Propose multipliers.

        Args:
            problem: what they are wanted for.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class ClarabelDirect:
    """One SDP by Clarabel's own interface.

    Attributes:
        max_iterations: of its interior-point method.
        tolerance: of gap and feasibility.
    """

    max_iterations: int = 200
    tolerance: float = 1e-10

    @property
    def name(self) -> str:
        """What the solver is called in results."""
        return "Clarabel"

    def solve(self, problem: Problem) -> Solution:
        """Propose multipliers.

        Args:
            problem: what they are wanted for.
        """
        import clarabel
        from scipy import sparse

        balance = _balanced(problem)
        constant, parts = _affine(balance.problem)
        count, size = len(problem.J), constant.shape[-1]
        A = -_svec(parts).transpose(1, 2, 0).reshape(-1, len(parts))
        b = np.tile(_svec(constant), count)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_iter = self.max_iterations
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = self.tolerance
        cost = np.zeros(len(parts))
        cost[0] = -1.0
        cones = [clarabel.PSDTriangleConeT(size)] * count
        nothing = sparse.csc_matrix((len(parts), len(parts)))
        answer = clarabel.DefaultSolver(
            nothing, cost, sparse.csc_matrix(A), b, cones, settings
        ).solve()
        x = np.asarray(answer.x)
        Z = _smat(np.asarray(answer.z).reshape(count, -1), size)
        n = problem.J.shape[2]
        return Solution(
            W=balance.back(_multiplier(x[1:], balance.problem.blocks)),
            P=Z[:, :n, :n],
            status=f"{answer.status} after {answer.iterations} iterations",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClarabelCvxpy:
    """The same SDP written in CVXPY, for those who want to read it.

    Attributes:
        max_iterations: of Clarabel's interior-point method.
        tolerance: of gap and feasibility.
    """

    max_iterations: int = 200
    tolerance: float = 1e-10

    @property
    def name(self) -> str:
        """What the solver is called in results."""
        return "CVXPY + Clarabel"

    def solve(self, problem: Problem) -> Solution:
        """Propose multipliers.

        Args:
            problem: what they are wanted for.
        """
        import cvxpy as cp

        balance = _balanced(problem)
        inner, n = balance.problem, problem.J.shape[2]
        m = sum(inner.blocks)
        d, W = cp.Variable(), cp.Variable((m, m), symmetric=True)
        inside = np.zeros((m, m), dtype=bool)
        for rows in inner.rows:
            inside[rows, rows] = True
        matrices = []
        for J, M in zip(inner.J, inner.M):
            block = cp.bmat([[2.0 * np.eye(n) - J.T @ W @ J, d * M], [d * M.T, W]])
            matrices.append((block + block.T) / 2.0 >> 0)
        zero = [] if inside.all() else [cp.multiply(~inside, W) == 0]
        task = cp.Problem(cp.Maximize(d), matrices + zero)
        tolerance = {f"tol_{kind}": self.tolerance for kind in ("gap_abs", "gap_rel", "feas")}
        try:
            task.solve(solver=cp.CLARABEL, max_iter=self.max_iterations, **tolerance)
        except cp.SolverError as error:
            return Solution(W=None, P=None, status=f"failed: {error}")
        if W.value is None:
            return Solution(W=None, P=None, status=str(task.status))
        P = np.array([matrix.dual_value[:n, :n] for matrix in matrices])
        return Solution(W=balance.back(W.value), P=P, status=str(task.status))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Balance:
    """A problem whose numbers are near 1, and the way back for its multiplier."""

    problem: Problem
    reach: Array
    rest: Array

    def back(self, W: Array) -> Array:
        """Undo: W on what the Jacobians reach, a large weight on what they never do."""
        return self.reach @ W @ self.reach.T + self.rest


def _balanced(problem: Problem) -> _Balance:
    """Scale rows of J against columns of M, and take out task directions that no J reaches.

    There W should be infinite; a finite weight that costs 1e-10 of the delay takes its place.
    """
    A = problem.M @ problem.J
    stiffest = float(np.linalg.norm(A, axis=(1, 2)).max())
    guess = 1.0 / stiffest if stiffest > 0.0 else 1.0
    m = problem.J.shape[1]
    size_J = np.linalg.norm(problem.J, axis=(0, 2))
    size_M = guess * np.linalg.norm(problem.M, axis=(0, 1))
    both = (size_J > 0.0) & (size_M > 0.0)
    scale = np.where(both, np.sqrt(np.where(both, size_J, 1.0) / np.where(both, size_M, 1.0)), 1.0)
    J, M = problem.J / scale[:, None], guess * problem.M * scale
    reach, blocks, rest = [], [], np.zeros((m, m))
    for rows in problem.rows:
        stacked = np.moveaxis(J[:, rows], 1, 0).reshape(rows.stop - rows.start, -1)
        U, values, _ = np.linalg.svd(stacked, full_matrices=True)
        rank = max(int((values > _RANK * values[0]).sum()), 1)
        kept, lost = (np.zeros((m, part.shape[1])) for part in (U[:, :rank], U[:, rank:]))
        kept[rows], lost[rows] = U[:, :rank], U[:, rank:]
        reach.append(kept)
        blocks.append(rank)
        load = float(np.linalg.norm(M @ lost, axis=(1, 2)).max())
        rest += lost @ lost.T * max(load**2 / _FREE, 1.0)
    basis = np.hstack(reach)
    inner = Problem(J=basis.T @ J, M=M @ basis, blocks=tuple(blocks))
    back = 1.0 / scale[:, None]
    return _Balance(problem=inner, reach=back * basis, rest=back * rest * back.T)


def _affine(problem: Problem) -> tuple[Array, Array]:
    """The block matrix as constant + Σ x_k parts[k], x = (d, entries of W); parts (K, N, s, s)."""
    count, m, n = problem.J.shape
    constant = np.zeros((n + m, n + m))
    constant[:n, :n] = 2.0 * np.eye(n)
    first = np.zeros((count, n + m, n + m))
    first[:, :n, n:] = problem.M
    first[:, n:, :n] = transposed(problem.M)
    parts = [first]
    for i, j in _entries(problem.blocks):
        part = np.zeros((count, n + m, n + m))
        corner = problem.J[:, i, :, None] * problem.J[:, j, None, :]
        if i != j:
            corner = corner + transposed(corner)
        part[:, :n, :n] = -corner
        part[:, n + i, n + j] = part[:, n + j, n + i] = 1.0
        parts.append(part)
    return constant, np.array(parts)


def _entries(blocks: tuple[int, ...]) -> list[tuple[int, int]]:
    start, found = 0, []
    for size in blocks:
        found += [(start + i, start + j) for j in range(size) for i in range(j + 1)]
        start += size
    return found


def _multiplier(x: Array, blocks: tuple[int, ...]) -> Array:
    W = np.zeros((sum(blocks), sum(blocks)))
    for (i, j), value in zip(_entries(blocks), x, strict=True):
        W[i, j] = W[j, i] = value
    return W


def _svec(matrices: Array) -> Array:
    """Upper triangles column by column, off-diagonal entries times √2."""
    size = matrices.shape[-1]
    columns, rows = np.tril_indices(size)
    return matrices[..., rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0))


def _smat(vectors: Array, size: int) -> Array:
    columns, rows = np.tril_indices(size)
    scaled = vectors / np.where(rows == columns, 1.0, np.sqrt(2.0))
    matrices = np.zeros((*vectors.shape[:-1], size, size))
    matrices[..., rows, columns] = scaled
    matrices[..., columns, rows] = scaled
    return matrices
