"""Gains for the passive bound: closed form and convex programs (docs/theory section 16)."""

from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import InputError
from sealag.tune._gains import Group, groups_of, parts_of, rounded, stiffened
from sealag.tune._limits import Limits, Wall, least_damping
from sealag.tune._question import Aim, Question, Share
from sealag.tune._write import base_damping
from sealag.typing import Array

EASE = 1e-6
"""Share of the delay that certified gains leave to rounding and to proofs, which are stated 1e-7
below the supremum. Ten times less, a gain at its limit has no certificate; ten times more costs
1e-5 of the gain."""
LEAST_DAMPING = 1e-6
"""Nms/rad: the smallest motor damping of a project file."""
_AT_REST = 1e-9
"""Share of the mean drag that damping costs at joints that a motion does not move: it is not free,
so that the answer is one."""


class Knobs:
    """A design's stiffness as a sum of groups, and its limits for a delay."""

    def __init__(self, question: Question) -> None:
        """Evaluate the law along the motion.

        Args:
            question: what is asked.
        """
        system = question.system
        self.question = question
        self.groups: tuple[Group, ...] = groups_of(system.law, system.robot, question.share)
        self._parts = parts_of(system, self.groups, question.motion)
        held = system.spaces(question.motion).F_gravity
        self._held = (held + np.swapaxes(held, -1, -2)) / 2.0

    def limits(self, delay: float, damping: Array | None = None) -> Limits:
        """Return what the groups' factors must stay below.

        Args:
            delay: to be tolerated, s.
            damping: (n,) D_θ, Nms/rad; the design's own if None.
        """
        system = self.question.system
        drives = system.actuators
        D = drives.motor_damping if damping is None else damping
        series = system.law.signal.limits(drives.spring_stiffness, delay / D)
        return Limits(parts=self._parts, held=self._held, series=series)

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
        return rounded(stiffened(self.question.system, self.groups, factors))


def least_of(system: System) -> Array:
    """Return the smallest motor damping that can be set, (n,) Nms/rad.

    Args:
        system: a design; under joint PD its motors keep their own.
    """
    return np.maximum(base_damping(system), LEAST_DAMPING)


def damped(question: Question, delay: float) -> tuple[System, float] | None:
    """Return the design with the least motor damping for a delay, and what it costs.

    The cost is trace D_θ, or the energy Σ D_i ∫θ̇_i² dt that it takes along the motion, J.

    Args:
        question: what is asked.
        delay: to be tolerated, s.

    Returns:
        Both; None where the tasks are stiffer than the springs, which no damping mends.

    Raises:
        InputError: the motion moves no joint, whose drag is asked for.
        SolverError: the solver gives up.
    """
    system, motion = question.system, question.motion
    spaces = system.spaces(motion)
    if not (np.isfinite(spaces.F_theta).all() and (spaces.contraction < 1.0).all()):
        return None
    F = (spaces.F_theta + np.swapaxes(spaces.F_theta, -1, -2)) / 2.0
    cost = np.ones(system.robot.n)
    if question.aim is Aim.DRAG and motion is not None:
        rates = motion.v[:, system.robot.nv_base :]
        cost = np.trapezoid(rates**2, motion.time, axis=0)
        if not cost.any():
            raise InputError("The motion moves no joint, so that damping costs no drag.")
        cost = np.maximum(cost, _AT_REST * cost.mean())
    D = least_damping(delay * F, cost, least_of(system))
    drives = replace(system.actuators, motor_damping=D)
    return rounded(replace(system, actuators=drives), up=True), float(cost @ D)
