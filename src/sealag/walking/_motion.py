"""Whole-body inverse kinematics: a plan becomes a motion of the robot."""

import numpy as np

from sealag.errors import RobotError
from sealag.robot import Contact, Motion, Robot, Workspace
from sealag.typing import Array
from sealag.walking._planner import WalkPlan


def walk_motion(
    robot: Robot,
    plan: WalkPlan,
    *,
    rate: float = 1000.0,
    clearance: float = 0.06,
    feet: tuple[str, str] = ("left_foot", "right_foot"),
    base_frame: str = "torso",
) -> Motion:
    """Turn a plan into a motion of a biped with three actuated joints a leg.

    At each instant the stance foot stands on its foothold, the swing foot and the centre of mass
    follow the plan and the base stays upright: 12 equations for 6 + 6 unknowns, solved by
    Newton's method; velocities by the same Jacobian.

    Args:
        robot: a floating-base biped.
        plan: the walk.
        rate: instants per second.
        clearance: of the swing foot, m.
        feet: frames of the left and the right foot.
        base_frame: the frame that stays upright.

    Returns:
        The motion; its contact sets are the stance foot alone.

    Raises:
        RobotError: a foothold is out of reach or a joint limit would be passed; the message names
            step and instant.
    """
    times = np.arange(int(plan.duration * rate) + 1) / rate
    at = robot.workspace()
    rest = np.zeros(robot.nv)
    q = _first_guess(robot, plan)
    qs, vs = np.zeros((len(times), robot.nq)), np.zeros((len(times), robot.nv))
    index = np.zeros(len(times), dtype=np.int64)
    for i, t in enumerate(times):
        k = plan.index(t)
        side = plan.stances[k].side
        stance, swing = feet[side], feet[side.other]
        com, com_rate = plan.com(t)
        foot, foot_rate = plan.swing(t, clearance=clearance)
        targets = (com, plan.stances[k].foot, foot)
        for _ in range(60):
            at.update(q, rest)
            error = _error(at, targets, stance, swing=swing, base=base_frame)
            if np.abs(error).max() < 1e-10:
                break
            J = _jacobian(at, stance, swing, base=base_frame)
            step = np.linalg.lstsq(J, error, rcond=1e-8)[0]
            q = robot.integrate(q, step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12)))
        else:
            _refuse(plan, k, t, "is out of the legs' reach")
        _check_limits(robot, q, plan, k, t=t)
        J = _jacobian(at, stance, swing, base=base_frame)
        rates = np.concatenate([com_rate, np.zeros(3), foot_rate, np.zeros(3)])
        qs[i], vs[i] = q, np.linalg.solve(J, rates)
        index[i] = side
    return Motion(
        time=times,
        q=qs,
        v=vs,
        contact_sets=tuple((Contact(frame=frame),) for frame in feet),
        contact_index=index,
    )


def _first_guess(robot: Robot, plan: WalkPlan) -> Array:
    bent = {
        name: 0.9 if "knee" in name else (-0.45 if "hip" in name else 0.0) for name in robot.joints
    }
    com, _ = plan.com(0.0)
    q = robot.configuration(bent, base_position=com)
    return robot.configuration(bent, base_position=2.0 * com - robot.center_of_mass(q))


def _error(
    at: Workspace, targets: tuple[Array, Array, Array], stance: str, *, swing: str, base: str
) -> Array:
    com, stand, foot = targets
    R, _ = at.frame_placement(base)
    turn = 0.5 * np.array([R[1, 2] - R[2, 1], R[2, 0] - R[0, 2], R[0, 1] - R[1, 0]])
    return np.concatenate(
        [
            com - at.com,
            stand - at.frame_placement(stance)[1],
            foot - at.frame_placement(swing)[1],
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


def _check_limits(robot: Robot, q: Array, plan: WalkPlan, k: int, *, t: float) -> None:
    joints = robot.joint_positions(q)
    low = joints < robot.position_lower
    high = joints > robot.position_upper
    knee = np.array(["knee" in name for name in robot.joints]) & (joints < 0.0)
    bad = low | high | knee
    if bad.any():
        j = int(bad.argmax())
        _refuse(plan, k, t, f"needs {robot.joints[j]} at {joints[j]:.2f} rad, past its limit")


def _refuse(plan: WalkPlan, k: int, t: float, why: str) -> None:
    raise RobotError(
        f"The walk cannot be done: at {t:.3f} s (stance {k + 1} of {len(plan.stances)}) it {why}; "
        "lower the CoM height, shorten the steps or smooth the terrain."
    )
