"""Time-varying J* and stiffness: one multiplier for all that polytopes around a motion contain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from sealag.errors import InputError
from sealag.passivity._bound import Bound, Polytope
from sealag.passivity._measure import Factor, estimated_delays, lessened
from sealag.passivity._problem import EPS, Problem, norm, transposed
from sealag.passivity._solve import rounding, search
from sealag.passivity._solvers import Solver
from sealag.typing import Array

_TOLERANCE = 1e-4
"""Relative distance at which proven and refuted delay of the corners have met. Ten times less costs
twice the solver's time; ten times more is seen in the third digit of the bound."""

_LONGEST = 1e6
"""Where bisection starts, s, if the corners have no stiffness but something around them has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """One multiplier for matrices that vary as they like inside polytopes around a motion.

    In each window of time the instants' (J*, J*ᵀS) are boxed along their principal directions; what
    sticks out of the box is measured and covered by a ball. The inequality is a convex norm bound
    ‖[J*ᵀC, d J*ᵀS C^-ᵀ]‖₂ ≤ √2, W = C Cᵀ, so that corners plus ball radius prove all of the set.
    Sufficient, not necessary: boxes are larger than the motion.

    Attributes:
        width: intervals between instants in one window.
        directions: principal directions that are boxed; each doubles the corners.
        breaks: instants at which something jumps (a contact); no window reaches across from the
            instant before, and nothing is assumed between the two.
        between: whether the ball also covers the motion between instants, estimated from second
            differences (heuristic: exact only for quadratic motions).
    """

    width: int = 50
    directions: int = 2
    breaks: Sequence[int] = ()
    between: bool = True

    def bound(self, problem: Problem, solver: Solver) -> Bound:
        """Answer a problem of one axis of instants.

        Args:
            problem: the question.
            solver: where multipliers come from.
        """
        problem = problem.motion()
        parts = _boxed(problem, self._edges(len(problem.J)), self)
        points = np.concatenate(parts.corners)
        corners = Problem(J=_J(points), M=_M(points), blocks=problem.blocks)
        with np.errstate(divide="ignore"):
            stiffness = 1.0 / np.linalg.norm(corners.scaled_stiffness(), axis=(1, 2))
        found = search(corners, stiffness, tolerance=_TOLERANCE, solver=solver)
        open_ = found.upper > found.delay * (1.0 + _TOLERANCE) and np.isfinite(found.delay)
        reason = f"{solver.name} left the bracket open: {found.status}" if open_ else ""
        upper = lessened(found.upper, -rounding(problem))
        sizes = None if found.factor is None else _largest(parts, corners, found.factor)
        if found.factor is None or sizes is None or sizes.delay == 0.0:
            reason = reason or "nothing was proven: the balls are too large; try shorter windows"
            return Bound(problem=problem, delay=np.zeros(()), upper=upper, reason=reason)
        return Bound(
            problem=problem,
            delay=lessened(sizes.delay, rounding(problem)),
            upper=upper,
            multiplier=found.factor.W,
            binding=found.binding,
            reason=reason,
            windows=parts.polytopes(sizes),
        )

    def _edges(self, count: int) -> list[tuple[int, int]]:
        """First and last instant of each window."""
        if self.width < 1:
            raise InputError(f"width is {self.width}; at least one interval is needed.")
        if not 0 <= self.directions <= 8:
            raise InputError(f"directions is {self.directions}; it must lie in 0 … 8.")
        if any(not 0 < at < count for at in self.breaks):
            raise InputError(f"breaks must be instants 1 … {count - 1}.")
        found = []
        for first, after in pairwise([0, *sorted(set(self.breaks)), count]):
            inner = list(range(first, after - 1, self.width)) or [first]
            found += list(zip(inner, [*inner[1:], after - 1]))
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sizes:
    """A delay, and in every window the largest corner and the ball's radius for it, (K,)."""

    delay: float
    corner: Array
    radius: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class _Boxes:
    """Boxes of all windows with their corners, and what sticks out of them.

    Points are [Jᵀ, M], (n, 2m). Each list has one array (…, n, 2m) a window: the box's centre and
    half edges, its corners, and of each instant what the box leaves and what the ball adds for the
    motion between instants.
    """

    edges: list[tuple[int, int]]
    boxes: list[Array]
    corners: list[Array]
    rest: list[Array]
    bend: list[Array]

    def polytopes(self, sizes: _Sizes) -> tuple[Polytope, ...]:
        """Each window's box with the ball around it."""
        return tuple(
            Polytope(
                first=first,
                last=last,
                J=_J(box),
                M=_M(box),
                corner=float(corner),
                radius=float(radius),
            )
            for (first, last), box, corner, radius in zip(
                self.edges, self.boxes, sizes.corner, sizes.radius, strict=True
            )
        )

    def sizes(self, factor: Factor, delay: float) -> _Sizes:
        """Largest corner and radius of each window for a multiplier and a delay."""
        corner, rest, bend = (
            _largest_norms(part, factor, delay) for part in (self.corners, self.rest, self.bend)
        )
        return _Sizes(delay=delay, corner=corner, radius=rest + bend)


def _J(points: Array) -> Array:
    return transposed(points[..., : points.shape[-1] // 2])


def _M(points: Array) -> Array:
    return points[..., points.shape[-1] // 2 :]


def _largest(parts: _Boxes, corners: Problem, factor: Factor) -> _Sizes:
    """Bisect for the largest d with corner + radius ≤ √2 in every window."""
    high = float(estimated_delays(corners, factor).min())
    if np.isinf(high):
        loose = any(_M(part).any() for part in (*parts.rest, *parts.bend))
        if not loose:
            return replace(parts.sizes(factor, 0.0), delay=np.inf)
        high = _LONGEST
    nothing = np.zeros(len(parts.edges))
    answer = _Sizes(delay=0.0, corner=nothing, radius=nothing)
    for step in range(50):
        tried = parts.sizes(factor, high if step == 0 else 0.5 * (answer.delay + high))
        if (tried.corner + tried.radius <= np.sqrt(2.0) * (1.0 - 4.0 * EPS)).all():
            answer = tried
        else:
            high = tried.delay
        if answer.delay > high * (1.0 - 1e-9):
            break
    return answer


def _largest_norms(windows: list[Array], factor: Factor, d: float) -> Array:
    """Largest ‖[JᵀC, d M C^-ᵀ]‖₂ of each window from above, rounding included, (K,)."""
    points = np.concatenate(windows)
    J, M = _J(points), _M(points)
    turned = np.concatenate([transposed(J) @ factor.C, d * (M @ factor.C_inverse)], axis=2)
    exact = np.linalg.norm(turned, ord=2, axis=(1, 2))
    size = norm(J) * norm(factor.C) + d * norm(M) * norm(factor.C_inverse)
    above = exact + 32.0 * sum(J.shape[1:]) * EPS * (size + exact)
    return np.maximum.reduceat(above, np.cumsum([0, *map(len, windows[:-1])]))


def _boxed(problem: Problem, edges: list[tuple[int, int]], choice: Windows) -> _Boxes:
    """Box every window along its principal directions."""
    points = np.concatenate([transposed(problem.J), problem.M], axis=2)
    bend = np.zeros_like(points)
    if choice.between:
        bend[1:-1] = (points[2:] - 2.0 * points[1:-1] + points[:-2]) / 8.0
        bend[list(choice.breaks)] = bend[[at - 1 for at in choice.breaks]] = 0.0
    # J and M have units of their own: directions are those of numbers of like size.
    largest = [max(float(np.abs(part).max()), 1e-300) for part in (problem.J, problem.M)]
    weight = np.repeat(1.0 / np.array(largest), problem.J.shape[1])
    boxes, corners, rest = [], [], []
    for first, last in edges:
        here = points[first : last + 1] * weight
        flat = here.reshape(len(here), -1)
        middle = flat.mean(axis=0)
        axes = np.linalg.svd(flat - middle, full_matrices=False)[2][: choice.directions]
        along = (flat - middle) @ axes.T
        low, high = along.min(axis=0), along.max(axis=0)
        centre, half = middle + (low + high) / 2.0 @ axes, ((high - low) / 2.0)[:, None] * axes
        signs = list(product((-1.0, 1.0), repeat=len(half)))
        shape = (-1, *here.shape[1:])
        boxes.append(np.vstack([centre, half]).reshape(shape) / weight)
        corners.append((centre + np.array(signs) @ half).reshape(shape) / weight)
        rest.append((flat - middle - along @ axes).reshape(shape) / weight)
    bends = [bend[first : last + 1] for first, last in edges]
    return _Boxes(edges=edges, boxes=boxes, corners=corners, rest=rest, bend=bends)
