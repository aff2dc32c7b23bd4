"""Whole-body inverse kinematics: what a plan asks for becomes a motion of the robot."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sealag.errors import RobotError
from sealag.robot import Contact, Motion, Robot, Workspace
from sealag.typing import Array
from sealag.walking._feet import Side


class Targets(NamedTuple):
    """What a plan asks for at one instant: positions and velocities (3,), m and m/s.

    Attributes:
        stance: number of the support phase.
        side: which foot stands.
        stand: where it stands.
        com: the centre of mass.
        com_rate: its velocity.
        swing: the other foot.
        swing_rate: its velocity.
    """

    stance: int
    side: Side
    stand: Array
    com: Array
    com_rate: Array
    swing: Array
    swing_rate: Array


def follow(
    robot: Robot,
    time: Array,
    targets: Sequence[Targets],
    *,
    stances: int,
    feet: tuple[str, str],
    base_frame: str,
) -> Motion:
    """Return the motion of a biped with three actuated joints a leg that reaches all targets.

    12 equations for 6 + 6 unknowns at each instant, solved by Newton's method from the instant
    before; velocities by the same Jacobian.

    Args:
        robot: a floating-base biped.
        time: (N,) s.
        targets: of each instant.
        stances: number of support phases.
        feet: frames of the left and the right foot.
        base_frame: the frame that stays upright.

    Raises:
        RobotError: a foothold is out of reach or a joint limit would be passed; the message names
            step and instant.
    """
    at = robot.workspace()
    rest = np.zeros(robot.nv)
    q = _first_guess(robot, targets[0].com)
    qs, vs = np.zeros((len(time), robot.nq)), np.zeros((len(time), robot.nv))
    index = np.zeros(len(time), dtype=np.int64)
    for i, (t, goal) in enumerate(zip(time, targets, strict=True)):
        stance, swing = feet[goal.side], feet[goal.side.other]
        where = f"at {t:.3f} s (stance {goal.stance + 1} of {stances})"
        for _ in range(60):
            at.update(q, rest)
            error = _error(at, goal, stance, swing=swing, base=base_frame)
            if np.abs(error).max() < 1e-10:
                break
            J = _jacobian(at, stance, swing, base=base_frame)
            step = np.linalg.lstsq(J, error, rcond=1e-8)[0]
            q = robot.integrate(q, step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12)))
        else:
            _refuse(where, "is out of the legs' reach")
        _check_limits(robot, q, where)
        J = _jacobian(at, stance, swing, base=base_frame)
        rates = np.concatenate([goal.com_rate, np.zeros(3), goal.swing_rate, np.zeros(3)])
        qs[i], vs[i] = q, np.linalg.solve(J, rates)
        index[i] = goal.side
    return Motion(
        time=time,
        q=qs,
        v=vs,
        contact_sets=tuple((Contact(frame=frame),) for frame in feet),
        contact_index=index,
    )


def _first_guess(robot: Robot, com: Array) -> Array:
    bent = {
        name: 0.9 if "knee" in name else (-0.45 if "hip" in name else 0.0) for name in robot.joints
    }
    q = robot.configuration(bent, base_position=com)
    return robot.configuration(bent, base_position=2.0 * com - robot.center_of_mass(q))


def _error(at: Workspace, goal: Targets, stance: str, *, swing: str, base: str) -> Array:
    R, _ = at.frame_placement(base)
    turn = 0.5 * np.array([R[1, 2] - R[2, 1], R[2, 0] - R[0, 2], R[0, 1] - R[1, 0]])
    return np.concatenate(
        [
            goal.com - at.com,
            goal.stand - at.frame_placement(stance)[1],
            goal.swing - at.frame_placement(swing)[1],
            turn,
        ]
    )


def _jacobian(at: Workspace, stance: str, swing: str, *, base: str) -> Array:
    return np.vstack(
        [
            at.com_jacobian(),
            at.frame_jacobian(stance)[:3],
            at.frame_jacobian(swing)[:3],
            at.frame_jacobian(base)[3:],
        ]
    )


def _check_limits(robot: Robot, q: Array, where: str) -> None:
    joints = robot.joint_positions(q)
    low = joints < robot.position_lower
    high = joints > robot.position_upper
    knee = np.array(["knee" in name for name in robot.joints]) & (joints < 0.0)
    bad = low | high | knee
    if bad.any():
        j = int(bad.argmax())
        _refuse(where, f"needs {robot.joints[j]} at {joints[j]:.2f} rad, past its limit")


def _refuse(where: str, why: str) -> None:
    raise RobotError(
        f"The walk cannot be done: {where} it {why}; lower the CoM height, shorten the steps or "
        "smooth the terrain."
    )
