"""The state in which a walk begins: the apex over the first foot."""

import math

import numpy as np

from sealag.errors import InputError
from sealag.robot import Robot, Workspace
from sealag.typing import Array
from sealag.walking._feet import Side
from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground

_SWING_SPEED = 1.6  # mid-swing speed of the foot in mean speeds of its swing


def walking_start(
    robot: Robot,
    *,
    feet: tuple[str, str],
    ground: Ground,
    gait: WalkingGait,
    stance: Side = Side.RIGHT,
) -> tuple[Array, Array]:
    """Return configuration (nq,) and velocity (nv,) at the apex of a gait.

    The CoM is at x = 0 over the stance foot with the plan's speed, the torso upright and without
    angular velocity but for a yaw rate that makes the vertical angular momentum 0.

    Args:
        robot: Biped with a floating base and six joints.
        feet: Frames of the left and the right foot.
        ground: Where they stand.
        gait: The gait.
        stance: Foot stood on.

    Raises:
        InputError: The legs cannot take this posture.
    """
    plan, side = gait.periodic(), stance.other.lateral
    place = np.array([0.0, -side * plan.apex_outward])
    level = ground.height(*place)
    stand = np.array([*place, level + gait.foot_radius])
    swing = stand + np.array([0.0, side * gait.step_width, gait.clearance])
    com = np.array([0.0, 0.0, level + gait.com_height])
    targets = (com, (stand, swing) if stance is Side.LEFT else (swing, stand))
    at = robot.workspace()
    q = _posture(robot, at, feet, targets=targets)
    at.update(q, np.zeros(robot.nv))
    rows = np.vstack(
        [
            at.frame_jacobian(feet[stance])[:3].copy(),
            at.com_jacobian().copy(),
            np.eye(robot.nv)[3:6],
            at.frame_jacobian(feet[stance.other])[:3].copy(),
        ]
    )
    rows[8] = at.centroidal_map()[5]
    rates = np.zeros(robot.nv)
    rates[3] = gait.apex_speed
    duration = gait.step_time - gait.transfer_time
    rates[9] = _SWING_SPEED * 2.0 * plan.step_length / duration
    return q, np.linalg.solve(rows, rates)


def _posture(
    robot: Robot, at: Workspace, feet: tuple[str, str], *, targets: tuple[Array, tuple[Array, ...]]
) -> Array:
    """Solve for joints and base position with an upright base, by Newton's method."""
    com, places = targets
    joints = np.array([_bent(name) for name in robot.joints])
    q = robot.configuration(joints, base_position=com)
    still = np.zeros(robot.nv)
    for _ in range(100):
        at.update(q, still)
        error = np.concatenate(
            [com - at.com, *(p - at.frame_placement(f)[1] for p, f in zip(places, feet))]
        )
        if float(np.abs(error).max()) < 1e-10:
            return q
        rows = np.vstack([at.com_jacobian(), *(at.frame_jacobian(f)[:3] for f in feet)])
        keep = np.r_[0:3, 6 : robot.nv]
        move = np.zeros(robot.nv)
        move[keep] = np.linalg.lstsq(rows[:, keep], error, rcond=1e-6)[0]
        q = robot.integrate(q, move * min(1.0, 0.5 / max(float(np.abs(move).max()), 1e-9)))
    raise InputError(
        f"{robot.name} cannot stand with its CoM {com[2]:.3f} m high and the feet "
        f"{abs(places[0][1] - places[1][1]):.3f} m apart: lower the gait's com_height"
    )


def _bent(joint: str) -> float:
    return math.radians(55.0 if "knee" in joint else (-25.0 if "hip" in joint else 0.0))
