"""Task errors and Jacobians at one configuration, on preallocated arrays."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.robot import Robot, Workspace
from sealag.typing import Array, ArrayLike, IntArray
from sealag.whole_body._tasks import Hierarchy, TaskKind


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """One task: where its rows lie in the stack, which they are, and what they shall be.

    Attributes:
        place: rows in the stack.
        rows: rows of the whole quantity: 3 of the centre of mass, 6 of a frame, n of joints.
        frame: the frame's name; None for centre of mass and joints.
        of_joints: whether the rows are joint angles.
        wanted: what the chosen rows shall be; the whole placement's position for a frame.
        rotation: (3, 3) for a frame, contiguous.
    """

    place: slice
    rows: slice | IntArray
    frame: str | None
    of_joints: bool
    wanted: Array
    rotation: Array


class TaskReader:
    """The tasks of a hierarchy about the posture at which all their errors are 0."""

    def __init__(self, robot: Robot, hierarchy: Hierarchy, posture: ArrayLike) -> None:
        """Measure what each task shall reach.

        Args:
            robot: the robot.
            hierarchy: its tasks.
            posture: (nq,) configuration.

        Raises:
            InputError: the posture has another shape.
            UnknownNameError: a frame or joint does not exist.
        """
        q = np.asarray(posture, dtype=float)
        if q.shape != (robot.nq,):
            raise InputError(f"The posture has shape {q.shape}; ({robot.nq},) is needed.")
        self._joints = slice(robot.nq - robot.n, robot.nq)
        self._both, self._rows = np.zeros(6), []
        first = 0
        for task, row in zip(hierarchy.ordered, hierarchy.rows(robot), strict=True):
            last = first + len(row.rows)
            pick = _picker(row.rows)
            wanted, rotation = q[self._joints][pick], np.eye(3)
            if task.kind is TaskKind.COM:
                wanted = robot.center_of_mass(q)[pick]
            elif row.frame is not None:
                rotation, wanted = robot.frame_placement(row.frame, q)
            self._rows.append(
                _Row(
                    place=slice(first, last),
                    rows=pick,
                    frame=row.frame,
                    of_joints=row.of_joints,
                    wanted=np.ascontiguousarray(wanted),
                    rotation=np.ascontiguousarray(rotation),
                )
            )
            first = last

    def jacobian(self, at: Workspace, out: Array) -> None:
        """Write the task Jacobians J_t.

        Args:
            at: an updated workspace.
            out: (m, nv); rows of joint tasks are constant.
        """
        for row in self._rows:
            if row.frame is not None:
                out[row.place] = at.frame_jacobian(row.frame)[row.rows]
            elif row.of_joints:
                out[row.place] = np.eye(at.nv)[at.nv_base :][row.rows]
            else:
                out[row.place] = at.com_jacobian()[row.rows]

    def error(self, at: Workspace, q: Array, out: Array) -> None:
        """Write x_d − x, rotations as rotation vectors in world axes.

        Args:
            at: a workspace updated at q.
            q: (nq,) configuration.
            out: (m,).
        """
        from sealag.kernels.control_law import frame_error

        for row in self._rows:
            if row.frame is not None:
                rotation, position = at.frame_placement(row.frame)
                frame_error(row.rotation, row.wanted, rotation, position, self._both)
                out[row.place] = self._both[row.rows]
            elif row.of_joints:
                out[row.place] = row.wanted - q[self._joints][row.rows]
            else:
                out[row.place] = row.wanted - at.com[row.rows]


def _picker(rows: tuple[int, ...]) -> slice | IntArray:
    """A slice where the rows are consecutive, else their numbers."""
    if rows == tuple(range(rows[0], rows[0] + len(rows))):
        return slice(rows[0], rows[0] + len(rows))
    return np.array(rows, dtype=np.int64)
