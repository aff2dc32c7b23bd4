"""Time-varying J* and stiffness: one multiplier for all that polytopes around a motion contain."""

from collections.abc import Sequence
from dataclasses import dataclass
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
        with np.errstate(divide="ignore"):
            stiffness = 1.0 / np.linalg.norm(parts.corners.scaled_stiffness(), axis=(1, 2))
        found = search(parts.corners, stiffness, tolerance=_TOLERANCE, solver=solver)
        sizes = _Sizes(delay=0.0, corner=np.zeros(parts.count), radius=np.zeros(parts.count))
        if found.factor is not None:
            sizes = _largest(parts, found.factor, sizes)
        proven = sizes.delay > 0.0 and found.factor is not None
        open_ = found.upper > found.delay * (1.0 + _TOLERANCE) and np.isfinite(found.delay)
        reason = f"{solver.name} left the bracket open: {found.status}" if open_ else ""
        if not proven and not open_:
            reason = "nothing was proven: the balls are too large; try shorter windows"
        return Bound(
            problem=problem,
            delay=lessened(sizes.delay, rounding(problem)) if proven else np.zeros(()),
            upper=lessened(found.upper, -rounding(problem)),
            multiplier=found.factor.W if found.factor is not None and proven else None,
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
    """Boxes of all windows with their corners, and what sticks out of them; windows by index."""

    edges: list[tuple[int, int]]
    boxes: Problem
    box_window: Array
    corners: Problem
    corner_window: Array
    rest: Problem
    rest_window: Array
    bend: Problem

    @property
    def count(self) -> int:
        return len(self.edges)

    def polytopes(self, sizes: _Sizes) -> tuple[Polytope, ...]:
        """Each window's box with the ball around it."""
        return tuple(
            Polytope(
                first=first,
                last=last,
                J=self.boxes.J[self.box_window == k],
                M=self.boxes.M[self.box_window == k],
                corner=float(sizes.corner[k]),
                radius=float(sizes.radius[k]),
            )
            for k, (first, last) in enumerate(self.edges)
        )


def _largest(parts: _Boxes, factor: Factor, nothing: _Sizes) -> _Sizes:
    """Bisect for the largest d with corner + radius ≤ √2 in every window."""
    high = float(estimated_delays(parts.corners, factor).min())
    if np.isinf(high):
        if not (parts.rest.M.any() or parts.bend.M.any()):
            found = _sizes(parts, factor, 0.0)
            return _Sizes(delay=np.inf, corner=found.corner, radius=found.radius)
        high = _LONGEST
    answer = nothing
    for step in range(50):
        tried = _sizes(parts, factor, high if step == 0 else 0.5 * (answer.delay + high))
        if (tried.corner + tried.radius <= np.sqrt(2.0) * (1.0 - 4.0 * EPS)).all():
            answer = tried
        else:
            high = tried.delay
        if answer.delay > high * (1.0 - 1e-9):
            break
    return answer


def _sizes(parts: _Boxes, factor: Factor, d: float) -> _Sizes:
    corner, rest, bend = np.zeros((3, parts.count))
    np.maximum.at(corner, parts.corner_window, _norms(parts.corners, factor, d))
    np.maximum.at(rest, parts.rest_window, _norms(parts.rest, factor, d))
    np.maximum.at(bend, parts.rest_window, _norms(parts.bend, factor, d))
    return _Sizes(delay=d, corner=corner, radius=rest + bend)


def _norms(problem: Problem, factor: Factor, d: float) -> Array:
    """‖[JᵀC, d M C^-ᵀ]‖₂ from above, rounding included, (N,)."""
    _, m, n = problem.J.shape
    G, H = transposed(problem.J) @ factor.C, d * (problem.M @ factor.C_inverse)
    size = norm(problem.J) * norm(factor.C) + d * norm(problem.M) * norm(factor.C_inverse)
    exact = np.linalg.norm(np.concatenate([G, H], axis=2), ord=2, axis=(1, 2))
    return exact + 32.0 * (m + n) * EPS * (size + exact)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Points:
    """(J, M) of instants as rows of numbers of like size."""

    problem: Problem
    weight_J: float
    weight_M: float

    def rows(self) -> Array:
        flat = [part.reshape(len(part), -1) for part in (self.problem.J, self.problem.M)]
        return np.concatenate([self.weight_J * flat[0], self.weight_M * flat[1]], axis=1)

    def back(self, rows: Sequence[Array]) -> Problem:
        _, m, n = self.problem.J.shape
        stacked = np.array(rows)
        J, M = stacked[:, : m * n] / self.weight_J, stacked[:, m * n :] / self.weight_M
        return Problem(J=J.reshape(-1, m, n), M=M.reshape(-1, n, m), blocks=self.problem.blocks)


def _boxed(problem: Problem, edges: list[tuple[int, int]], choice: Windows) -> _Boxes:
    """Box every window along its principal directions."""
    weights = (1.0 / max(float(np.abs(part).max()), 1e-300) for part in (problem.J, problem.M))
    points = _Points(problem=problem, weight_J=next(weights), weight_M=next(weights))
    rows = points.rows()
    bend = np.zeros_like(rows)
    if choice.between:
        bend[1:-1] = (rows[2:] - 2.0 * rows[1:-1] + rows[:-2]) / 8.0
        bend[list(choice.breaks)] = bend[[at - 1 for at in choice.breaks]] = 0.0
    boxes, corners, rests, bends = [], [], [], []
    box_window, corner_window, rest_window = [], [], []
    for k, (first, last) in enumerate(edges):
        here = rows[first : last + 1]
        middle = here.mean(axis=0)
        axes = np.linalg.svd(here - middle, full_matrices=False)[2][: choice.directions]
        along = (here - middle) @ axes.T
        low, high = along.min(axis=0), along.max(axis=0)
        centre, half = middle + (low + high) / 2.0 @ axes, ((high - low) / 2.0)[:, None] * axes
        signs = product((-1.0, 1.0), repeat=len(half))
        around = [centre + np.array(sign) @ half for sign in signs]
        boxes += [centre, *half]
        corners += around
        rests.extend(here - middle - along @ axes)
        bends.extend(bend[first : last + 1])
        box_window += [k] * (1 + len(half))
        corner_window += [k] * len(around)
        rest_window += [k] * len(here)
    return _Boxes(
        edges=edges,
        boxes=points.back(boxes),
        box_window=np.array(box_window),
        corners=points.back(corners),
        corner_window=np.array(corner_window),
        rest=points.back(rests),
        rest_window=np.array(rest_window),
        bend=points.back(bends),
    )
