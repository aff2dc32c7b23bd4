"""Which configurations a robot can take."""

import math

import numpy as np

from sealag.errors import InputError
from sealag.robot._robot import Robot
from sealag.typing import ArrayLike

UNIT_TOLERANCE = 1e-3
"""How far the length of a base quaternion may be from 1: what rounding to a few digits does."""

_ROUNDING = 1e-3  # rad, m: how far a position with a few digits may lie outside its limits
_MOST_ANGLE = 4.0 * math.pi  # rad, of a joint without limits
_MOST_LENGTH = 1e3  # m, of a sliding joint without limits
_FARTHEST = 1e4  # m, of the base from the origin


def require_within_limits(robot: Robot, q: ArrayLike) -> None:
    """Refuse configurations outside the URDF's position limits, or far outside any range.

    A revolute joint without limits may turn by 4π either way, a sliding one move by 1 km.

    Args:
        robot: whose limits.
        q: (nq,) or (N, nq) rad and m.

    Raises:
        InputError: a position lies outside; the message names joint, row, value and limits.
    """
    rows = np.atleast_2d(np.asarray(q, dtype=float))
    most = np.where(robot.sliding, _MOST_LENGTH, _MOST_ANGLE)
    lower = np.where(np.isinf(robot.position_lower), -most, robot.position_lower)
    upper = np.where(np.isinf(robot.position_upper), most, robot.position_upper)
    joints = robot.joint_positions(rows)
    bad = (joints < lower - _ROUNDING) | (joints > upper + _ROUNDING)
    if bad.any():
        row, k = np.argwhere(bad)[0]
        value, unit = float(joints[row, k]), "m" if robot.sliding[k] else "rad"
        where = f" in row {row + 1}" if np.ndim(q) == 2 else ""
        angle = math.radians(value)
        fits = unit == "rad" and lower[k] <= angle <= upper[k]
        hint = f"; were {value:g} degrees meant? Then write {angle:.4g}" if fits else ""
        raise InputError(
            f"{robot.joints[k]} is {value:g} {unit}{where}, outside its limits {lower[k]:.4g} … "
            f"{upper[k]:.4g} {unit}{hint}."
        )
    if robot.floating_base and (np.abs(rows[:, :3]) > _FARTHEST).any():
        row, k = np.argwhere(np.abs(rows[:, :3]) > _FARTHEST)[0]
        raise InputError(
            f"base_{'xyz'[k]} is {rows[row, k]:g} m in row {row + 1}; the base is within "
            f"{_FARTHEST:g} m of the origin."
        )
