"""Friction kernels: contact forces of closed points, and which points are closed.

A point's forces and impulses are given in its contact frame, whose rows are tangent, tangent,
normal. A closed point has no normal acceleration (but for the return to where it closed) and
Coulomb friction in the form

    w = v_t + T a_t,   |f_t| <= mu f_n,   w = 0 or f_t = -mu f_n w / |w|,

so that a point sticks whenever friction can stop it within the time T, and slides against the
velocity that it is about to have. The law is continuous; T is the step, and 0 is Coulomb's law.
"""

import math
from typing import NamedTuple

import numpy as np

from sealag.kernels._jit import inner
from sealag.kernels.linalg import (
    backward_solve,
    cholesky,
    copy,
    eliminate,
    forward_solve,
    substitute,
)
from sealag.typing import Array, IntArray

SETTLED, INCONSISTENT, UNSOLVABLE = 0, 1, 2  # how `settle` ends
_CONE = 1e-10
"""Relative accuracy of the friction cone. Ten times larger shows in the audit's sliding work; ten
times smaller is lost in the rounding of forces."""
_TORSION = 1e-10  # Nm: changes of torsional torque that count as none
_ITERATIONS = 200
_TOGETHER = 6
"""Iterations in which all sliding points move together; three mostly suffice. Twice as many only
delay the search point by point, which ends where this one does not."""
_PIVOT = 1e-6  # of a point's own rate: below it, points cannot be told apart and move one by one
_STALE = 1e-4  # relative width of a bracket that has lost its root to another point's change
_SINKING = 1e3  # times the compliance: how fast a sole's point may sink beside the others


class Surfaces(NamedTuple):
    """Friction of P contact points on F feet."""

    foot: IntArray  # (≥ P,) number of the point's foot
    friction: Array  # (P,) Coulomb coefficient
    ridge: Array  # (P,) relative compliance that shares force between redundant points
    torsion_damping: Array  # (F,) torque about the normal per rate, Nms/rad
    torsion_radius: Array  # (F,) largest such torque per normal force, m


class Equations(NamedTuple):
    """Contact equations of P points at one instant, and memory to solve them."""

    L: Array  # (nv, nv) Cholesky factor of the mass matrix
    rows: Array  # (P, 3, nv) L⁻¹ (C J)ᵀ of the points
    target: Array  # (P, 3) what the equations ask for besides J v̇
    free: Array  # (nv,) L⁻¹ times the forces without contacts
    twist_rows: Array  # (F, nv) L⁻¹ Jᵀ of each foot's turn about its normal
    spin: Array  # (F,) rate of that turn, rad/s
    torque: Array  # (F,) friction torque against it, Nm
    point: IntArray  # (3 P,) whose equation a row of G is
    axis: IntArray  # (3 P,) and of which axis of its contact frame
    G: Array  # (3 P, 3 P) compliance of the closed points
    H: Array  # (3 P, 3 P) the same with what slides yielding
    factor: Array  # (3 P, 3 P) of H
    right: Array  # (3 P,)
    f: Array  # (3 P,) forces of the closed points
    slope: Array  # (3 P,) their derivative by a point's yielding
    low: Array  # (P,) bracket of each point's yielding
    high: Array  # (P,)
    sliding: IntArray  # (P,) normal rows of the points that slide
    rate: Array  # (P, P) what the yielding of each does to the cone of each
    own: Array  # (P,) its diagonal
    change: Array  # (P,) of their yielding


def allocate_equations(nv: int, points: int, feet: int) -> Equations:
    """Return memory for the contact equations of points on feet."""
    size = 3 * points
    return Equations(
        L=np.zeros((nv, nv)), rows=np.zeros((points, 3, nv)), target=np.zeros((points, 3)),
        free=np.zeros(nv), twist_rows=np.zeros((feet, nv)), spin=np.zeros(feet),
        torque=np.zeros(feet), point=np.zeros(size, np.int64), axis=np.zeros(size, np.int64),
        G=np.zeros((size, size)), H=np.zeros((size, size)), factor=np.zeros((size, size)),
        right=np.zeros(size), f=np.zeros(size), slope=np.zeros(size), low=np.zeros(points),
        high=np.zeros(points), sliding=np.zeros(points, np.int64),
        rate=np.zeros((points, points)), own=np.zeros(points), change=np.zeros(points),
    )  # fmt: skip


@inner
def _assemble(eq, x, closed, surfaces):
    """Write the contact equations G f = right of all closed points; return their number of rows."""
    size = 0
    for i in range(closed.size):
        if closed[i]:
            for a in range(0 if surfaces.friction[i] > 0.0 else 2, 3):
                eq.point[size], eq.axis[size] = i, a
                size += 1
    largest = 0.0
    for r in range(size):
        row = eq.rows[eq.point[r], eq.axis[r]]
        s = eq.target[eq.point[r], eq.axis[r]]
        for c in range(x.size):
            s += row[c] * x[c]
        eq.right[r] = -s
        for k in range(r + 1):
            other = eq.rows[eq.point[k], eq.axis[k]]
            s = 0.0
            for c in range(x.size):
                s += row[c] * other[c]
            eq.G[r, k] = s
            eq.G[k, r] = s
        largest = max(largest, eq.G[r, r])
    for r in range(size):
        eq.G[r, r] += surfaces.ridge[eq.point[r]] * largest
    return size


@inner
def _friction(eq, size, mu, yielding):
    """Solve (G + diag(yielding)) f = right with yielding >= 0 such that every cone holds.

    ``yielding`` (P,) is -w / f_t of a sliding point over T, 0 of a sticking one. Newton on
    mu f_n / |f_t| = 1, which is nearly affine in it (as in trust regions), for all points together,
    then for each one within a bracket.
    """
    f = eq.f[:size]
    low, high = eq.low, eq.high
    low[:], high[:] = 0.0, np.inf
    for turn in range(_ITERATIONS):
        for r in range(size):
            for k in range(size):
                eq.H[r, k] = eq.G[r, k]
            if eq.axis[r] < 2:
                eq.H[r, r] += yielding[eq.point[r]]
            f[r] = eq.right[r]
        if not cholesky(eq.H[:size, :size], eq.factor):
            return False
        forward_solve(eq.factor, f)
        backward_solve(eq.factor, f)
        settled, count = True, 0
        for r in range(2, size):
            i = eq.point[r]
            if eq.axis[r] != 2 or mu[i] == 0.0 or mu[i] == np.inf:
                continue
            excess = math.hypot(f[r - 2], f[r - 1]) - mu[i] * f[r]
            if excess > 0.0 or yielding[i] > 0.0:
                eq.sliding[count] = r
                count += 1
                settled = settled and abs(excess) <= _CONE * abs(mu[i] * f[r])
        if settled:
            break
        if turn < _TOGETHER and _move_together(eq, f, mu, yielding, eq.sliding[:count]):
            continue
        for k in range(count):
            r = eq.sliding[k]
            i = eq.point[r]
            excess = math.hypot(f[r - 2], f[r - 1]) - mu[i] * f[r]
            if abs(excess) <= _CONE * abs(mu[i] * f[r]):
                continue
            if excess > 0.0:
                low[i] = yielding[i]
            else:
                high[i] = yielding[i]
            guess = np.inf
            if _has_slope(f, r):
                _yield_by(eq, f, r)
                rate = _cone_rate(eq, f, r, mu[i])
                if rate > 0.0:
                    guess = yielding[i] + _cone_gap(f, r, mu[i]) / rate
            if low[i] == 0.0 and guess < 0.0:
                guess = 0.0
            yielding[i] = _inside(guess, low[i], high[i], eq.G[r, r])
            if high[i] - low[i] <= _STALE * high[i]:  # moved by the other points: begin again
                low[i], high[i] = 0.0, np.inf
    return True


@inner
def _yield_by(eq, f, r):
    """Write the derivative of all forces by the yielding of the point whose normal row is r."""
    slope = eq.slope[: f.size]
    slope[:] = 0.0
    slope[r - 2], slope[r - 1] = -f[r - 2], -f[r - 1]
    forward_solve(eq.factor, slope)
    backward_solve(eq.factor, slope)


@inner
def _has_slope(f, r):
    """Whether mu f_n / |f_t| has a derivative: the point at normal row r pushes and drags."""
    return f[r] > 0.0 and (f[r - 2] != 0.0 or f[r - 1] != 0.0)


@inner
def _cone_gap(f, r, mu):
    """Return 1 - mu f_n / |f_t| of the point whose normal row is r."""
    return 1.0 - mu * f[r] / math.hypot(f[r - 2], f[r - 1])


@inner
def _cone_rate(eq, f, r, mu):
    """Return the derivative of mu f_n / |f_t| at normal row r, where forces change by ``slope``."""
    slope, tangent = eq.slope, math.hypot(f[r - 2], f[r - 1])
    along = (f[r - 2] * slope[r - 2] + f[r - 1] * slope[r - 1]) / tangent
    return (mu * slope[r] - mu * f[r] / tangent * along) / tangent


@inner
def _move_together(eq, f, mu, yielding, rows):
    """Do a Newton step on the yielding of all sliding points; False if there is none to trust.

    Args:
        eq: the equations, factored.
        f: forces of the closed points.
        mu: (P,) friction.
        yielding: (P,) moved, to 0 where a point would begin to stick.
        rows: (k,) normal rows of the sliding points.
    """
    count = rows.size
    for r in rows:
        if not _has_slope(f, r):
            return False
    for j in range(count):
        _yield_by(eq, f, rows[j])
        for i in range(count):
            eq.rate[i, j] = _cone_rate(eq, f, rows[i], mu[eq.point[rows[i]]])
        eq.own[j] = eq.rate[j, j]
        eq.change[j] = _cone_gap(f, rows[j], mu[eq.point[rows[j]]])
        if not eq.own[j] > 0.0:
            return False
    if not eliminate(eq.rate[:count, :count], _PIVOT, eq.own[:count]):
        return False
    substitute(eq.rate[:count, :count], eq.change[:count])
    for j in range(count):
        if not abs(eq.change[j]) < np.inf:
            return False
    for j in range(count):
        i = eq.point[rows[j]]
        yielding[i] = max(0.0, yielding[i] + eq.change[j])
    return True


@inner
def _inside(guess, low, high, scale):
    """Keep an iterate inside its bracket, else divide the bracket geometrically."""
    if low < guess < high or (guess == 0.0 and low == 0.0):
        return guess
    if high == np.inf:
        return 4.0 * low + scale
    return math.sqrt(max(low, 1e-12 * high) * high)


@inner
def _twist(eq, force, closed, surfaces):
    """Write -clip(damping spin) within the radius times the normal load; return the change."""
    change = 0.0
    for f in range(eq.spin.size):
        load = 0.0
        for i in range(closed.size):
            if surfaces.foot[i] == f and closed[i] and force[i, 2] > 0.0:
                load += force[i, 2]
        limit = surfaces.torsion_radius[f] * load if load > 0.0 else 0.0
        new = -min(max(surfaces.torsion_damping[f] * eq.spin[f], -limit), limit)
        change = max(change, abs(new - eq.torque[f]))
        eq.torque[f] = new
    return change


@inner
def solve(eq, surfaces, closed, yielding, x, force):
    """Meet the contact conditions of the closed points.

    Args:
        eq: the equations at the instant.
        surfaces: friction of the points.
        closed: (P,) whether each is closed.
        yielding: (P,) a first guess, improved.
        x: (nv,) accelerations, or velocities of an impact; written.
        force: (P, 3) forces, or impulses; read as a first guess of the load on torsion, written.

    Returns:
        False if there is no solution.
    """
    eq.torque[:] = 0.0
    _twist(eq, force, closed, surfaces)
    for _ in range(_ITERATIONS):
        copy(eq.free, x)
        for k in range(eq.spin.size):
            if eq.torque[k] != 0.0:
                for c in range(x.size):
                    x[c] += eq.twist_rows[k, c] * eq.torque[k]
        size = _assemble(eq, x, closed, surfaces)
        force[:] = 0.0
        if size > 0 and not _friction(eq, size, surfaces.friction, yielding):
            return False
        for r in range(size):
            i, a = eq.point[r], eq.axis[r]
            force[i, a] = eq.f[r]
            for c in range(x.size):
                x[c] += eq.rows[i, a, c] * eq.f[r]
        if _twist(eq, force, closed, surfaces) < _TORSION:
            break
    backward_solve(eq.L, x)
    return True


@inner
def settle(eq, surfaces, touching, closed, yielding, tolerance, x, force):
    """Find which touching points are closed, so that none pulls and none sinks in.

    Works on accelerations and forces, or on velocities and impulses (plastic impact, without
    torsion). Starts from ``closed`` and changes the worst point until nothing is violated.

    Args:
        eq: the equations of all touching points.
        surfaces: friction of the points.
        touching: (P,) which may be closed.
        closed: (P,) which are, changed.
        yielding: (P,) a first guess, improved.
        tolerance: pull that is allowed, N or Ns.
        x: (nv,) as in `solve`, written.
        force: (P, 3) as in `solve`, written.

    Returns:
        SETTLED, INCONSISTENT if no set of points was found, UNSOLVABLE.
    """
    count = closed.size
    for _ in range(8 * count + 8):
        if not solve(eq, surfaces, closed, yielding, x, force):
            return UNSOLVABLE
        worst, which = tolerance, -1
        for i in range(count):
            if touching[i] == 0:
                continue
            if closed[i]:
                bad = -force[i, 2]
            else:  # points of one sole may sink as little as they yield
                bad = -eq.target[i, 2] - _along(eq, i, x) - _SINKING * surfaces.ridge[i]
            if bad > worst:
                worst, which = bad, i
        if which < 0:
            return SETTLED
        closed[which] = 1 - closed[which]
        yielding[which] = 0.0
    return INCONSISTENT


@inner
def _along(eq, i, x):
    """Normal component of J x, from rows = L⁻¹ (C J)ᵀ: (Lᵀ x) · rows."""
    s = 0.0
    for c in range(x.size):
        lx = 0.0
        for k in range(c, x.size):
            lx += eq.L[k, c] * x[k]
        s += lx * eq.rows[i, 2, c]
    return s
