"""All frequencies at which a delay can put a root on the imaginary axis, with a proof for the rest.

An interval of frequencies is excluded when every disc that must hold an eigenvalue of
G(ω), for all ω in it, misses the line Re(z_0 ν) = −½. Two enclosures are used: Gershgorin's after
the eigenvectors at the centre, and Henrici's from the departure from normality, which needs no
eigenvectors. What is left is split about the crossing that Newton's step from its centre points
to, and in halves where it points to none, until it is a point.
"""

from dataclasses import dataclass

import numpy as np

from sealag.errors import SolverError
from sealag.margin._loop import Transfer
from sealag.typing import Array, BoolArray, IntArray

_NARROW = 2e-9
_BLURRED = 1e-6
_ZOOM = 64.0
_FLOOR = 1e-4
_SLOW = 1e-4
_TINY = 1e-14
_HIDDEN = 100.0
_WORST_VECTORS = 1e10
_MOST_INTERVALS = 400_000
_CHUNK = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Cluster:
    """A band of frequencies too narrow to split that may hold a crossing.

    Attributes:
        lower: lower end, rad/s.
        upper: upper end, rad/s.
    """

    lower: float
    upper: float


def slow_limit(transfer: Transfer) -> float:
    """Frequency far below the slowest pole, rad/s: what happens there is a contact at zero.

    Args:
        transfer: G about its reference.
    """
    slowest = float(np.abs(transfer.poles).min())
    return max(_FLOOR * slowest, _TINY * transfer.loop.size)


def candidate_bands(transfer: Transfer, *, zero_root: bool) -> list[Cluster]:
    """Find the narrow bands outside which no delay puts a root on the imaginary axis.

    Args:
        transfer: G about its reference.
        zero_root: whether a root lies at zero whatever the delay; slow frequencies are then left
            out, because it hides what crosses there.

    Returns:
        Disjoint bands in increasing frequency; the first may touch zero.

    Raises:
        SolverError: more intervals than any sensible loop needs.
    """
    top = 1.01 * transfer.loop.size
    marks = np.abs(transfer.poles.imag)
    floor = slow_limit(transfer)
    edges = np.concatenate([[0.0], np.geomspace(floor, top, 80), marks[marks < top]])
    edges = np.unique(edges[edges >= _HIDDEN * floor] if zero_root else edges)
    lower, upper = edges[:-1], edges[1:]
    narrow: list[tuple[float, float]] = []
    count = 0
    while len(lower):
        count += len(lower)
        if count > _MOST_INTERVALS:
            raise SolverError(
                "The frequency sweep does not close: the loop is too close to losing stability "
                "over a whole band of frequencies, or its matrices are badly scaled."
            )
        parts = [
            _examine(transfer, lower[i : i + _CHUNK], upper[i : i + _CHUNK])
            for i in range(0, len(lower), _CHUNK)
        ]
        excluded, crossing, blurred = (np.concatenate(part) for part in zip(*parts, strict=True))
        narrowest = np.where(blurred, _BLURRED, _NARROW) * upper
        final = upper - lower <= np.where(upper <= floor, _SLOW * floor, narrowest)
        narrow += list(zip(lower[~excluded & final], upper[~excluded & final], strict=True))
        wide = ~excluded & ~final
        lower, upper = _split(lower[wide], upper[wide], crossing[wide])
    return _merged(sorted(narrow))


def _split(lower: Array, upper: Array, crossing: Array) -> tuple[Array, Array]:
    """Cut intervals on both sides of the expected crossing, or in the middle if it lies outside."""
    inside = (crossing > lower) & (crossing < upper)
    guard = np.maximum((upper - lower) / (2.0 * _ZOOM), 0.45 * _NARROW * upper)
    middle = (lower + upper) / 2.0
    left = np.where(inside, np.maximum(crossing - guard, lower), middle)
    right = np.where(inside, np.minimum(crossing + guard, upper), middle)
    first, last = np.concatenate([lower, left, right]), np.concatenate([left, right, upper])
    return first[last > first], last[last > first]


def _merged(bands: list[tuple[float, float]]) -> list[Cluster]:
    merged: list[Cluster] = []
    for lower, upper in bands:
        if merged and lower <= merged[-1].upper * (1.0 + 1e-15):
            merged[-1] = Cluster(lower=merged[-1].lower, upper=upper)
        else:
            merged.append(Cluster(lower=lower, upper=upper))
    return merged


def _examine(transfer: Transfer, lower: Array, upper: Array) -> tuple[BoolArray, Array, BoolArray]:
    """Tell which of N intervals (rad/s) surely hold no crossing, and where one is expected (N,).

    Excluded is where every eigenvalue stays off the line throughout the interval. Third, where
    the eigenvalue nearest to the line moves less than rounding blurs it: to split is of no use.
    """
    centre, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    crossing, blurred = np.full(len(centre), np.nan), np.zeros(len(centre), dtype=bool)
    with np.errstate(all="ignore"):
        expand = _resolvent if transfer.left is None else _modal
        change = expand(transfer, centre, half)
        nu, X = np.linalg.eig(transfer.reference * change.G)
        gap = np.abs(nu.real + 0.5)
        done = _henrici(nu, change, gap=gap.min(axis=1))
        rest = np.flatnonzero(~done)
        if len(rest):
            some = change.only(rest)
            done[rest], step, blurred[rest] = _gershgorin(
                nu[rest], X[rest], some, half=half[rest], turn=transfer.reference
            )
            crossing[rest] = centre[rest] + step
        return done, crossing, blurred


@dataclass(frozen=True, slots=True, kw_only=True)
class _Change:
    """G at the centres of N intervals and bounds of how far it moves inside them.

    Entry by entry and seen through any basis, |G(ω) − G| ≤ |left| diag(first) |right| and
    |G(ω) − G − (ω − c) G'| ≤ |left| diag(second) |further|, with norms for entries when `full`.
    """

    G: Array
    slope: Array
    left: Array
    first: Array
    second: Array
    right: Array
    further: Array
    full: bool
    rounding: Array

    def only(self, rest: IntArray) -> "_Change":
        """The same for a choice of intervals."""
        fields = {
            name: value[rest] if len(value := getattr(self, name)) > 1 else value
            for name in ("G", "slope", "left", "first", "second", "right", "further", "rounding")
        }
        return _Change(full=self.full, **fields)

    def seen(self, X: Array, inverse: Array) -> tuple[Array, Array]:
        """Return bounds of X⁻¹ (G(ω) − G) X (N, r, r) and of the diagonal of its rest (N, r)."""
        rows = np.abs(inverse @ self.left)
        columns = np.abs(self.right @ X)
        further = columns if self.further is self.right else np.abs(self.further @ X)
        if self.full:
            rows = np.linalg.norm(rows, axis=2, keepdims=True)
            columns = np.linalg.norm(columns, axis=1, keepdims=True)
            further = np.linalg.norm(further, axis=1, keepdims=True)
        rest = ((rows * self.second[:, None, :]) * np.swapaxes(further, 1, 2)).sum(axis=2)
        return (rows * self.first[:, None, :]) @ columns, rest

    def norm(self) -> Array:
        """Return (N,) bounds of ‖G(ω) − G‖ with the rounding of G."""
        rows, columns = np.abs(self.left), np.abs(self.right)
        if self.full:
            rows = np.linalg.norm(rows, axis=(1, 2))
            columns = np.linalg.norm(columns, axis=(1, 2))
            return rows * self.first[:, 0] * columns + self.rounding
        terms = np.linalg.norm(rows, axis=1) * np.linalg.norm(columns, axis=2)
        return (terms * self.first).sum(axis=1) + self.rounding


def _modal(transfer: Transfer, centre: Array, half: Array) -> _Change:
    """Expand each pole's term 1/(jω − λ) about the centre."""
    assert transfer.left is not None
    assert transfer.right is not None
    away = 1j * centre[:, None] - transfer.poles
    sideways = np.maximum(np.abs(away.imag) - half[:, None], 0.0)
    nearest = np.hypot(sideways, transfer.poles.real)
    terms = np.linalg.norm(transfer.left, axis=0) * np.linalg.norm(transfer.right, axis=1)
    first = half[:, None] / (np.abs(away) * nearest)
    return _Change(
        G=(transfer.left[None] / away[:, None, :]) @ transfer.right,
        slope=-1j * (transfer.left[None] / away[:, None, :] ** 2) @ transfer.right,
        left=transfer.left[None],
        first=first,
        second=first * half[:, None] / np.abs(away),
        right=transfer.right[None],
        further=transfer.right[None],
        full=False,
        rounding=transfer.rounding * (terms / np.abs(away)).sum(axis=1),
    )


def _resolvent(transfer: Transfer, centre: Array, half: Array) -> _Change:
    """Without eigenvectors: R(ω) − R = −j(ω−c) R (I + j(ω−c) R)⁻¹ R."""
    R = transfer.resolvents(centre)
    reach = 1.0 - half * np.linalg.norm(R, ord=2, axis=(1, 2))
    left, right = transfer.loop.C @ R, R @ transfer.loop.B
    error = np.linalg.norm(left, axis=(1, 2)) * np.linalg.norm(right, axis=(1, 2))
    first = np.where(reach > 0.0, half / np.where(reach > 0.0, reach, 1.0), np.inf)[:, None]
    return _Change(
        G=left @ transfer.loop.B,
        slope=-1j * left @ right,
        left=left,
        first=first,
        second=first * half[:, None],
        right=right,
        further=R @ right,
        full=True,
        rounding=transfer.rounding * transfer.loop.size * error,
    )


def _gershgorin(
    nu: Array, X: Array, change: _Change, *, half: Array, turn: complex
) -> tuple[BoolArray, Array, BoolArray]:
    """Discs about eigenvalues that move with their known slope, in the eigenvectors' basis.

    Also returns, for the eigenvalue nearest to the line, Newton's step to it, rad/s, and whether
    rounding exceeds its motion.

    The basis vector of the eigenvalue nearest to the line is scaled so that the other discs just
    miss the line; its own radius is then of second order in the interval's width.
    """
    condition = np.linalg.cond(X)
    usable = condition < _WORST_VECTORS
    safe = np.where(usable[:, None, None], X, np.eye(X.shape[-1]))
    inverse = np.linalg.inv(safe)
    bound, rest = change.seen(safe, inverse)
    travel = turn * ((inverse @ change.slope) * np.swapaxes(safe, 1, 2)).sum(axis=2)
    moved = half[:, None] * np.abs(travel.real)
    at = np.arange(nu.shape[1])
    bound[:, at, at] = 0.0
    blur = change.rounding * condition
    gap = np.abs(nu.real + 0.5) - moved - rest - blur[:, None]
    nearest = (gap - bound.sum(axis=2)).argmin(axis=1)
    one = np.arange(len(nu))
    coupling = bound[one, :, nearest]
    room = gap - bound.sum(axis=2) + coupling
    room[one, nearest] = np.inf
    scale = np.where(coupling > 0.0, coupling / room, 0.0).max(axis=1)
    own = gap[one, nearest] - 1.0001 * scale * bound[one, nearest].sum(axis=1)
    step = -(nu[one, nearest].real + 0.5) / travel[one, nearest].real
    return usable & (room > 0.0).all(axis=1) & (own > 0.0), step, moved[one, nearest] < blur


def _henrici(nu: Array, change: _Change, *, gap: Array) -> BoolArray:
    """‖(s − G)⁻¹‖ ≤ Σ_k departure^k / gap^(k+1) < 1/‖change‖ for every s on the line."""
    norm2 = np.linalg.norm(change.G, axis=(1, 2)) ** 2
    departure = np.sqrt(np.maximum(norm2 - (np.abs(nu) ** 2).sum(axis=1), 0.0) + 1e-12 * norm2)
    growth = sum((departure / gap) ** k for k in range(nu.shape[1]))
    return np.nan_to_num(change.norm() * growth / gap, nan=np.inf) < 1.0
