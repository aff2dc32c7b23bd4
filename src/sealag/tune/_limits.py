"""Convex limits of gains: Σ f_g F_g ≼ L at all instants, and D_θ ≽ d F (docs/theory section 16)."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from sealag.errors import SolverError
from sealag.typing import Array

_ROUNDS = 100
"""Rounds in which violated instants are added; examples need 2 to 6."""
_MET = 1e-7
"""Relative violation at which an instant counts as met; what is left is scaled away."""
_SLIVER = 1.0 - 1e-6
"""Share of the most damping from which on it is the answer itself."""
_NONE = 1e-12
"""Share of the largest stiffness below which a group moves nothing at an instant."""


class Series(Protocol):
    """A spring in series with the stiffness that a delay leaves, as signals state their limits."""

    @property
    def spring(self) -> Array:
        """(n,) compliance of the springs, rad/Nm."""
        ...

    @property
    def stiffness(self) -> Array:
        """(n,) stiffness of both in series, Nm/rad."""
        ...


class Wall(NamedTuple):
    """Where a direction of growing gains meets its limit.

    Attributes:
        scale: largest factor; inf if nothing stops it, 0 if there is none.
        instant: which instant stops it.
        shares: (n,) of each joint in the energy of the limiting deflection.
        spring: share of the springs in it; the delay has the rest.
    """

    scale: float
    instant: int
    shares: Array
    spring: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Σ_g f_g F_g ≼ (C_s + C_d)⁻¹ + F_held for all limits and instants.

    Attributes:
        parts: (G, N, n, n) stiffness of each group of gains at factor 1, symmetric, Nm/rad.
        held: (N, n, n) gradient of gravity compensation, Nm/rad.
        series: the limits.
    """

    parts: Array
    held: Array
    series: tuple[Series, ...]

    def wall(self, factors: Array) -> Wall:
        """Return how far gains can grow together, in closed form: 1 / λ_max(L^-½ F L^-½).

        Args:
            factors: (G,) of the groups, to be scaled in common.
        """
        F = np.tensordot(factors, self.parts, axes=1)
        best = Wall(np.inf, 0, np.zeros(F.shape[-1]), 0.0)
        for limit in self.series:
            root = self._inverse_root(limit)
            if root is None:
                return Wall(0.0, 0, np.zeros(F.shape[-1]), 0.0)
            values, vectors = np.linalg.eigh(np.swapaxes(root, -1, -2) @ F @ root)
            k = int(values[:, -1].argmax())
            top = float(values[k, -1])
            if top <= 0.0 or 1.0 / top >= best.scale:
                continue
            deflection = root[k] @ vectors[k, :, -1]
            energy = deflection**2 * limit.stiffness
            shares = energy / energy.sum()
            best = Wall(1.0 / top, k, shares, float(shares @ (limit.spring * limit.stiffness)))
        return best

    def balanced(self) -> Array:
        """Return the factors (G,) with the largest product: every group as stiff as is fair.

        max Σ log f_g is concave and does not depend on the units of the groups. Instants that are
        violated are added until none is.

        Raises:
            SolverError: the solver gives up.
        """
        A = self.whitened()
        if A is None:
            return np.zeros(len(self.parts))
        alone = np.linalg.eigvalsh(A)[..., -1]  # (G, J N)
        size = alone.max(axis=1)
        moving = size > _NONE * size.max()
        factors = np.ones(len(A))
        unit = A[moving] / size[moving, None, None, None]
        active = [int(np.linalg.eigvalsh(unit.sum(axis=0))[:, -1].argmax())]
        for _ in range(_ROUNDS):
            found = _fair(unit[:, active])
            top = np.linalg.eigvalsh(np.tensordot(found, unit, axes=1))[:, -1]
            worst = int(top.argmax())
            if top[worst] <= 1.0 + _MET or worst in active:
                factors[moving] = found / size[moving] / max(float(top[worst]), 1e-300)
                return factors
            active.append(worst)
        raise SolverError(f"no gains were found in {_ROUNDS} rounds; take fewer instants")

    def whitened(self) -> Array | None:
        """Return A (G, J N, n, n): every limit of every instant is Σ f_g A_g ≼ I; None where one is
        met by no gains."""
        roots = [self._inverse_root(limit) for limit in self.series]
        if any(root is None for root in roots):
            return None
        return np.concatenate(
            [np.swapaxes(R, -1, -2) @ self.parts @ R for R in roots if R is not None], axis=1
        )

    def _inverse_root(self, limit: Series) -> Array | None:
        """R (N, n, n) with Rᵀ L R = I; None where L is not positive definite."""
        L = np.diag(limit.stiffness) + self.held
        try:
            factor = np.linalg.cholesky(L)
        except np.linalg.LinAlgError:
            return None
        return np.swapaxes(np.linalg.inv(factor), -1, -2)


def _fair(unit: Array) -> Array:
    """argmax Σ log f_g with Σ f_g A_g ≼ I for A (G, k, n, n).

    As a geometric mean it has symmetric cones alone: solvers come closer to its flat optimum than
    with logarithms.
    """
    import cvxpy as cp

    f = cp.Variable(len(unit))
    eye = cp.Constant(np.eye(unit.shape[-1]))
    limits: list[Any] = [
        eye - sum(f[g] * unit[g, k] for g in range(len(unit))) >> 0 for k in range(unit.shape[1])
    ]
    problem = cp.Problem(cp.Maximize(cp.geo_mean(f)), limits)
    return _solved(problem, f)


def least_damping(
    F: Sequence[Array] | Array, cost: Array, floor: Array, most: Array | float = np.inf
) -> Array:
    """Return the diagonal D in floor … most with the least cost·D and D ≽ ± F_t at every instant.

    Args:
        F: (N, n, n) d F_θ, symmetric, Nms/rad.
        cost: (n,) positive weights.
        floor: (n,) smallest damping, Nms/rad.
        most: (n,) largest damping, Nms/rad, which is enough; inf for none.

    Returns:
        (n,) Nms/rad; feasible to rounding.

    Raises:
        SolverError: the solver gives up.
    """
    F = np.asarray(F)
    both = np.concatenate([F, -F]) if np.linalg.eigvalsh(F).min() < 0.0 else F
    # D = diag(r) Y diag(r) makes all rows alike.
    root = np.sqrt(np.maximum(np.abs(np.einsum("tii->ti", F)).max(axis=0), floor))
    root = np.where(root > 0.0, root, 1.0)
    scaled = both / np.multiply.outer(root, root)
    weight, least, highest = cost * root**2, floor / root**2, most / root**2
    # Where hardly anything else than the most will do, a solver finds nothing.
    with np.errstate(divide="ignore"):
        size = 1.0 / np.sqrt(highest)
    if np.linalg.eigvalsh(scaled * np.multiply.outer(size, size))[:, -1].max() > _SLIVER:
        return np.broadcast_to(most, root.shape).copy()
    active = [int(np.linalg.eigvalsh(scaled)[:, -1].argmax())]
    for _ in range(_ROUNDS):
        y = _cheapest(scaled[active], weight / weight.max(), least, highest)
        half = np.sqrt(y)
        top = np.linalg.eigvalsh(scaled / np.multiply.outer(half, half))[:, -1]
        worst = int(top.argmax())
        if top[worst] <= 1.0 + _MET or worst in active:
            return np.clip(y * max(float(top[worst]), 1.0) * root**2, floor, most)
        active.append(worst)
    raise SolverError(f"no damping was found in {_ROUNDS} rounds; take fewer instants")


def _cheapest(F: Array, weight: Array, least: Array, most: Array) -> Array:
    """argmin weight·y with diag(y) ≽ F_k and least ≤ y ≤ most."""
    import cvxpy as cp

    y = cp.Variable(len(weight))
    limits: list[Any] = [cp.diag(y) - one >> 0 for one in F]
    limits.append(y >= least)
    held = np.isfinite(most)
    if held.any():
        limits.append(y[held] <= most[held])
    found = _solved(cp.Problem(cp.Minimize(weight @ y), limits), y)
    return np.clip(found, np.maximum(least, 1e-12), most)


def _solved(problem: Any, variable: Any) -> Array:
    """Let Clarabel solve; what it says is measured by the caller."""
    import cvxpy as cp
    from cvxpy import error as cvxpy_error

    tight = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
    try:
        with warnings.catch_warnings():  # of a solution that is inaccurate: it is measured
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cp.CLARABEL, **tight)
    except cvxpy_error.SolverError as error:
        raise SolverError(f"Clarabel found no gains: {error}") from error
    if variable.value is None:
        raise SolverError(f"Clarabel found no gains: {problem.status}")
    return np.asarray(variable.value)
