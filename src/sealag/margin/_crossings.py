"""Crossings of the imaginary axis, refined to rounding from what the search left."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sealag.margin._family import Curve, Family
from sealag.margin._loop import Complex, Loop, exact_determinant, rational
from sealag.margin._pictures import Picture
from sealag.margin._search import Band, Passage
from sealag.typing import Array

_TOUCHING = 1e-6
_STEPS = 40
_CORRECTIONS = 2
_CONVERGED = 1e-9
_BESIDE = 0.005
_FINEST = float(np.finfo(np.longdouble).eps)
_SAME = 1e-11
_ON_AXIS = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A root jω that lies on the imaginary axis for delays (φ + 2πk)/ω.

    Attributes:
        delay: shortest such delay, s.
        frequency: ω, rad/s.
        direction: +1 when the root leaves the left half-plane as the delay grows, −1 when it
            enters, 0 when it touches the axis.
        mode: (states,) complex eigenvector over the states, its largest entry 1.
        residual: length of (jω − A_0 − A_1 e^{-jωd} − A_e e^{-jωe}) applied to the balanced unit
            mode, over the loop's norm.
    """

    delay: float
    frequency: float
    direction: int
    mode: Array
    residual: float

    @property
    def period(self) -> float:
        """Time 2π/ω after which the same root lies on the axis again, s."""
        return 2.0 * math.pi / self.frequency


class Found(NamedTuple):
    """What a passage or a band turned out to hold.

    Attributes:
        crossings: crossings at positive frequency.
        explained: whether a crossing, or its proven absence, explains it.
        decided: whether no contact at zero frequency was left open by rounding.
    """

    crossings: list[Crossing]
    explained: bool
    decided: bool


class _Point(NamedTuple):
    """A solution of P(jω, φ) v = 0, with how the root moves by φ."""

    phi: float
    omega: float
    slope: complex
    mode: Array
    residual: float


def crossings_of(picture: Picture, passages: list[Passage], bands: list[Band]) -> Found:
    """Refine what the search left.

    Args:
        picture: the parameter that was searched over.
        passages: parts in which some eigenvalues each meet the axis at most once.
        bands: bands too narrow to split.

    Returns:
        The crossings by delay, each once, and what is left open.
    """
    inside = [[_in_passage(picture, one, curve) for curve in one.curves] for one in passages]
    parts = [part for curves in inside for part in curves]
    single = _once([[item for part in curves for item in part.crossings] for curves in inside])
    for band in bands:
        part = _in_band(picture, band)
        parts.append(part)
        single += [one for one in part.crossings if not any(_same(one, two) for two in single)]
    return Found(
        crossings=sorted(single, key=lambda crossing: crossing.delay),
        explained=all(part.explained for part in parts),
        decided=all(part.decided for part in parts),
    )


def _once(passages: list[list[Crossing]]) -> list[Crossing]:
    """Leave out what two passages found at the end that they share.

    Curves of one passage that cross at one place are different roots: two equal arms have two.
    """
    kept: list[Crossing] = []
    for found in passages:
        before = list(kept)
        for i, one in enumerate(found, start=1):
            here = sum(_same(one, two) for two in found[:i])
            if here > sum(_same(one, two) for two in before):
                kept.append(one)
    return kept


def _same(one: Crossing, two: Crossing) -> bool:
    near = abs(one.frequency - two.frequency) <= _SAME * one.frequency
    return near and abs(one.delay - two.delay) * one.frequency <= 100.0 * _SAME


def _in_passage(picture: Picture, part: Passage, curve: Curve) -> Found:
    """The crossing of one curve, if it meets the axis in its part at all."""
    family, k = part.family, curve.index
    value = family.values[k]
    if curve.even:
        blur = family.blur[k, k]
        if abs(value.real) <= blur:
            return _at_rest(picture, part, curve)
        if curve.offset < 0.0:
            return Found([], explained=True, decided=True)
    mirrored = curve.even and family.centre > part.lower
    signs = [_side(picture, part, curve, at) for at in (part.lower, part.upper)]
    if signs[0] * signs[1] > 0.0:
        return Found([], explained=True, decided=True)
    start = family.centre + (-curve.offset if mirrored else curve.offset)
    start = min(max(start, part.lower), part.upper)
    expected = value + (start - family.centre) * family.motion[k, k]
    phi, omega = picture.place(start, complex(1j * expected.imag))
    vectors = {"left": family.left[k], "right": family.right[:, k]}
    point = _newton(picture.loop, phi, omega, **vectors, proven=signs[0] * signs[1] < 0.0)
    if point is not None and _belongs(picture, part, curve, point):
        return _reported(picture.loop, point, touching=False)
    return Found([], explained=False, decided=False)


def _belongs(picture: Picture, part: Passage, curve: Curve, point: _Point) -> bool:
    """Whether a refined point is on the curve and in its part or next to an end.

    Rounding may put a crossing at an end on either side. The curve's bounds leave room for it: a
    hundredth further it still meets the axis at most once, so that both parts find one point.
    """
    family, k = part.family, curve.index
    t = picture.parameter(point.phi, point.omega)
    slack = _BESIDE * (part.upper - part.lower)
    if not part.lower - slack <= t <= part.upper + slack:
        return False
    placed = picture.value(point.phi, point.omega)
    along = family.values[k] + (t - family.centre) * family.motion[k, k]
    return bool(abs(placed - along) <= 1.01 * curve.reach)


def _side(picture: Picture, part: Passage, curve: Curve, at: float) -> float:
    """On which side of the axis the curve is at an end of its part; 0 where it cannot be told."""
    family, k = part.family, curve.index
    if curve.even and at == family.centre:
        return math.copysign(1.0, family.values[k].real)
    along = family.values[k] + (at - family.centre) * family.motion[k, k]
    if not curve.even and abs(along.real) > curve.reach:
        return math.copysign(1.0, along.real)
    other = picture.family(at)
    if other is None:
        return 0.0
    nearest = int(np.abs(other.values - along).argmin())
    value = other.values[nearest].real
    return math.copysign(1.0, value) if abs(value) > other.blur[nearest, nearest] else 0.0


def _at_rest(picture: Picture, part: Passage, curve: Curve) -> Found:
    """A real eigenvalue that rounding cannot tell from zero, at φ = 0, φ = π or ω = 0.

    Where the matrix is the user's own, its determinant in rational arithmetic tells. If it is zero,
    z = ±1 has a root at zero, no finite delay of z = −1 reaches it, and the curve, even and
    monotone in Δ², meets the axis nowhere else. If not, the eigenvalue is the determinant over the
    others, and Δ² = −m/b.
    """
    loop, family, k = picture.loop, part.family, curve.index
    phi = picture.place(family.centre, family.values[k])[0]
    z = 1.0 if math.cos(phi) > 0.0 else -1.0
    if not loop.exact or z > 0.0:
        return Found([], explained=True, decided=False)
    determinant = exact_determinant(loop.A_0 + loop.A_e - loop.A_1)
    if determinant == 0:
        return Found([], explained=True, decided=True)
    if loop.embedded:
        return Found([], explained=True, decided=False)
    for other in np.delete(family.values, k):
        determinant /= rational(abs(other) if other.imag else other.real)
    square = -float(determinant) / curve.bend
    if square <= 0.0:
        return Found([], explained=True, decided=True)
    offset = math.sqrt(square)
    omega = abs(family.motion[k, k]) * offset
    slope = family.motion[k, k] - 2.0 * curve.bend * offset
    if family.motion[k, k].imag > 0.0:
        omega = -omega
    point = _point(loop, math.pi - offset, omega, slope=slope, mode=family.right[:, k])
    return _reported(loop, point, touching=False)


def _in_band(picture: Picture, band: Band) -> Found:
    """Every eigenvalue next to the axis in a band that could not be split."""
    middle = (band.lower + band.upper) / 2.0
    family = picture.family(middle)
    if family is None:
        return Found([], explained=False, decided=False)
    half = (band.upper - band.lower) / 2.0
    rates = np.abs(np.diagonal(family.motion).real)
    room = 4.0 * (np.diagonal(family.blur) + 2.0 * half * rates)
    room = np.maximum(room, _ON_AXIS * np.abs(np.diagonal(family.motion)) * max(half, 1e-8))
    close = np.abs(family.values.real) <= room
    if band.end:
        close &= family.values.imag >= 0.0  # the conjugate is the mirror image
    near = np.flatnonzero(close)
    found: list[Crossing] = []
    explained, decided = bool(len(near)), True
    for k in near:
        point = _refined(picture, family, int(k))
        if point is None:
            explained = False
            continue
        part = _reported(picture.loop, point, touching=True)
        found += part.crossings
        decided &= part.decided
    return Found(found, explained=explained, decided=decided)


def _refined(picture: Picture, family: Family, k: int) -> _Point | None:
    """The point on the axis of one eigenvalue of a band, a crossing or a touch."""
    phi, omega = picture.place(family.centre, complex(1j * family.values[k].imag))
    vectors = {"left": family.left[k], "right": family.right[:, k]}
    point = _newton(picture.loop, phi, omega, **vectors)
    if point is None or abs(point.slope.real) < _TOUCHING * abs(point.slope):
        point = _touch(picture.loop, phi, omega, **vectors)
    return point


def _reported(loop: Loop, point: _Point, *, touching: bool) -> Found:
    """The crossing at positive frequency; at zero frequency there is none."""
    error = 64.0 * len(loop.A_0) * np.finfo(float).eps * loop.size
    if abs(point.omega) <= error:
        return Found([], explained=True, decided=False)
    turned = point.phi if point.omega > 0.0 else -point.phi
    delay = (turned % (2.0 * math.pi)) / abs(point.omega)
    slope = point.slope
    flat = touching and abs(slope.real) < _TOUCHING * abs(slope)
    direction = 0 if flat else int(math.copysign(1.0, slope.real * point.omega))
    mode = loop.lift @ (point.mode if point.omega > 0.0 else point.mode.conj())
    crossing = Crossing(
        delay=float(delay),
        frequency=float(abs(point.omega)),
        direction=direction,
        mode=mode / mode[np.abs(mode).argmax()],
        residual=point.residual,
    )
    return Found([crossing], explained=True, decided=True)


class _Border(NamedTuple):
    """P v = −b g with c v = 1: g is zero where P is singular; its derivatives, and dλ/dφ.

    `blur` is what rounding leaves of g.
    """

    g: np.clongdouble
    blur: float
    by_root: complex
    by_turn: complex
    v: Array
    slope: complex


def _border(
    loop: Loop, phi: float | np.longdouble, root: Complex, *, left: Array, right: Array
) -> _Border:
    """Solve the bordered system, and correct v and g by their residual in extended precision.

    Doubles leave g an error that turns a slow root beside a fast loop by ε size/ω: more than a
    crossing may be off.
    """
    n = len(loop.A_0)
    z = np.exp(-1j * np.longdouble(phi))
    P, slope = loop.characteristic(np.clongdouble(root), z)
    K = np.zeros((n + 1, n + 1), dtype=np.clongdouble)
    K[:n, :n] = P
    K[:n, n] = right * (loop.size / np.linalg.norm(right))
    K[n, :n] = left * (loop.size / np.linalg.norm(left))
    inverse = np.linalg.inv(K.astype(complex))
    wide = inverse[:, n].astype(np.clongdouble)
    for _ in range(_CORRECTIONS):
        residual = K @ wide
        residual[n] -= 1.0
        wide -= inverse @ residual.astype(complex)
    v, y = wide[:n].astype(complex), inverse[n, :n]
    by_root = complex(-(y @ slope.astype(complex) @ v))
    by_turn = complex(-1j * complex(z) * (y @ loop.A_1 @ v))
    blur = (n + 4) * _FINEST * loop.size * float(np.linalg.norm(y) * np.linalg.norm(v))
    return _Border(wide[n], blur, by_root, by_turn, v, slope=-by_turn / by_root)


def _newton(
    loop: Loop, phi: float, omega: float, *, left: Array, right: Array, proven: bool = False
) -> _Point | None:
    """Newton's method on g(jω, φ) = 0 in the real unknowns φ and ω, until rounding stops it.

    Only where a crossing is proven may rounding stop it early: a band may hold none.
    """
    best: tuple[float, float, float, _Border] | None = None
    allowed = _CONVERGED
    turn, height = np.longdouble(phi), np.longdouble(omega)
    try:
        for _ in range(_STEPS):
            border = _border(loop, turn, 1j * height, left=left, right=right)
            across = 1j * border.by_root
            area = (across.conjugate() * border.by_turn).imag
            if area == 0.0:
                return None
            step_phi = (across.conjugate() * -border.g).imag / area
            step_omega = (-border.g * border.by_turn.conjugate()).imag / -area
            moved = float(max(abs(step_phi), abs(step_omega) / loop.size))
            if best is not None and not moved < best[0]:
                break
            best = moved, float(turn), float(height), border
            if proven:
                rates = max(abs(border.by_root), abs(border.by_turn) / loop.size)
                allowed = max(_CONVERGED, 4.0 * border.blur * rates / abs(area))
            turn, height = turn + step_phi, height + step_omega
            if moved <= 1e-16:
                break
    except np.linalg.LinAlgError:
        if best is None:
            return None
    if best is None or best[0] > allowed:
        return None
    return _point(loop, best[1], best[2], slope=best[3].slope, mode=best[3].v)


def _touch(loop: Loop, phi: float, omega: float, *, left: Array, right: Array) -> _Point | None:
    """Secant method on the slope of Re λ(φ): the turn at which a root touches the axis."""

    def follow(at: float, root: Complex) -> tuple[Complex, _Border]:
        for _ in range(_STEPS):
            border = _border(loop, at, root, left=left, right=right)
            step = -border.g / border.by_root
            root += step
            if abs(step) <= 4e-16 * abs(root):
                break
        return root, border

    def rate(border: _Border) -> float:
        return border.slope.real

    try:
        root, border = follow(phi, 1j * np.longdouble(omega))
        other = phi + 1e-6
        beside = rate(follow(other, root)[1])
        for _ in range(_STEPS):
            here = rate(border)
            if here == beside or abs(other - phi) <= 1e-14:
                break
            new = phi - here * (phi - other) / (here - beside)
            if not abs(new - phi) <= 1e-3:
                return None
            other, beside, phi = phi, here, new
            root, border = follow(phi, root)
    except np.linalg.LinAlgError:
        return None
    if abs(root.real) > _ON_AXIS * abs(border.slope):
        return None
    return _point(loop, phi, float(root.imag), slope=border.slope, mode=border.v)


def _point(loop: Loop, phi: float, omega: float, *, slope: complex, mode: Array) -> _Point:
    P = loop.characteristic(1j * omega, np.exp(-1j * phi))[0]
    size = float(np.linalg.norm(mode)) * loop.size
    residual = float(np.linalg.norm(P @ mode)) / size
    return _Point(phi=phi, omega=omega, slope=slope, mode=mode, residual=residual)
