"""The robot's rigid-body terms, written into an Instant."""

from collections.abc import Iterable, Sequence

import numpy as np

from sealag.robot import Robot
from sealag.simulation._instant import Instant


class Body:
    """Evaluates the dynamics terms and frames that a step needs, with one call per instant.

    Args:
        robot: The robot.
        names: Frames of the feet and of disturbing forces.

    Attributes:
        frames: Jacobians (F, 6, nv), rotations (F, 3, 3), positions (F, 3) and velocity-product
            accelerations (F, 6) of the last instant, world-aligned, linear rows first.
    """

    def __init__(self, robot: Robot, names: Sequence[str]) -> None:
        count = len(names)
        self._workspace = robot.workspace()
        self._names = tuple(robot.check_frame(name) for name in names)
        self.frames = (
            np.zeros((count, 6, robot.nv)),
            np.zeros((count, 3, 3)),
            np.zeros((count, 3)),
            np.zeros((count, 6)),
        )

    def evaluate(self, at: Instant, used: Iterable[int]) -> None:
        """Evaluate at an instant's q and v, and only the frames with these numbers."""
        workspace = self._workspace
        workspace.update(at.q, at.v)
        at.M[:] = workspace.M
        at.nle[:] = workspace.nle
        at.potential = workspace.potential_energy
        jacobian, rotation, position, bias = self.frames
        for i in used:
            name = self._names[i]
            rotation[i], position[i] = workspace.frame_placement(name)
            jacobian[i] = workspace.frame_jacobian(name).reshape(6, -1)  # one joint: a vector
            bias[i] = workspace.frame_bias(name)
