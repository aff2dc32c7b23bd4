"""A robot as compiled kernels take it: its tree of bodies, and how frames are fixed to them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from sealag.robot._mimic import Coupling

if TYPE_CHECKING:
    from sealag.kernels.dynamics import Mounts, Tree


def tree_of(model: Any, coupling: Coupling) -> "Tree":
    """Return a model's bodies and joints.

    Args:
        model: the Pinocchio model, whose joints are revolute, prismatic, or the free base.
        coupling: how they move with the robot's coordinates.
    """
    from sealag.kernels.dynamics import FREE, PRISMATIC, REVOLUTE, Tree

    count, first = model.njoints, _columns(model, coupling)
    tree = Tree(
        kind=np.zeros(count, np.int64), parent=np.zeros(count, np.int64),
        column=np.array(first, np.int64), coordinate=np.zeros(count, np.int64),
        rotation=np.zeros((count, 3, 3)), position=np.zeros((count, 3)), axis=np.zeros((count, 3)),
        mass=np.zeros(count), lever=np.zeros((count, 3)), inertia=np.zeros((count, 3, 3)),
        ratio=np.ones(count), offset=np.zeros(count), extra=model.nq - model.nv,
    )  # fmt: skip
    for j in range(1, count):
        moved, fixed, inertia = model.joints[j], model.jointPlacements[j], model.inertias[j]
        tree.kind[j], tree.parent[j] = FREE, model.parents[j]
        if moved.nv == 1:
            linear, angular = np.split(np.ravel(moved.createData().S), 2)
            turning = angular.any()
            tree.kind[j] = REVOLUTE if turning else PRISMATIC
            tree.axis[j] = angular if turning else linear
            coordinate = int(np.flatnonzero(coupling.T[moved.idx_v])[0])
            tree.coordinate[j] = coordinate
            tree.ratio[j] = coupling.T[moved.idx_v, coordinate]
            tree.offset[j] = coupling.offset[moved.idx_v - model.nv]
        tree.rotation[j], tree.position[j] = fixed.rotation, fixed.translation
        tree.mass[j], tree.lever[j] = inertia.mass, inertia.lever
        tree.inertia[j] = inertia.inertia
    return tree


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


def frame_mounts(model: Any, coupling: Coupling, frames: Sequence[str]) -> "Mounts":
    """Return how frames are fixed to their joints.

    Args:
        model: the Pinocchio model.
        coupling: how its joints move with the robot's coordinates.
        frames: F names, which must exist.
    """
    from sealag.kernels.dynamics import Mounts

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
    return Mounts(joint=joint, rotation=rotation, position=position, support=support)
