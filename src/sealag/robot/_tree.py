"""A robot as compiled kernels take it: its tree of bodies, and how frames are fixed to them."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from sealag.typing import Array, IntArray

Tree: TypeAlias = tuple[IntArray, Array, Array, Array, int]
"""As in `sealag.kernels.dynamics.evaluate`."""

Mounts: TypeAlias = tuple[IntArray, Array, Array, IntArray]
"""As in `frame_mounts`."""


def tree_of(model: Any) -> Tree:
    """Return a model's bodies and joints.

    Args:
        model: the Pinocchio model, whose joints are revolute, prismatic, or the free base.
    """
    from sealag.kernels.dynamics import FREE, PRISMATIC, REVOLUTE

    count = model.njoints
    joint, axis = np.zeros((count, 3), np.int64), np.zeros((count, 3))
    place, body = np.zeros((count, 12)), np.zeros((count, 13))
    for j in range(1, count):
        moved, fixed, inertia = model.joints[j], model.jointPlacements[j], model.inertias[j]
        kind = FREE
        if moved.nv == 1:
            linear, angular = np.split(np.ravel(moved.createData().S), 2)
            kind = REVOLUTE if angular.any() else PRISMATIC
            axis[j] = angular if kind == REVOLUTE else linear
        joint[j] = kind, model.parents[j], moved.idx_v
        place[j, :9], place[j, 9:] = fixed.rotation.ravel(), fixed.translation
        body[j, 0], body[j, 1:4], body[j, 4:] = inertia.mass, inertia.lever, inertia.inertia.ravel()
    return joint, place, axis, body, model.nq - model.nv


def frame_mounts(model: Any, frames: Sequence[str]) -> Mounts:
    """Return how frames are fixed to their joints.

    Args:
        model: the Pinocchio model.
        frames: F names, which must exist.

    Returns:
        Numbers of the joints (F,), rotations (F, 3, 3) and positions (F, 3) in the joints' axes,
        and 1 for every velocity that moves the frame (F, nv).
    """
    count = len(frames)
    joint, support = np.zeros(count, np.int64), np.zeros((count, model.nv), np.int64)
    rotation, position = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for f, name in enumerate(frames):
        frame = model.frames[model.getFrameId(name)]
        joint[f] = frame.parentJoint
        rotation[f], position[f] = frame.placement.rotation, frame.placement.translation
        for number in list(model.supports[frame.parentJoint])[1:]:
            moved = model.joints[number]
            support[f, moved.idx_v : moved.idx_v + moved.nv] = 1
    return joint, rotation, position, support
