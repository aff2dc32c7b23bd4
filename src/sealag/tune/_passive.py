"""Gains for the passive bound: closed form and convex programs (docs/theory section 16)."""

from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import InputError
from sealag.tune._gains import Group, groups_of, parts_of, rounded, stiffened
from sealag.tune._limits import Limits, Wall, least_damping
from sealag.tune._question import Aim, Question, Share
from sealag.tune._room import Room, limits_text
from sealag.typing import Array
from sealag.units import time_text

EASE = 1e-6
"""Share of the delay that certified gains leave to rounding and to proofs, which are stated 1e-7
below the supremum. Ten times less, a gain at its limit has no certificate; ten times more costs
1e-5 of the gain."""
_AT_REST = 1e-9
"""Share of the mean drag that damping costs at joints that a motion does not move: it is not free,
so that the answer is one."""


class Knobs:
    """A design's stiffness as a sum of groups, and its limits for a delay."""

    def __init__(self, question: Question, system: System | None = None) -> None:
        """Evaluate the law along the motion.

        Args:
            question: what is asked.
            system: the design with the motor damping that it is to have; the question's if None.
        """
        system = system or question.system
        self.question = question
        self.system = system
        self.groups: tuple[Group, ...] = groups_of(system.law, system.robot, question.share)
        self.parts = parts_of(system, self.groups, question.motion)
        held = system.spaces(question.motion).F_gravity
        self._held = (held + np.swapaxes(held, -1, -2)) / 2.0

    def limits(self, delay: float) -> Limits:
        """Return what the groups' factors must stay below.

        Args:
            delay: to be tolerated, s.
        """
        drives = self.system.actuators
        series = self.system.law.signal.limits(
            drives.spring_stiffness, delay / drives.motor_damping
        )
        return Limits(parts=self.parts, held=self._held, series=series)

    def stiffest(self, delay: float) -> tuple[Array, Wall]:
        """Return the factors (G,) at their limit for a delay, and what stops them.

        Args:
            delay: to be tolerated, s.
        """
        limits = self.limits(delay)
        shape = np.ones(len(self.groups))
        if self.question.share is not Share.COMMON:
            shape = limits.balanced()
        wall = limits.wall(shape)
        return shape * min(wall.scale, 1.0 if wall.scale == np.inf else wall.scale), wall

    def design(self, factors: Array) -> System:
        """Return the design with other stiffness, in few digits.

        Args:
            factors: (G,) of the groups.
        """
        return rounded(stiffened(self.system, self.groups, factors))


def damped(question: Question, delay: float, room: Room) -> tuple[System, float] | str:
    """Return the design with the least motor damping for a delay, and what it costs.

    The cost is trace D_θ, or the energy Σ D_i ∫θ̇_i² dt that it takes along the motion, J.

    Args:
        question: what is asked.
        delay: to be tolerated, s.
        room: damping that may be chosen.

    Returns:
        Both; or why no damping of the room is enough.

    Raises:
        InputError: the motion moves no joint, whose drag is asked for.
        SolverError: the solver gives up.
    """
    system, motion = question.system, question.motion
    spaces = system.spaces(motion)
    # q̄(θ) needs springs that are stiffer than the tasks; motor angles do not.
    if not np.isfinite(spaces.F_theta).all() or system.law.signal.refusal(spaces.contraction):
        return "the tasks are stiffer than the springs; tune the stiffness first"
    F = (spaces.F_theta + np.swapaxes(spaces.F_theta, -1, -2)) / 2.0
    root = np.sqrt(room.most)
    width = float(np.abs(np.linalg.eigvalsh(F / np.multiply.outer(root, root))).max())
    if width * delay > 1.0:
        return (
            f"with the most damping that the limit {limits_text(question.limits)} leaves, the "
            f"gains tolerate {time_text(1.0 / width)}, and {time_text(delay)} are required"
        )
    cost = np.ones(system.robot.n)
    if question.aim is Aim.DRAG and motion is not None:
        rates = motion.v[:, system.robot.nv_base :]
        cost = np.trapezoid(rates**2, motion.time, axis=0)
        if not cost.any():
            raise InputError("The motion moves no joint, so that damping costs no drag.")
        cost = np.maximum(cost, _AT_REST * cost.mean())
    D = least_damping(delay * F, cost, room.least, room.most)
    drives = replace(system.actuators, motor_damping=D)
    return rounded(replace(system, actuators=drives), up=True), float(cost @ D)
