"""Contacts and tasks about a posture, as the compiled law takes them."""

from typing import TYPE_CHECKING

import numpy as np

from sealag.errors import InputError
from sealag.robot import Contact, Robot
from sealag.typing import ArrayLike
from sealag.whole_body._task_law import TaskLaw
from sealag.whole_body._tasks import TaskKind

if TYPE_CHECKING:
    from sealag.kernels.control_law import Tasks


def read_tasks(
    robot: Robot, law: TaskLaw, contacts: tuple[Contact, ...], *, posture: ArrayLike
) -> tuple[list[str], "Tasks"]:
    """Return the tasks' references: their positions in a posture, where all errors are 0.

    Args:
        robot: the robot.
        law: the law, with its tasks.
        contacts: which frames are held.
        posture: (nq,) configuration.

    Returns:
        Names of the contacts' frames, then the tasks'; and the arrays.

    Raises:
        InputError: the posture has another shape.
        UnknownNameError: a frame or joint does not exist.
    """
    from sealag.kernels.control_law import OF_FRAME, OF_JOINT, OF_MASS, Tasks

    q = np.asarray(posture, dtype=float)
    if q.shape != (robot.nq,):
        raise InputError(f"The posture has shape {q.shape}; ({robot.nq},) is needed.")
    names = [robot.check_frame(contact.frame) for contact in contacts]
    held = [(f, row) for f, contact in enumerate(contacts) for row in range(contact.kind.rows)]
    rows: list[tuple[int, int, int]] = []
    values: list[float] = []
    for task, chosen in zip(law.ordered, law.rows(robot), strict=True):
        kind, frame, whole = OF_JOINT, 0, robot.joint_positions(q)
        if chosen.frame is not None:
            kind, frame, whole = OF_FRAME, len(names), np.zeros(6)
            names.append(chosen.frame)
        elif task.kind is TaskKind.COM:
            kind, whole = OF_MASS, robot.center_of_mass(q)
        rows += [(kind, frame, row) for row in chosen.rows]
        values += [float(whole[row]) for row in chosen.rows]
    placed = [robot.frame_placement(name, q) for name in names]
    held_rows = np.array(held, dtype=np.int64).reshape(-1, 2).T
    task_rows = np.array(rows, dtype=np.int64).reshape(-1, 3).T
    contact_frame, contact_row = np.ascontiguousarray(held_rows)
    kinds, frame_of, row_of = np.ascontiguousarray(task_rows)
    return names, Tasks(
        contact_frame=contact_frame,
        contact_row=contact_row,
        kind=kinds,
        frame=frame_of,
        row=row_of,
        levels=np.array(law.levels(robot)),
        R=np.array([rotation for rotation, _ in placed]).reshape(-1, 3, 3),
        p=np.array([position for _, position in placed]).reshape(-1, 3),
        x=np.array(values),
    )
