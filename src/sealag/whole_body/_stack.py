"""Terms of a robot over many configurations, as stacked arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.robot import Contact, Robot, Workspace
from sealag.typing import Array, ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class TermRows:
    """Rows of a task Jacobian that a stack shall hold.

    Attributes:
        frame: the frame's name, or None for the centre of mass or joints.
        rows: which of the six rows (linear, then angular; three for the centre of mass); for
            joints, their places in `Robot.joints`.
        of_joints: whether the rows are joint rates.
    """

    frame: str | None
    rows: tuple[int, ...]
    of_joints: bool = False

    def take(self, at: Workspace) -> Array:
        """Return the rows (k, nv) at the workspace's configuration.

        Args:
            at: an updated workspace.
        """
        if self.of_joints:
            return np.eye(at.nv)[[at.nv_base + row for row in self.rows]]
        full = at.com_jacobian() if self.frame is None else at.frame_jacobian(self.frame)
        return full[list(self.rows)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stack:
    """Dynamics terms at N configurations.

    Attributes:
        M: (N, nv, nv) mass matrices.
        g: (N, nv) gravity torques.
        J_s: (N, c, nv) contact Jacobians.
        J_t: (N, m, nv) task rows in the order asked for.
    """

    M: Array
    g: Array
    J_s: Array
    J_t: Array


def stack_terms(
    robot: Robot, q: ArrayLike, contacts: Sequence[Contact], *, rows: Sequence[TermRows]
) -> Stack:
    """Evaluate a robot's terms at many configurations with the same contacts.

    Args:
        robot: the robot.
        q: (N, nq) configurations.
        contacts: which frames are held.
        rows: task rows, in order.

    Returns:
        The stacked terms.

    Raises:
        InputError: q has the wrong shape.
        UnknownNameError: a frame does not exist.
    """
    q = np.ascontiguousarray(q, dtype=float)
    if q.ndim != 2 or q.shape[1] != robot.nq:
        raise InputError(f"Configurations have shape {q.shape}; (N, {robot.nq}) is needed.")
    for name in [c.frame for c in contacts] + [r.frame for r in rows if r.frame is not None]:
        robot.check_frame(name)
    count, nv = len(q), robot.nv
    c = sum(contact.kind.rows for contact in contacts)
    m = sum(len(row.rows) for row in rows)
    stack = Stack(
        M=np.zeros((count, nv, nv)),
        g=np.zeros((count, nv)),
        J_s=np.zeros((count, c, nv)),
        J_t=np.zeros((count, m, nv)),
    )
    at, rest = robot.workspace(), np.zeros(nv)
    for k in range(count):
        at.update(q[k], rest)
        stack.M[k] = at.M
        stack.g[k] = at.nle
        first = 0
        for contact in contacts:
            last = first + contact.kind.rows
            stack.J_s[k, first:last] = at.frame_jacobian(contact.frame)[: contact.kind.rows]
            first = last
        first = 0
        for row in rows:
            last = first + len(row.rows)
            stack.J_t[k, first:last] = row.take(at)
            first = last
    return stack
