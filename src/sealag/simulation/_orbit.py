"""Periodic gaits: fixed points of the step-to-step map, and its Floquet multipliers.

Both by Krylov subspaces of finite differences: a walk has some thousand coordinates, most of them
in delay lines, and few of them outlive a stride.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sealag.simulation._stride import Changed, Fallen, State, Strides
from sealag.typing import Array

BASE = 1e-5
"""rad, rad/s, m, m/s: largest change of a coordinate in a difference. Ten times more lets contacts
change within other ticks, ten times less shows the tolerance of 1e-9 m at which they are found."""
PERIODIC = 2e-8
"""Largest change of a coordinate over a stride at which Newton's method stops, in the same units;
contacts are found to 1e-9 m."""
NEARLY = 0.1
"""Largest change of an angle or rate over a stride of what still counts as a gait, a twentieth of a
walk's joint rates. Where a touchdown falls on the instant of a sample, which sees one velocity
before it and another one after, a gait repeats itself to some hundredths and no further."""
_WARM = 12  # strides before Newton's method; most of what does not grow has decayed by then
_NEWTON = 6
_GAIN = 0.5  # of the residual, that a step of Newton's method must leave at most
_LARGEST = 0.05  # of a coordinate, in one step of it
_VECTORS = 60
_TOLERANCE = 1e-3  # of the largest multiplier


@dataclass(frozen=True, slots=True, kw_only=True)
class Orbit:
    """A periodic gait and how it answers a small change.

    Attributes:
        multipliers: (m,) Floquet multipliers of a stride of two steps, largest first; translations
            along level ground, of multiplier 1, are taken out.
        mode: (N,) coordinates of the first one's eigenvector, complex.
        residual: largest change of an angle or a rate over a stride, rad, rad/s, m or m/s.
        error: how far the largest multiplier may be off: what the subspace leaves.
        state: where the gait passes the section.
    """

    multipliers: Array
    mode: Array
    residual: float
    error: float
    state: State


class _Map:
    """Differences of the map about a state."""

    def __init__(self, strides: Strides, state: State, *, central: bool) -> None:
        self._strides, self.state, self._central = strides, state, central
        strides.load(state)
        self.before = strides.coordinates()
        self.after = self._moved(None)
        self._signature = strides.signature()
        self.residual = self.after - self.before

    def _moved(self, change: Array | None) -> Array:
        self._strides.load(self.state, change)
        self._strides.run(1)
        return self._strides.coordinates()

    def _moved_alike(self, change: Array) -> Array:
        after = self._moved(change)
        if self._strides.signature() != self._signature:
            raise Changed("steps end in other ticks, or contacts differ at the section")
        return after

    def __call__(self, way: Array) -> Array:
        """Return the derivative along a way (N,)."""
        size = float(np.abs(way).max())
        if size == 0.0:
            return np.zeros_like(way)
        base = BASE / size
        ahead = self._moved_alike(base * way)
        if not self._central:
            return (ahead - self.after) / base
        return (ahead - self._moved_alike(-base * way)) / (2.0 * base)


def arnoldi(
    apply: Callable[[Array], Array], start: Array, enough: Callable[[Array, int], bool]
) -> tuple[Array, Array]:
    """Return an orthonormal basis V (N, m + 1) and H (m + 1, m) with A V_m = V H.

    Args:
        apply: A, linear.
        start: (N,) first vector.
        enough: whether H with m columns suffices.
    """
    V = np.zeros((_VECTORS + 1, len(start)))
    H = np.zeros((_VECTORS + 1, _VECTORS))
    V[0] = start / np.linalg.norm(start)
    m = 0
    for m in range(1, _VECTORS + 1):
        w = apply(V[m - 1])
        size = float(np.linalg.norm(w))
        for _ in range(2):  # the second time takes out what rounding left
            part = V[:m] @ w
            H[:m, m - 1] += part
            w = w - part @ V[:m]
        H[m, m - 1] = np.linalg.norm(w)
        if H[m, m - 1] <= 1e-12 * max(size, 1e-300):
            break
        V[m] = w / H[m, m - 1]
        if enough(H[: m + 1, :m], m):
            break
    return V[: m + 1].T, H[: m + 1, :m]


def _correction(derivative: Callable[[Array], Array], residual: Array) -> Array:
    """Solve (1 − DP) δ = residual by GMRES."""
    size = float(np.linalg.norm(residual))

    def solved(H: Array, m: int) -> tuple[Array, float]:
        shifted = np.eye(m + 1, m) - H
        right = np.zeros(m + 1)
        right[0] = size
        y = np.linalg.lstsq(shifted, right, rcond=None)[0]
        return y, float(np.linalg.norm(shifted @ y - right))

    V, H = arnoldi(derivative, residual, lambda H, m: solved(H, m)[1] < 1e-2 * size)
    y, _ = solved(H, H.shape[1])
    return V[:, : H.shape[1]] @ y


def _ritz(H: Array) -> tuple[Array, Array, float]:
    """Eigenvalues of H, largest first, the first one's vector, and its residual."""
    m = H.shape[1]
    values, vectors = np.linalg.eig(H[:m])
    order = np.argsort(-np.abs(values))
    first = vectors[:, order[0]]
    return values[order], first, float(H[m, m - 1] * abs(first[-1]))


def _settled(H: Array, m: int) -> bool:
    if m < 12:
        return False
    values, _, error = _ritz(H)
    return error < _TOLERANCE * abs(values[0])


def find_orbit(strides: Strides, *, warm: int = _WARM) -> Orbit | None:
    """Find the periodic gait near where a walk goes, and its multipliers.

    Args:
        strides: The walk, at any section.
        warm: Strides to walk first, as many as it does without falling.

    Returns:
        The gait; None if the walk does not repeat itself.

    Raises:
        Fallen: The robot falls within the first strides, or from the gait itself.
        Changed: The gait's steps end in other ticks if it is changed a little: they end with
            contacts, which the controller sees at its ticks only.
    """
    kept = [strides.save()]
    try:
        for _ in range(warm):
            strides.run(1)
            kept.append(strides.save())
    except Fallen:
        if len(kept) < 4:
            raise
        del kept[-2:]  # the last ones are the fall
    at = _Map(strides, kept[-1], central=False)
    for _ in range(_NEWTON):
        if float(np.abs(at.residual).max()) < PERIODIC:
            break
        try:
            move = _correction(at, at.residual)
            strides.load(at.state, move * min(1.0, _LARGEST / float(np.abs(move).max())))
            there = _Map(strides, strides.save(), central=False)
        except (Fallen, Changed):
            break
        gained = strides.plant_change(there.residual) < _GAIN * strides.plant_change(at.residual)
        at = there if gained else at
        if not gained:
            break
    if strides.plant_change(at.residual) > NEARLY:
        return None
    derivative = _Map(strides, at.state, central=True)
    push = strides.push(np.random.default_rng(0))
    V, H = arnoldi(derivative, derivative(push), _settled)
    values, first, error = _ritz(H)
    return Orbit(
        multipliers=values,
        mode=V[:, : H.shape[1]] @ first,
        residual=strides.plant_change(at.residual),
        error=error,
        state=at.state,
    )
