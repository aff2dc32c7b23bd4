"""Whether joints and contacts can hold a posture at all, asked before a run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError, SolverError
from sealag.robot import Robot
from sealag.simulation._ground import Foot, contact_frame
from sealag.typing import Array
from sealag.walking import Ground

_TOUCHING = 1e-4  # m
_FAR = 0.01  # m: further from the ground than a rounded posture leaves a foot
_EXACT = 1e-10  # m
_ROUNDS = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """A static distribution of contact forces and joint torques with the least relative torque.

    Attributes:
        torque: Joint torques (n,), Nm.
        force: Contact forces in the contact frames (P, 3), N; zero where a point is in the air.
        unbalance: Largest entry of what no contact force can balance at the base, N or Nm; a
            biped on point feet whose centre of mass is beside the feet has one.
        use: Largest |torque| / limit; above 1 the posture cannot be held.
    """

    torque: Array
    force: Array
    unbalance: float
    use: float


def static_hold(
    robot: Robot, q: Array, feet: Sequence[Foot], *, ground: Ground, torque_limit: Array
) -> Hold:
    """Find contact forces and torques that hold a posture against gravity.

    Two linear programs: the least unbalance of the base, then the least relative torque that
    attains it. Friction cones are replaced by inscribed pyramids: sufficient, not necessary.

    Args:
        robot: The robot.
        q: Configuration (nq,).
        feet: Feet; those within 0.1 mm of the ground carry load.
        ground: The terrain.
        torque_limit: Limits (n,), Nm; inf for none.

    Raises:
        InputError: The base floats and no foot touches the ground.
        SolverError: The linear program could not be solved.
    """
    J, mu, gap = _points(robot, q, feet, ground)
    touching = np.abs(gap) < _TOUCHING
    if robot.nv_base and not touching.any():
        raise InputError("no foot touches the ground; move the base down or give contacts")
    columns = int(touching.sum())
    G = J[touching].reshape(3 * columns, robot.nv)
    g, base = robot.gravity(q), robot.nv_base
    A, b = _cones(mu[touching])
    # Variables: contact forces, then the largest unbalance or the largest relative torque.
    weight = robot.weight
    balance = _chebyshev(G[:, :base].T, g[:base], np.full(base, weight), A, b, None)
    tied = (G[:, :base].T, g[:base], balance[-1] * weight + 1e-9 * weight)
    scale = np.where(np.isfinite(torque_limit), torque_limit, 1e6)
    best = _chebyshev(G[:, base:].T, g[base:], scale, A, b, tied)
    force = np.zeros((len(touching), 3))
    force[touching] = best[:-1].reshape(columns, 3)
    torque = g[base:] - G[:, base:].T @ best[:-1]
    limited = np.abs(torque) / torque_limit
    return Hold(
        torque=torque,
        force=force,
        unbalance=float(balance[-1] * weight),
        use=float(limited.max(initial=0.0)),
    )


def require_hold(
    robot: Robot, q: Array, feet: Sequence[Foot], *, ground: Ground, torque_limit: Array
) -> Hold:
    """Return the hold of a posture, or say which joint is too weak.

    Args:
        robot: The robot.
        q: Configuration (nq,).
        feet: Feet of the robot.
        ground: The terrain.
        torque_limit: Limits (n,), Nm; inf for none.

    Raises:
        InputError: No foot touches, or the torque limits cannot hold the robot.
    """
    hold = static_hold(robot, q, feet, ground=ground, torque_limit=torque_limit)
    if hold.use > 1.0 + 1e-6:
        worst = int(np.argmax(np.abs(hold.torque) / torque_limit))
        raise InputError(
            f"the torque limits cannot hold this posture: joint {robot.joints[worst]} needs at "
            f"least {abs(hold.torque[worst]):.3g} Nm and has {torque_limit[worst]:.3g} Nm"
        )
    return hold


def touching_posture(robot: Robot, q: Array, feet: Sequence[Foot], *, ground: Ground) -> Array:
    """Return the nearest posture in which every contact point touches the ground.

    The base is lowered until the first point touches; what gaps are left, as a posture of rounded
    joint angles has them, are closed by Newton steps of least norm in q.

    Args:
        robot: The robot.
        q: Configuration (nq,).
        feet: Its feet.
        ground: The terrain.

    Raises:
        InputError: A point is more than 10 mm from the ground when another one touches, or no
            posture nearby lets all of them touch.
    """
    q = q.copy()
    gap = _points(robot, q, feet, ground)[2]
    q[2] -= gap.min()
    gap = _points(robot, q, feet, ground)[2]
    if gap.max() > _FAR:
        names = [foot.contact.frame for foot in feet for _ in foot.offsets()]
        raise InputError(
            f"foot {names[gap.argmax()]} is {gap.max() * 1e3:.3g} mm above the ground when "
            f"{names[gap.argmin()]} touches it: correct the posture's joints, or leave out the "
            "contact that is in the air"
        )
    for _ in range(_ROUNDS):
        J, _, gap = _points(robot, q, feet, ground)
        if np.abs(gap).max() < _EXACT:
            return q
        q = robot.integrate(q, -np.linalg.lstsq(J[:, 2], gap, rcond=1e-9)[0])
    raise InputError(
        f"the feet {', '.join(foot.contact.frame for foot in feet)} cannot all touch the ground "
        "near this posture: correct its joints"
    )


def _points(
    robot: Robot, q: Array, feet: Sequence[Foot], ground: Ground
) -> tuple[Array, Array, Array]:
    """Contact-frame Jacobians (P, 3, nv), friction (P,) and gaps above the ground (P,), m."""
    rows, mu, gaps = [], [], []
    for foot in feet:
        R, p = robot.frame_placement(foot.contact.frame, q)
        J = robot.frame_jacobian(foot.contact.frame, q)
        for offset in foot.offsets():
            r = R @ offset
            x, y, z = (p + r).tolist()
            turn = np.array([[0, r[2], -r[1]], [-r[2], 0, r[0]], [r[1], -r[0], 0]])
            rows.append(contact_frame(ground, x, y) @ (J[:3] + turn @ J[3:]))
            mu.append(foot.friction)
            gaps.append(z - foot.radius - ground.height(x, y))
    count = len(rows)
    return (
        np.array(rows).reshape(count, 3, robot.nv),
        np.array(mu),
        np.array(gaps),
    )


def _cones(mu: Array) -> tuple[Array, Array]:
    """Rows A f <= b of all pyramids: no pulling, |f_1| + |f_2| <= mu f_n."""
    rows = []
    for i, friction in enumerate(mu):
        row = np.zeros((5, 3 * len(mu)))
        row[0, 3 * i + 2] = -1.0
        if np.isfinite(friction):
            for k, (a, b) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1)), start=1):
                row[k, 3 * i : 3 * i + 3] = a, b, -friction
        rows.append(row)
    A = np.concatenate(rows) if rows else np.zeros((0, 0))
    return A, np.zeros(len(A))


def _chebyshev(
    G: Array, g: Array, scale: Array, A: Array, b: Array, tied: tuple[Array, Array, float] | None
) -> Array:
    """Minimise max_i |g - G f|_i / scale_i over f in the cones; returns f and the maximum."""
    from scipy.optimize import linprog

    size = G.shape[1]
    above = np.hstack([-G, -scale[:, None]])
    below = np.hstack([G, -scale[:, None]])
    blocks = [np.hstack([A, np.zeros((len(A), 1))]), above, below]
    right = [b, -g, g]
    if tied is not None:
        H, h, slack = tied
        zero = np.zeros((len(H), 1))
        blocks += [np.hstack([H, zero]), np.hstack([-H, zero])]
        right += [h + slack, slack - h]
    cost = np.zeros(size + 1)
    cost[-1] = 1.0
    bounds = [(None, None)] * size + [(0, None)]
    answer = linprog(cost, A_ub=np.vstack(blocks), b_ub=np.concatenate(right), bounds=bounds)
    if not answer.success:
        raise SolverError(f"the static force distribution was not found: {answer.message}")
    return answer.x
