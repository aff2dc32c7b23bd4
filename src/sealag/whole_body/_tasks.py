"""Operational-space tasks, and the words for how a law uses them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sealag.errors import InputError, either, word
from sealag.robot import Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._stack import TermRows


class TaskKind(StrEnum):
    """What a task controls."""

    COM = "com"
    POSITION = "position"
    ORIENTATION = "orientation"
    POSE = "pose"
    POSTURE = "posture"


class StiffnessForm(StrEnum):
    """How the stiffness S of a task follows from its gain K_x and the task inertia Λ.

    symmetric: S = Λ^½ K_x Λ^½, always symmetric; published: S = Λ K_x as in Eq. (11), in general
    not symmetric; force: S = K_x, a stiffness in N/m and Nm/rad.
    """

    SYMMETRIC = "symmetric"
    PUBLISHED = "published"
    FORCE = "force"

    @property
    def printed(self) -> "StiffnessForm":
        """The form that the criterion as printed takes for this one: Λ K_x, or K_x without Λ."""
        return self if self is StiffnessForm.FORCE else StiffnessForm.PUBLISHED


class GravityCompensation(StrEnum):
    """Where gravity compensation takes its configuration from.

    feedback: from the fed-back and delayed one, so that its gradient is part of the feedback;
    planned: from the plan, so that it has no gradient; none: there is no compensation.
    """

    FEEDBACK = "feedback"
    PLANNED = "planned"
    NONE = "none"


class TaskInertia(StrEnum):
    """Which task inertia scales the gains.

    lambda_ts: Λ_{t|s} = (J_{t|s} M⁻¹ J_{t|s}ᵀ)⁺ of Eq. (10); lambda_star: Λ* = (J* φ* J*ᵀ)⁺.
    """

    LAMBDA_TS = "lambda_ts"
    LAMBDA_STAR = "lambda_star"


class TaskError(StrEnum):
    """Which error a task below the first level feeds back.

    consistent: x̃_{k|prec} = x̃_k − J_k Σ_{i<k} P_i J_iᵀ Λ_i x̃_{i|prec}, what is left of x̃_k once
    the tasks above have removed theirs. Its rate is −J*_{k|prec} θ̇, as Corollary 1 takes it, so
    that −∂τ_osc/∂θ = Σ J*ᵀ S J* is symmetric with S.

    plain: x̃_k = x_d,k − x_k as printed. Its rate is −J_k overline(UN_s) θ̇: the stiffness
    Σ J*_{k|prec}ᵀ S_k J_k overline(UN_s) is not symmetric and has no potential. With one level the
    two are the same.
    """

    CONSISTENT = "consistent"
    PLAIN = "plain"


RANK_TOLERANCE = 1e-9
"""A direction counts as lost where contacts, higher tasks or a singular leg leave less than this
fraction of the mobility that it would have without them."""

FORM_CODE = {"symmetric": 0, "published": 1, "force": 2}
"""The stiffness forms as compiled kernels take them."""

_SIZE = {TaskKind.COM: 3, TaskKind.POSITION: 3, TaskKind.ORIENTATION: 3, TaskKind.POSE: 6}
_NEEDS_FRAME = {TaskKind.POSITION, TaskKind.ORIENTATION, TaskKind.POSE}
_ONLY = {"frame": _NEEDS_FRAME, "joints": {TaskKind.POSTURE}, "axes": set(_SIZE)}
"""Keys that only some kinds of tasks have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One task of a hierarchy.

    Attributes:
        name: what messages and plots call it.
        kind: what it controls.
        stiffness: K_x, (m, m); a scalar or m numbers become its diagonal. 1/s² where the task
            inertia scales it, else N/m and Nm/rad.
        frame: the controlled frame, for position, orientation and pose.
        joints: the controlled joints, for posture; empty means all.
        axes: which rows are controlled, out of x, y, z (then rotations about x, y, z for pose);
            empty means all. World axes.
        priority: 1 is the highest; tasks of equal priority share one level.
        damping: D_x that the controller computes from measured rates, late as the stiffness is,
            (m, m); a scalar or m numbers become its diagonal. Always N s/m and Nm s/rad.
    """

    name: str
    kind: TaskKind
    stiffness: Array
    frame: str | None = None
    joints: tuple[str, ...] = ()
    axes: tuple[int, ...] = ()
    priority: int = 1
    damping: ArrayLike = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be a task.

        Raises:
            InputError: the frame is missing, a key is given that tasks of this kind do not have,
                axes do not exist, or an axis or joint is listed twice.
        """
        kind = word(TaskKind, self.kind, what=f"The kind of task {self.name}")
        object.__setattr__(self, "kind", kind)
        if not (isinstance(self.priority, int) and all(isinstance(a, int) for a in self.axes)):
            raise InputError(f"Task {self.name}: priority and axes are whole numbers.")
        if self.kind in _NEEDS_FRAME and not self.frame:
            raise InputError(f"Task {self.name}: its kind, {self.kind}, needs a frame.")
        for key, kinds in _ONLY.items():
            if getattr(self, key) and self.kind not in kinds:
                raise InputError(
                    f"Task {self.name}: its kind, {self.kind}, has no {key}; remove the key, or "
                    f"should it be {either(sorted(kinds))}?"
                )
        if len(set(self.axes)) < len(self.axes) or len(set(self.joints)) < len(self.joints):
            raise InputError(f"Task {self.name}: an axis or joint is listed twice; once is right.")
        size = _SIZE.get(self.kind)
        if size and any(not 0 <= axis < size for axis in self.axes):
            raise InputError(f"Task {self.name}: axes must lie in 0 … {size - 1}.")
        if self.priority < 1:
            raise InputError(f"Task {self.name}: priority is {self.priority}; 1 is the highest.")

    def rows(self, robot: Robot) -> TermRows:
        """Return which Jacobian rows of a robot the task uses.

        Args:
            robot: the robot.

        Raises:
            UnknownNameError: the frame or a joint does not exist.
        """
        if self.kind is TaskKind.POSTURE:
            names = self.joints or robot.joints
            return TermRows(
                frame=None, rows=tuple(robot.joint_index(name) for name in names), of_joints=True
            )
        axes = self.axes or tuple(range(_SIZE[self.kind]))
        if self.kind is TaskKind.COM:
            return TermRows(frame=None, rows=axes)
        frame = robot.check_frame(self.frame or "")
        shift = 3 if self.kind is TaskKind.ORIENTATION else 0
        return TermRows(frame=frame, rows=tuple(axis + shift for axis in axes))

    def gain(self, size: int) -> Array:
        """Return K_x as a matrix.

        Args:
            size: number of rows m.

        Returns:
            (m, m) symmetric positive semidefinite matrix.

        Raises:
            InputError: the stiffness has another size, is not finite, not symmetric or negative.
        """
        return gain_matrix(self.stiffness, size, what=f"Task {self.name}: stiffness")

    def drag(self, size: int) -> Array:
        """Return D_x as a matrix.

        Args:
            size: number of rows m.

        Returns:
            (m, m) symmetric positive semidefinite matrix, N s/m and Nm s/rad.

        Raises:
            InputError: the damping has another size, is not finite, not symmetric or negative.
        """
        return gain_matrix(self.damping, size, what=f"Task {self.name}: damping")


def gain_matrix(values: ArrayLike, size: int, *, what: str) -> Array:
    """Return a scalar, a diagonal or a matrix of gains as a matrix.

    Args:
        values: (), (m,) or (m, m).
        size: m.
        what: how messages begin.

    Raises:
        InputError: it has another shape, is not finite, not symmetric or not positive
            semidefinite.
    """
    if np.asarray(values).dtype.kind not in "fiu":
        raise InputError(f"{what} is {values!r}; numbers are right.")
    array = np.asarray(values, dtype=float)
    if not np.isfinite(array).all():
        raise InputError(f"{what} has entries that are not finite numbers.")
    if array.ndim == 0:
        array = np.full(size, float(array))
    if array.shape == (size,):
        if (array < 0.0).any():
            raise InputError(f"{what} has a negative entry ({array.min():g}); 0 or more is right.")
        return np.diag(array)
    if array.shape != (size, size):
        raise InputError(
            f"{what} has shape {array.shape}; one number, {size} numbers or a {size} x {size} "
            "matrix are right."
        )
    if not np.allclose(array, array.T, rtol=1e-12, atol=0.0):
        raise InputError(f"{what} is not a symmetric matrix.")
    if np.linalg.eigvalsh(array)[0] < -1e-12 * np.abs(array).max():
        raise InputError(f"{what} is not positive semidefinite.")
    return array


def block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return the matrix with square blocks on its diagonal.

    Args:
        blocks: (m_i, m_i) each.
    """
    size = sum(len(block) for block in blocks)
    out = np.zeros((size, size))
    first = 0
    for block in blocks:
        last = first + len(block)
        out[first:last, first:last] = block
        first = last
    return out
