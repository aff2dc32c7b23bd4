"""How the settled command answers to configuration and angles, by implicit differentiation.

The law is taken at the configuration x = q ⊕ W(x) (s − q_j): the measured one, moved along the
motions W = overline(UN_s) there towards the fed-back angles s. Everything that it
computes depends on x alone. Its derivatives by x need one evaluation a direction, where differences
by q and s would settle x anew in each. With u = W (s − q_j), a = s − q_j, E = ∂(q ⊕ u)/∂q and
J = ∂(q ⊕ u)/∂u,

    (1 − J G) δx = E δq + J W (δs − δq_j) ,   G_k = ∂W/∂x_k a .
"""

from typing import NamedTuple

import numpy as np

from sealag.robot import Robot
from sealag.typing import Array
from sealag.whole_body._evaluation import LawEvaluation

ROUGH = 1e-6
"""rad, m: step of one-sided differences. Ten times larger leaves 1e-2 of the derivative where the
law bends within 1e-3 rad, ten times smaller 1e-5 by rounding of the settled command."""

_PLACED = 1e-3
"""rad, m: half the base of differences of the base's own placement, which nothing bends: both
truncation and rounding are below 1e-11."""


class Slopes(NamedTuple):
    """The settled law about a state at rest.

    Attributes:
        torque: (n, nv) ∂l/∂x.
        by_q: (nv, nv) ∂x/∂q.
        by_joints: (nv, n) ∂x/∂s of the fed-back angles s.
    """

    torque: Array
    by_q: Array
    by_joints: Array


def weights(width: float) -> list[tuple[float, float]]:
    """Return steps and weights of a derivative: central differences extrapolated to none,
    (4 D(h/2) − D(h)) / 3; one-sided ones of `ROUGH` where the width is 0.

    Args:
        width: half the base h.
    """
    if not width:
        return [(ROUGH, 1.0 / ROUGH), (0.0, -1.0 / ROUGH)]
    near, far = 4.0 / (3.0 * width), 1.0 / (6.0 * width)
    return [(width / 2.0, near), (-width / 2.0, -near), (width, -far), (-width, far)]


def slopes_of(law: LawEvaluation, q: Array, width: float) -> Slopes:
    """Differentiate a law where it has settled.

    Args:
        law: just evaluated, settled, at x.
        q: (nq,) the measured configuration that x was moved from.
        width: half the base of central differences, rad and m; 0 for one-sided ones.
    """
    robot, x = law.robot, law.configuration.copy()
    away = law.fed_back - robot.joint_positions(q)
    along, eye = law.space.joint_from_base.copy(), np.eye(robot.nv)
    torque, moved = np.zeros((robot.n, robot.nv)), np.zeros((robot.nv, robot.nv))
    here, out, carried = np.zeros(robot.n), np.zeros(robot.n), along @ away
    law.at(x, robot.joint_positions(x), here)
    for k, way in enumerate(eye):
        for h, weight in weights(width):
            if h:
                beside = robot.integrate(x, h * way)
                law.at(beside, robot.joint_positions(beside), out)
                moved[:, k] += weight * (law.space.joint_from_base @ away)
            else:
                out[:] = here
                moved[:, k] += weight * carried
            torque[:, k] += weight * out
    law.at(x, robot.joint_positions(x), out)  # where it stood
    turned, reached = _placed(robot, q, carried)
    select = eye[robot.nv_base :]
    inverse = np.linalg.inv(eye - reached @ moved)
    by_joints = inverse @ reached @ along
    return Slopes(torque, inverse @ turned - by_joints @ select, by_joints)


def _placed(robot: Robot, q: Array, u: Array) -> tuple[Array, Array]:
    """E and J (nv, nv) of q ⊕ u: the identity but for a base that moves."""
    turned, reached = np.eye(robot.nv), np.eye(robot.nv)
    if not (robot.nv_base and u[: robot.nv_base].any()):
        return turned, reached
    x = robot.integrate(q, u)
    for k in range(robot.nv_base):
        way = np.eye(robot.nv)[k]
        turned[:, k] = reached[:, k] = 0.0
        for h, weight in weights(_PLACED):
            before = robot.integrate(robot.integrate(q, h * way), u)
            turned[:, k] += weight * robot.difference(x, before)
            reached[:, k] += weight * robot.difference(x, robot.integrate(q, u + h * way))
    return turned, reached
