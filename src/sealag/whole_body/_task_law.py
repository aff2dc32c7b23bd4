"""What a whole-body law commands at a configuration, whatever signal that comes from."""

from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from sealag.errors import InputError, word
from sealag.robot import Robot
from sealag.typing import Array
from sealag.whole_body._stack import TermRows
from sealag.whole_body._tasks import (
    GravityCompensation,
    StiffnessForm,
    Task,
    TaskError,
    TaskInertia,
    block_diagonal,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskLaw:
    """τ_osc = Σ_k J*_{k|prec}ᵀ (S_k x̃_k + D_k x̃̇_k) + ḡ, Eqs. (10)-(17). `Law`, which also has the
    signal, says what its fields are."""

    tasks: tuple[Task, ...]
    gravity: GravityCompensation = GravityCompensation.FEEDBACK
    stiffness_form: StiffnessForm = StiffnessForm.SYMMETRIC
    task_inertia: TaskInertia = TaskInertia.LAMBDA_TS
    task_error: TaskError = TaskError.CONSISTENT
    velocity_feedforward: bool = True
    ordered: tuple[Task, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Sort the tasks.

        Raises:
            InputError: there is none, two have one name, or a word is not one of its kind.
        """
        if isinstance(self.tasks, Task) or not all(isinstance(one, Task) for one in self.tasks):
            raise InputError("The law's tasks are no tuple of Task; write tasks=(task,) for one.")
        object.__setattr__(self, "tasks", tuple(self.tasks))
        if not self.tasks:
            raise InputError("The law has no tasks; at least one is needed.")
        names = [task.name for task in self.tasks]
        if len(set(names)) < len(names):
            raise InputError("Two tasks of the law have the same name.")
        for name, kind in (
            ("gravity", GravityCompensation),
            ("stiffness_form", StiffnessForm),
            ("task_inertia", TaskInertia),
            ("task_error", TaskError),
        ):
            found = word(kind, getattr(self, name), what=f"The law's {name}")
            object.__setattr__(self, name, found)
        ordered = tuple(sorted(self.tasks, key=lambda task: task.priority))
        object.__setattr__(self, "ordered", ordered)

    def rows(self, robot: Robot) -> list[TermRows]:
        """Return the Jacobian rows of all tasks, by priority.

        Args:
            robot: the robot.

        Raises:
            UnknownNameError: a frame or joint of a task does not exist.
        """
        return [task.rows(robot) for task in self.ordered]

    def levels(self, robot: Robot) -> list[int]:
        """Return the first row of each priority level, then the number of rows m.

        Args:
            robot: the robot.
        """
        ends = [0]
        for _, tasks in groupby(self.ordered, key=lambda task: task.priority):
            ends.append(ends[-1] + sum(len(task.rows(robot).rows) for task in tasks))
        return ends

    def gain(self, robot: Robot) -> Array:
        """Return K_x of all tasks, (m, m), blocks by priority on the diagonal.

        Args:
            robot: the robot.
        """
        return block_diagonal([t.gain(len(t.rows(robot).rows)) for t in self.ordered])

    def drag(self, robot: Robot) -> Array:
        """Return D_x of all tasks, (m, m), blocks by priority on the diagonal.

        Args:
            robot: the robot.
        """
        return block_diagonal([t.drag(len(t.rows(robot).rows)) for t in self.ordered])

    @property
    def damped(self) -> str:
        """The first task whose damping the controller computes; empty if there is none."""
        return next((task.name for task in self.ordered if np.any(task.damping)), "")
