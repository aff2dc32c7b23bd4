"""What a multiplier really proves, and what dual multipliers really refute.

With W = C Cᵀ the inequality says ‖[J_tᵀ C, d M_t C^-ᵀ]‖₂ ≤ √2, which is convex in (J, M): what
holds at points holds in their convex hull. From the dual side, any P_t = L_t L_tᵀ ⪰ 0 bounds every
delay: d ≤ Σ_t tr P_t / Σ_i ‖A_i B_iᵀ‖_* with A_i = [J_i,t L_t]_t, B_i = [M_i,tᵀ L_t]_t and the
nuclear norm, because the minimum over W of tr(W G) + d² tr(W⁻¹ H) is 2d tr (G^½ H G^½)^½.
"""

from dataclasses import dataclass

import numpy as np

from sealag.passivity._problem import EPS, Problem, norm, symmetric, transposed
from sealag.typing import Array

_BACK_OFF = (1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-4, 1e-2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """W = C Cᵀ with its inverse, level by level.

    Attributes:
        C: (m, m) factor.
        C_inverse: (m, m) its inverse, transposed: columns that M is multiplied by.
    """

    C: Array
    C_inverse: Array

    @property
    def W(self) -> Array:
        """The multiplier, (m, m)."""
        return self.C @ self.C.T


def factorise(problem: Problem, W: Array | None) -> Factor | None:
    """Factor a candidate's diagonal blocks; None if it is no multiplier.

    Args:
        problem: what it is a candidate for.
        W: (m, m); entries outside the blocks are ignored.
    """
    m = sum(problem.blocks)
    if W is None or W.shape != (m, m) or not np.isfinite(W).all():
        return None
    C, C_inverse = np.zeros((m, m)), np.zeros((m, m))
    for rows in problem.rows:
        values, vectors = np.linalg.eigh(symmetric(W[rows, rows]))
        if not values[0] > EPS * values[-1]:
            return None
        C[rows, rows] = vectors * np.sqrt(values)
        C_inverse[rows, rows] = vectors / np.sqrt(values)
    return Factor(C=C, C_inverse=C_inverse)


def estimated_delays(problem: Problem, factor: Factor) -> Array:
    """Largest d at each instant for a multiplier, (N,), to rounding but without its margin.

    Args:
        problem: the instants.
        factor: of the multiplier.
    """
    G = transposed(problem.J) @ factor.C
    H = problem.M @ factor.C_inverse
    values, vectors = np.linalg.eigh(2.0 * np.eye(G.shape[1]) - G @ transposed(G))
    positive = values[:, 0] > 0.0
    scale = np.where(positive[:, None], np.abs(values), 1.0)
    part = transposed(vectors) @ H / np.sqrt(scale)[:, :, None]
    largest = np.linalg.norm(part, ord=2, axis=(1, 2))
    with np.errstate(divide="ignore"):
        return np.where(positive, 1.0 / largest, 0.0)


class Complement:
    """2I − JᵀWJ − d² M W⁻¹ Mᵀ at every instant, the Schur complement of the inequality."""

    def __init__(self, problem: Problem, factor: Factor) -> None:
        """Multiply out what does not depend on d.

        Args:
            problem: the instants.
            factor: of the multiplier.
        """
        _, m, n = problem.J.shape
        G, H = transposed(problem.J) @ factor.C, problem.M @ factor.C_inverse
        self._GG, self._HH = G @ transposed(G), H @ transposed(H)
        self._norm_G, self._norm_H, self._sizes = norm(G), norm(H), m + n
        self._error_G = 4.0 * m * EPS * norm(problem.J) * norm(factor.C)
        self._error_H = 8.0 * m * EPS * norm(problem.M) * norm(factor.C_inverse)

    @property
    def unloaded(self) -> Array:
        """Instants without stiffness, (N,)."""
        return self._norm_H == 0.0

    def lowest(self, delay: Array, at: Array | slice = slice(None)) -> tuple[Array, Array]:
        """Return the lowest eigenvalue at each instant, and a bound of its rounding error, (N,).

        Args:
            delay: d at each, s.
            at: the instants that are asked for.
        """
        n = self._GG.shape[1]
        complement = 2.0 * np.eye(n) - self._GG[at] - (delay**2)[:, None, None] * self._HH[at]
        norm_G, norm_H, error_G, error_H = (
            part[at] for part in (self._norm_G, self._norm_H, self._error_G, self._error_H)
        )
        error = 4.0 * (self._sizes + 4) * EPS * (2.0 * n + norm_G**2 + (delay * norm_H) ** 2)
        error += (2.0 * norm_G + error_G) * error_G
        error += delay**2 * (2.0 * norm_H + error_H) * error_H
        return np.linalg.eigvalsh(complement)[:, 0], error


def proven_delays(problem: Problem, factor: Factor | None) -> Array:
    """Delays that a multiplier proves at each instant, (N,), with a margin for rounding.

    Args:
        problem: the instants.
        factor: of the multiplier; None proves nothing.
    """
    proven = np.zeros(len(problem.J))
    if factor is None:
        return proven
    guess = estimated_delays(problem, factor)
    complement = Complement(problem, factor)
    open_ = guess > 0.0
    free = open_ & complement.unloaded
    proven[free] = np.inf
    open_ &= ~free
    for back_off in _BACK_OFF:
        at = np.flatnonzero(open_)
        if not len(at):
            break
        d = (1.0 - back_off) * guess[at]
        lowest, error = complement.lowest(d, at)
        good = lowest >= error
        proven[at[good]] = d[good]
        open_[at[good]] = False
    return proven


def refuted_delay(problem: Problem, P: Array | None) -> float:
    """A delay that no multiplier can exceed, from dual multipliers; inf if they show nothing.

    Args:
        problem: the instants.
        P: (N, n, n) symmetric; negative parts are cut off.
    """
    count, m, n = problem.J.shape
    if P is None or P.shape != (count, n, n) or not np.isfinite(P).all():
        return np.inf
    values, vectors = np.linalg.eigh(symmetric(P))
    values = np.clip(values, 0.0, None)
    weight, largest = values.sum(axis=1), values.max()
    if not largest > 0.0:
        return np.inf
    kept = weight > 1e-14 * weight.sum()
    L = vectors[kept] * np.sqrt(values[kept])[:, None, :]
    J, M_t = problem.J[kept], transposed(problem.M[kept])
    columns = L.shape[0] * n
    total, size = 0.0, norm(L)
    for rows in problem.rows:
        A = np.moveaxis(J[:, rows] @ L, 0, 1).reshape(-1, columns)
        B = np.moveaxis(M_t[:, rows] @ L, 0, 1).reshape(-1, columns)
        core = np.linalg.qr(A.T, mode="r") @ np.linalg.qr(B.T, mode="r").T
        norm_A = float(np.linalg.norm(norm(J[:, rows]) * size))
        norm_B = float(np.linalg.norm(norm(M_t[:, rows]) * size))
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
