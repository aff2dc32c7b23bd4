"""One multiplier for many instants: problem, candidate, and what a candidate really proves.

The inequality of Theorem 1 and Corollary 1, scaled by D_θ^-½ and with W = d·Q, is for instant t

    [[2I − J_tᵀ W J_t, d M_t], [⋆, W]] ⪰ 0,   W = diag(W_1 … W_k) ≻ 0.

Tasks stacked in J and M are the blocks of W (Corollary 1, (31)); many instants share one W (V_4
asks for a constant Q). With W = C Cᵀ it says ‖[J_tᵀC, d M_t C^-ᵀ]‖₂ ≤ √2, which is convex in
(J, M): what holds at points holds in their convex hull.

From the dual side, any P_t = L_t L_tᵀ ⪰ 0 bounds every delay: d ≤ Σ_t tr P_t / Σ_i ‖A_iᵀB_i‖_* with
A_i = [J_i,t L_t]_t, B_i = [M_i,tᵀ L_t]_t and the nuclear norm, because the minimum over W of
tr(W G) + d² tr(W⁻¹ H) is 2d tr (G^½ H G^½)^½.
"""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.passivity._scaling import EPS
from sealag.typing import Array

_BACK_OFF = (1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-4, 1e-2)


@dataclass(frozen=True, slots=True, kw_only=True)
class MultiplierProblem:
    """The largest delay with one block-diagonal multiplier for all instants.

    Attributes:
        J: (N, m, n) scaled Jacobians J* D^-½, tasks stacked.
        M: (N, n, m) scaled D^-½ J*ᵀ S, tasks side by side.
        blocks: rows of each task; they sum to m.
    """

    J: Array
    M: Array
    blocks: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse shapes that do not fit."""
        count, m, n = self.J.shape
        if self.M.shape != (count, n, m) or sum(self.blocks) != m or count == 0:
            raise InputError(
                f"J {self.J.shape}, M {self.M.shape} and blocks {self.blocks} do not fit together."
            )

    def at(self, instants: Array) -> "MultiplierProblem":
        """Return the same problem for some instants only.

        Args:
            instants: their indices.
        """
        return MultiplierProblem(J=self.J[instants], M=self.M[instants], blocks=self.blocks)

    def slices(self) -> list[slice]:
        """Return each task's rows."""
        ends = np.cumsum(self.blocks)
        return [slice(int(end - size), int(end)) for end, size in zip(ends, self.blocks)]


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """W = C Cᵀ with its inverse, task by task.

    Attributes:
        C: (m, m) factor.
        C_inverse: (m, m) its inverse, transposed: columns that M is multiplied by.
    """

    C: Array
    C_inverse: Array


def factorise(problem: MultiplierProblem, W: Array | None) -> Factor | None:
    """Factor a candidate's diagonal blocks; None if it is no multiplier.

    Args:
        problem: what it is a candidate for.
        W: (m, m); entries outside the blocks are ignored.
    """
    m = sum(problem.blocks)
    if W is None or W.shape != (m, m) or not np.isfinite(W).all():
        return None
    C, C_inverse = np.zeros((m, m)), np.zeros((m, m))
    for rows in problem.slices():
        values, vectors = np.linalg.eigh((W[rows, rows] + W[rows, rows].T) / 2.0)
        if not values[0] > EPS * values[-1]:
            return None
        C[rows, rows] = vectors * np.sqrt(values)
        C_inverse[rows, rows] = vectors / np.sqrt(values)
    return Factor(C=C, C_inverse=C_inverse)


def estimated_delays(problem: MultiplierProblem, factor: Factor) -> Array:
    """Largest d at each instant for a multiplier, (N,), to rounding but without its margin.

    Args:
        problem: the instants.
        factor: of the multiplier.
    """
    G = np.swapaxes(problem.J, 1, 2) @ factor.C
    H = problem.M @ factor.C_inverse
    n = problem.J.shape[2]
    rest = 2.0 * np.eye(n) - G @ np.swapaxes(G, 1, 2)
    values, vectors = np.linalg.eigh(rest)
    positive = values[:, 0] > 0.0
    scale = np.where(positive[:, None], np.abs(values), 1.0)
    part = np.swapaxes(vectors, 1, 2) @ H / np.sqrt(scale)[:, :, None]
    largest = np.linalg.norm(part, ord=2, axis=(1, 2))
    with np.errstate(divide="ignore"):
        return np.where(positive, 1.0 / largest, 0.0)


def proven_delays(problem: MultiplierProblem, factor: Factor | None) -> Array:
    """Delays that a multiplier proves at each instant, (N,), with a margin for rounding.

    2I − JᵀWJ − d² M W⁻¹ Mᵀ ⪰ 0, the Schur complement, is checked by its eigenvalues; the error of
    its evaluation, bounded by norms, is subtracted.

    Args:
        problem: the instants.
        factor: of the multiplier; None proves nothing.
    """
    count, m, n = problem.J.shape
    proven = np.zeros(count)
    if factor is None:
        return proven
    guess = estimated_delays(problem, factor)
    G = np.swapaxes(problem.J, 1, 2) @ factor.C
    H = problem.M @ factor.C_inverse
    norm_G, norm_H = _norm(G), _norm(H)
    error_G = 4.0 * m * EPS * _norm(problem.J) * _norm(factor.C)
    error_H = 8.0 * m * EPS * _norm(problem.M) * _norm(factor.C_inverse)
    GG, HH = G @ np.swapaxes(G, 1, 2), H @ np.swapaxes(H, 1, 2)
    open_ = guess > 0.0
    free = open_ & (norm_H == 0.0)
    proven[free] = np.inf
    open_ &= ~free
    for back_off in _BACK_OFF:
        at = np.flatnonzero(open_)
        if not len(at):
            break
        d = (1.0 - back_off) * guess[at]
        lowest = np.linalg.eigvalsh(2.0 * np.eye(n) - GG[at] - (d**2)[:, None, None] * HH[at])
        error = 4.0 * (m + n + 4) * EPS * (2.0 * n + norm_G[at] ** 2 + (d * norm_H[at]) ** 2)
        error += (2.0 * norm_G[at] + error_G[at]) * error_G[at]
        error += d**2 * (2.0 * norm_H[at] + error_H[at]) * error_H[at]
        good = lowest[:, 0] >= error
        proven[at[good]] = d[good]
        open_[at[good]] = False
    return proven


def refuted_delay(problem: MultiplierProblem, P: Array | None) -> float:
    """A delay that no multiplier can exceed, from dual multipliers; inf if they show nothing.

    Args:
        problem: the instants.
        P: (N, n, n) symmetric; negative parts are cut off.
    """
    count, m, n = problem.J.shape
    if P is None or P.shape != (count, n, n) or not np.isfinite(P).all():
        return np.inf
    values, vectors = np.linalg.eigh((P + np.swapaxes(P, 1, 2)) / 2.0)
    values = np.clip(values, 0.0, None)
    weight, largest = values.sum(axis=1), values.max()
    if not largest > 0.0:
        return np.inf
    kept = weight > 1e-14 * weight.sum()
    L = vectors[kept] * np.sqrt(values[kept])[:, None, :]
    J, M_t = problem.J[kept], np.swapaxes(problem.M[kept], 1, 2)
    columns = L.shape[0] * n
    total, size = 0.0, _norm(L)
    for rows in problem.slices():
        A = np.moveaxis(J[:, rows] @ L, 0, 1).reshape(-1, columns)
        B = np.moveaxis(M_t[:, rows] @ L, 0, 1).reshape(-1, columns)
        core = np.linalg.qr(A.T, mode="r") @ np.linalg.qr(B.T, mode="r").T
        norm_A = float(np.linalg.norm(_norm(J[:, rows]) * size))
        norm_B = float(np.linalg.norm(_norm(M_t[:, rows]) * size))
        error = 20.0 * m * (m + columns) * EPS * norm_A * norm_B
        total += max(float(np.linalg.svd(core, compute_uv=False).sum()) - error, 0.0)
    trace = float(np.sum(L**2)) * (1.0 + 10.0 * n * columns * EPS)
    return trace / total if total > 0.0 else np.inf


def lessened(delay: Array | float, error: Array | float) -> Array:
    """The delay whose inverse is larger by an error: 1/d is a norm of the stiffnesses.

    Args:
        delay: (…) s.
        error: (…) 1/s, bound of the error in the scaled stiffnesses.
    """
    with np.errstate(divide="ignore"):
        inverse = 1.0 / np.asarray(delay, dtype=float)
        return 1.0 / np.maximum(inverse + error, 0.0)


def _norm(array: Array) -> Array:
    return np.linalg.norm(array, axis=(-2, -1))
