"""A robot as compiled kernels take it: its tree of bodies, and how frames are fixed to them."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from sealag.robot._mimic import Coupling
from sealag.typing import Array, IntArray

Tree: TypeAlias = tuple[IntArray, Array, Array, Array, Array, int]
"""As in `sealag.kernels.dynamics.evaluate`."""

Mounts: TypeAlias = tuple[IntArray, Array, Array, IntArray]
"""As in `frame_mounts`."""


def tree_of(model: Any, coupling: Coupling) -> Tree:
    """Return a model's bodies and joints.

    Args:
        model: the Pinocchio model, whose joints are revolute, prismatic, or the free base.
        coupling: how they move with the robot's coordinates.
    """
    from sealag.kernels.dynamics import FREE, PRISMATIC, REVOLUTE

    count, first = model.njoints, _columns(model, coupling)
    joint, gear = np.zeros((count, 4), np.int64), np.tile([1.0, 0.0], (count, 1))
    place, axis, body = np.zeros((count, 12)), np.zeros((count, 3)), np.zeros((count, 13))
    for j in range(1, count):
        moved, fixed, inertia = model.joints[j], model.jointPlacements[j], model.inertias[j]
        kind, coordinate = FREE, 0
        if moved.nv == 1:
            linear, angular = np.split(np.ravel(moved.createData().S), 2)
            kind = REVOLUTE if angular.any() else PRISMATIC
            axis[j] = angular if kind == REVOLUTE else linear
            coordinate = int(np.flatnonzero(coupling.T[moved.idx_v])[0])
            gear[j, 0] = coupling.T[moved.idx_v, coordinate]
            gear[j, 1] = coupling.offset[moved.idx_v - model.nv]
        joint[j] = kind, model.parents[j], first[j], coordinate
        place[j, :9], place[j, 9:] = fixed.rotation.ravel(), fixed.translation
        body[j, 0], body[j, 1:4], body[j, 4:] = inertia.mass, inertia.lever, inertia.inertia.ravel()
    return joint, place, axis, body, gear, model.nq - model.nv


def _columns(model: Any, coupling: Coupling) -> list[int]:
    """First column of every joint: the robot's own velocities in order, then the followers."""
    own = coupling.restrict(np.arange(model.nv)).astype(np.int64).tolist()
    order = own + [k for k in range(model.nv) if k not in own]
    return [0, *(order.index(joint.idx_v) for joint in list(model.joints)[1:])]


def frame_number(model: Any, name: str) -> int:
    """Return a frame's number; of a link and a joint of one name it is the link's.

    Args:
        model: the Pinocchio model.
        name: of a frame that exists.
    """
    if model.existFrame(name, pin.FrameType.BODY):
        return int(model.getFrameId(name, pin.FrameType.BODY))
    return next(k for k, frame in enumerate(model.frames) if frame.name == name)


def frame_mounts(model: Any, coupling: Coupling, frames: Sequence[str]) -> Mounts:
    """Return how frames are fixed to their joints.

    Args:
        model: the Pinocchio model.
        coupling: how its joints move with the robot's coordinates.
        frames: F names, which must exist.

    Returns:
        Numbers of the joints (F,), rotations (F, 3, 3) and positions (F, 3) in the joints' axes,
        and (F, D) for each degree of freedom of the tree, followers last, which coordinate moves
        the frame through it: its number plus one, or 0 for none.
    """
    count, first = len(frames), _columns(model, coupling)
    joint, support = np.zeros(count, np.int64), np.zeros((count, model.nv), np.int64)
    rotation, position = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for f, name in enumerate(frames):
        frame = model.frames[frame_number(model, name)]
        joint[f] = frame.parentJoint
        rotation[f], position[f] = frame.placement.rotation, frame.placement.translation
        for number in list(model.supports[frame.parentJoint])[1:]:
            moved = model.joints[number]
            for k in range(moved.nv):
                coordinate = np.flatnonzero(coupling.T[moved.idx_v + k])[0]
                support[f, first[number] + k] = coordinate + 1
    return joint, rotation, position, support
