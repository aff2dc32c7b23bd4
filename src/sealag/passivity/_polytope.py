"""Time-varying J* and stiffness: one multiplier for everything inside polytopes around a motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from sealag.errors import InputError
from sealag.passivity._common import search, stacked_problem
from sealag.passivity._problem import (
    Factor,
    MultiplierProblem,
    estimated_delays,
    lessened,
)
from sealag.passivity._scaling import EPS, ScaledTask, scaled_stiffness, scaled_task
from sealag.passivity._solvers import ClarabelDirect, Solver
from sealag.typing import Array, ArrayLike
from sealag.whole_body import StiffnessForm

_TOLERANCE = 1e-4
"""Relative distance at which proven and refuted delay of the corners have met."""

_LONGEST = 1e6
"""Where bisection starts, s, if the corners have no stiffness but something around them has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PolytopeBound:
    """A delay proven for every (J*, J*ᵀS) in a set that contains a motion, window by window.

    Attributes:
        delay: s; proven for boxes and balls around them, however fast the matrices move inside.
        W: (m, m) the multiplier; None if nothing was proven.
        windows: first and last instant of each window; neighbours share one.
        vertices: number of corners at which the inequality was checked.
        boxes: centre and then half edges of each window's box, as (J* D^-½, D^-½ J*ᵀ S).
        box_window: window that each of them belongs to.
        box: (K,) largest ‖[J*ᵀC, d J*ᵀS C^-ᵀ]‖₂ over each window's corners.
        ball: (K,) radius, in the same norm, of the ball added to the box so that all instants,
            and all between them if asked, lie inside; box + ball ≤ √2 is what proves the delay.
        reason: why nothing was proven, or that the solver left a longer delay of the corners open,
            in words; else empty.
    """

    delay: float
    W: Array | None
    windows: tuple[tuple[int, int], ...]
    vertices: int
    boxes: MultiplierProblem
    box_window: Array
    box: Array
    ball: Array
    reason: str


def max_delay_polytope(
    tasks: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    D_theta: ArrayLike,
    *,
    form: StiffnessForm | str = StiffnessForm.SYMMETRIC,
    window: int = 50,
    directions: int = 2,
    breaks: Sequence[int] = (),
    between: bool = True,
    solver: Solver | None = None,
) -> PolytopeBound:
    """Prove (29) or (31) with one Q for matrices that vary inside polytopes around a motion.

    In each window of time the instants' (J*, J*ᵀS) are boxed along their principal directions; what
    sticks out of the box is measured and covered by a ball. The inequality is a convex norm bound
    ‖[J*ᵀC, d J*ᵀS C^-ᵀ]‖₂ ≤ √2, W = C Cᵀ, so that corners plus ball radius prove all of the set.
    Sufficient, not necessary: boxes are larger than the motion.

    Args:
        tasks: (N, m_i, n), (N, m_i, m_i) and (m_i,) or (N, m_i, m_i) of each task, by time.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        form: symmetric, published or force stiffness.
        window: intervals between instants in one window.
        directions: principal directions that are boxed; each doubles the corners.
        breaks: instants at which something jumps (a contact); no window reaches across from the
            instant before, and nothing is assumed between the two.
        between: whether the ball also covers the motion between instants, estimated from second
            differences (heuristic: exact only for quadratic motions).
        solver: where multipliers come from; Clarabel's own interface if None.

    Returns:
        The delay with its multiplier, and how large boxes and balls are.

    Raises:
        InputError: an array, window, direction count or break is unusable.
    """
    scaled = [scaled_task(*task, D_theta, form=form) for task in tasks]
    return _polytope(scaled, window, directions, breaks, between, solver)


def max_delay_polytope_from_stiffness(
    F: ArrayLike,
    D_theta: ArrayLike,
    *,
    window: int = 50,
    directions: int = 2,
    breaks: Sequence[int] = (),
    between: bool = True,
    solver: Solver | None = None,
) -> PolytopeBound:
    """Prove a delay for delayed stiffnesses that vary inside polytopes around a motion.

    As `max_delay_polytope`, with one multiplier in joint coordinates.

    Args:
        F: (N, n, n) Nm/rad, in order of time.
        D_theta: (n,) or (n, n) motor damping, Nms/rad.
        window: intervals between instants in one window.
        directions: principal directions that are boxed; each doubles the corners.
        breaks: instants at which something jumps.
        between: whether the ball also covers the motion between instants (heuristic).
        solver: where multipliers come from; Clarabel's own interface if None.

    Returns:
        The delay with its multiplier, and how large boxes and balls are.

    Raises:
        InputError: an array, window, direction count or break is unusable.
    """
    return _polytope([scaled_stiffness(F, D_theta)], window, directions, breaks, between, solver)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Windows:
    """Every window's box with its corners, and what sticks out of it."""

    edges: tuple[tuple[int, int], ...]
    boxes: MultiplierProblem
    box_window: Array
    corners: MultiplierProblem
    corner_window: Array
    rest: MultiplierProblem
    rest_window: Array
    bend: MultiplierProblem


def _polytope(
    tasks: Sequence[ScaledTask],
    window: int,
    directions: int,
    breaks: Sequence[int],
    between: bool,
    solver: Solver | None,
) -> PolytopeBound:
    problem, slack = stacked_problem(tasks)
    edges = _edges(len(problem.J), window, breaks)
    if not 0 <= directions <= 8:
        raise InputError(f"directions is {directions}; it must lie in 0 … 8.")
    parts = _windows(problem, edges, directions, breaks=breaks, between=between)
    A = parts.corners.M @ parts.corners.J
    chosen = solver if solver is not None else ClarabelDirect()
    with np.errstate(divide="ignore"):
        stiffness = 1.0 / np.linalg.norm(A, axis=(1, 2))
    found = search(parts.corners, stiffness, tolerance=_TOLERANCE, solver=chosen)
    delay, box, ball = 0.0, np.zeros(len(edges)), np.zeros(len(edges))
    if found.factor is not None:
        delay, box, ball = _largest(parts, found.factor)
    proven = delay > 0.0 and found.factor is not None
    W = found.factor.C @ found.factor.C.T if found.factor is not None and proven else None
    open_ = found.upper > found.delay * (1.0 + _TOLERANCE) and np.isfinite(found.delay)
    reason = f"{chosen.name} left the bracket open: {found.status}" if open_ else ""
    if not proven and not open_:
        reason = "nothing was proven: the balls are too large; try shorter windows"
    return PolytopeBound(
        delay=float(lessened(delay, slack)) if proven else 0.0,
        W=W,
        windows=edges,
        vertices=len(A),
        boxes=parts.boxes,
        box_window=parts.box_window,
        box=box,
        ball=ball,
        reason=reason,
    )


def _largest(parts: _Windows, factor: Factor) -> tuple[float, Array, Array]:
    """Bisect for the largest d with box + ball ≤ √2 in every window."""
    high = float(estimated_delays(parts.corners, factor).min())
    if np.isinf(high):
        loaded = parts.rest.M.any() or parts.bend.M.any()
        if not loaded:
            return (np.inf, *_sizes(parts, factor, 0.0))
        high = _LONGEST
    delay, answer = 0.0, (0.0, np.zeros(len(parts.edges)), np.zeros(len(parts.edges)))
    for step in range(50):
        d = high if step == 0 else 0.5 * (delay + high)
        box, ball = _sizes(parts, factor, d)
        if (box + ball <= np.sqrt(2.0) * (1.0 - 4.0 * EPS)).all():
            delay, answer = d, (d, box, ball)
        else:
            high = d
        if delay > high * (1.0 - 1e-9):
            break
    return answer


def _sizes(parts: _Windows, factor: Factor, d: float) -> tuple[Array, Array]:
    """Each window's largest corner and the radius of its ball, rounding included."""
    box, ball = np.zeros(len(parts.edges)), np.zeros(len(parts.edges))
    np.maximum.at(box, parts.corner_window, _norms(parts.corners, factor, d))
    rest, bend = _norms(parts.rest, factor, d), _norms(parts.bend, factor, d)
    np.maximum.at(ball, parts.rest_window, rest)
    bends = np.zeros(len(parts.edges))
    np.maximum.at(bends, parts.rest_window, bend)
    return box, ball + bends


def _norms(problem: MultiplierProblem, factor: Factor, d: float) -> Array:
    """‖[JᵀC, d M C^-ᵀ]‖₂ from above, (N,)."""
    _, m, n = problem.J.shape
    G = np.swapaxes(problem.J, 1, 2) @ factor.C
    H = d * (problem.M @ factor.C_inverse)
    size = np.linalg.norm(problem.J, axis=(1, 2)) * np.linalg.norm(factor.C)
    size += d * np.linalg.norm(problem.M, axis=(1, 2)) * np.linalg.norm(factor.C_inverse)
    exact = np.linalg.norm(np.concatenate([G, H], axis=2), ord=2, axis=(1, 2))
    return exact + 32.0 * (m + n) * EPS * (size + exact)


def _edges(count: int, window: int, breaks: Sequence[int]) -> tuple[tuple[int, int], ...]:
    if window < 1:
        raise InputError(f"window is {window}; at least one interval is needed.")
    if any(not 0 < at < count for at in breaks):
        raise InputError(f"breaks must be instants 1 … {count - 1}.")
    starts = [0, *sorted(set(breaks)), count]
    found = []
    for first, after in pairwise(starts):
        last = after - 1
        inner = list(range(first, last, window)) or [first]
        found += list(zip(inner, [*inner[1:], last]))
    return tuple(found)


def _boxed(points: Array, directions: int) -> tuple[Array, Array, Array]:
    """Centre and half edges of a box along principal directions, and what it leaves of points."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2][:directions]
    along = (points - middle) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    centre = middle + (low + high) / 2.0 @ axes
    return centre, ((high - low) / 2.0)[:, None] * axes, points - middle - along @ axes


def _windows(
    problem: MultiplierProblem,
    edges: tuple[tuple[int, int], ...],
    directions: int,
    *,
    breaks: Sequence[int],
    between: bool,
) -> _Windows:
    """Box every window along its principal directions."""
    count, m, n = problem.J.shape
    weight_J = 1.0 / max(float(np.abs(problem.J).max()), 1e-300)
    weight_M = 1.0 / max(float(np.abs(problem.M).max()), 1e-300)
    points = np.concatenate(
        [weight_J * problem.J.reshape(count, -1), weight_M * problem.M.reshape(count, -1)], axis=1
    )
    bend = np.zeros_like(points)
    if between:
        bend[1:-1] = (points[2:] - 2.0 * points[1:-1] + points[:-2]) / 8.0
        bend[list(breaks)] = bend[[at - 1 for at in breaks]] = 0.0
    corners, corner_window, rests, rest_window, bends = [], [], [], [], []
    boxes, box_window = [], []
    for k, (first, last) in enumerate(edges):
        centre, half, rest = _boxed(points[first : last + 1], directions)
        boxes += [centre, *half]
        box_window += [k] * (1 + len(half))
        for choice in product((-1.0, 1.0), repeat=len(half)):
            corners.append(centre + np.array(choice) @ half)
            corner_window.append(k)
        rests.append(rest)
        rest_window += [k] * len(rest)
        bends.append(bend[first : last + 1])

    def unpacked(rows: Array) -> MultiplierProblem:
        split = m * n
        return MultiplierProblem(
            J=rows[:, :split].reshape(-1, m, n) / weight_J,
            M=rows[:, split:].reshape(-1, n, m) / weight_M,
            blocks=problem.blocks,
        )

    return _Windows(
        edges=edges,
        boxes=unpacked(np.array(boxes)),
        box_window=np.array(box_window),
        corners=unpacked(np.array(corners)),
        corner_window=np.array(corner_window),
        rest=unpacked(np.concatenate(rests)),
        rest_window=np.array(rest_window),
        bend=unpacked(np.concatenate(bends)),
    )
