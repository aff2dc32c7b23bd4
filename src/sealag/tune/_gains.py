"""Gains as a design holds them: groups with a factor each, and the design with other gains."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_FLOOR, Context

import numpy as np

from sealag.design import System
from sealag.errors import InputError
from sealag.robot import Motion, Robot
from sealag.tune._question import Share
from sealag.typing import Array
from sealag.whole_body import GravityCompensation, Law

DIGITS = 7
"""Digits of a gain that is written. Fewer give away more than 1e-6 of a stiffness."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Gains with one factor.

    Attributes:
        name: what answers call it.
        rows: for each task, in the law's order, which of its rows belong to it.
    """

    name: str
    rows: tuple[Array, ...]


def groups_of(law: Law, robot: Robot, share: Share) -> tuple[Group, ...]:
    """Return the groups of a law's gains that are not 0.

    Args:
        law: the law.
        robot: its robot.
        share: what has a factor of its own.

    Raises:
        InputError: all gains are 0.
    """
    sizes = [len(task.rows(robot).rows) for task in law.tasks]
    alive = [np.diag(task.gain(size)) > 0.0 for task, size in zip(law.tasks, sizes)]
    none = [np.zeros(size, dtype=bool) for size in sizes]
    groups = []
    if share is Share.COMMON:
        groups = [Group(name="all", rows=tuple(alive))]
    else:
        for i, task in enumerate(law.tasks):
            chosen = [alive[i]]
            names = [task.name]
            if share is Share.DIRECTION:
                chosen = list(np.eye(sizes[i], dtype=bool) & alive[i])
                names = [f"{task.name} {label}" for label in _labels(law, robot, i)]
            for name, rows in zip(names, chosen):
                groups.append(Group(name=name, rows=(*none[:i], rows, *none[i + 1 :])))
    groups = [group for group in groups if any(rows.any() for rows in group.rows)]
    if not groups:
        raise InputError("All stiffness gains are 0, and a factor changes nothing; give some.")
    return tuple(groups)


def _labels(law: Law, robot: Robot, index: int) -> list[str]:
    """What the rows of a task are called."""
    rows = law.tasks[index].rows(robot)
    if rows.of_joints:
        return [robot.joints[row] for row in rows.rows]
    names = ("x", "y", "z", "rx", "ry", "rz")
    return [names[row] for row in rows.rows]


def stiffened(system: System, groups: Sequence[Group], factors: Array) -> System:
    """Return a design whose gains are those of the groups times their factors, others 0.

    Args:
        system: the design.
        groups: its groups.
        factors: (G,) of each.

    Raises:
        InputError: directions of a full matrix of gains have different factors.
    """
    tasks = []
    for i, task in enumerate(system.law.tasks):
        scale = np.sum([f * group.rows[i] for f, group in zip(factors, groups)], axis=0)
        gains = np.asarray(task.stiffness, dtype=float)
        if gains.ndim == 0 and np.ptp(scale) == 0.0:
            gains = gains * scale[0]
        elif gains.ndim < 2:
            gains = gains * scale
        else:
            scale = scale[np.diag(gains) > 0.0]  # the other rows are 0
            if np.ptp(scale) > 0.0:
                raise InputError(
                    f"Task {task.name} has a full matrix of gains, which has no directions of its "
                    "own; share a factor by task."
                )
            gains = gains * scale[0]
        tasks.append(replace(task, stiffness=gains))
    return replace(system, law=replace(system.law, tasks=tuple(tasks)))


def parts_of(system: System, groups: Sequence[Group], motion: Motion | None) -> Array:
    """Return the joint stiffness of each group along a motion, (G, N, n, n) symmetric, Nm/rad.

    F_task is linear in K_x: a group's part is that of the law without all others.

    Args:
        system: the design.
        groups: its groups.
        motion: its instants; the posture if None.
    """
    still = replace(system.law, gravity=GravityCompensation.PLANNED)
    parts = []
    for one in np.eye(len(groups)):
        F = stiffened(replace(system, law=still), groups, one).spaces(motion).F_task
        parts.append((F + np.swapaxes(F, -1, -2)) / 2.0)
    return np.array(parts)


def rounded(system: System, *, up: bool = False) -> System:
    """Return a design whose gains have few digits, none larger than before.

    Full matrices stay: no project file holds them, and rounding would make them indefinite.

    Args:
        system: the design.
        up: instead of its stiffness, round its motor damping, and up.
    """
    if up:
        damping = floored(-system.actuators.motor_damping)
        return replace(system, actuators=replace(system.actuators, motor_damping=-damping))
    tasks = (
        task if np.ndim(task.stiffness) == 2 else replace(task, stiffness=floored(task.stiffness))
        for task in system.law.tasks
    )
    return replace(system, law=replace(system.law, tasks=tuple(tasks)))


_DECIMAL = Context(prec=DIGITS, rounding=ROUND_FLOOR)


def floored(values: Array) -> Array:
    """Return values rounded down to DIGITS digits.

    Args:
        values: of any shape.
    """
    return np.vectorize(_floor, otypes=[float])(values)


def _floor(value: float) -> float:
    """The value rounded down; by its shortest text, so that few digits stay what they are."""
    return float(_DECIMAL.create_decimal(repr(float(value))))
