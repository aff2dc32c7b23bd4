"""Memory for evaluating a robot's terms again and again, as a controller or simulator does."""

from typing import Any

import numpy as np
import pinocchio as pin

from sealag.typing import Array

_WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Workspace:
    """All terms of a robot at one configuration and velocity; `update` first, then read.

    Arrays are views of memory that the next `update` overwrites: copy what must last.

    Attributes:
        nv: number of velocities.
        nv_base: number of base velocities, 6 or 0.
    """

    def __init__(self, model: Any, *, nv_base: int) -> None:
        """Allocate memory for a model.

        Args:
            model: the Pinocchio model of a `Robot`.
            nv_base: number of base velocities, 6 or 0.
        """
        self._model = model
        self._data = model.createData()
        self._zero = np.zeros(model.nv)
        self._frames: dict[str, int] = {}
        self.nv = int(model.nv)
        self.nv_base = nv_base
        self._q = pin.neutral(model)

    def update(self, q: Array, v: Array) -> None:
        """Evaluate everything at a configuration and velocity.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.
        """
        model, data = self._model, self._data
        self._q = q
        pin.computeAllTerms(model, data, q, v)
        pin.forwardKinematics(model, data, q, v, self._zero)
        pin.updateFramePlacements(model, data)

    @property
    def M(self) -> Array:
        """Mass matrix (nv, nv), symmetric."""
        return self._data.M

    @property
    def nle(self) -> Array:
        """Coriolis, centrifugal and gravity torques (nv,)."""
        return self._data.nle

    @property
    def com(self) -> Array:
        """Centre of mass (3,) in the world, m."""
        return self._data.com[0]

    @property
    def com_velocity(self) -> Array:
        """Velocity (3,) of the centre of mass in the world, m/s."""
        return self._data.vcom[0]

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy of the links, J."""
        return self._data.kinetic_energy

    @property
    def potential_energy(self) -> float:
        """Gravity potential, J."""
        return self._data.potential_energy

    def gravity(self) -> Array:
        """Return the gravity torque (nv,)."""
        return pin.computeGeneralizedGravity(self._model, self._data, self._q)

    def com_jacobian(self) -> Array:
        """Return the Jacobian (3, nv) of the centre of mass."""
        return self._data.Jcom

    def com_bias(self) -> Array:
        """Return the acceleration (3,) of the centre of mass at zero joint acceleration."""
        pin.centerOfMass(self._model, self._data, pin.KinematicLevel.ACCELERATION)
        return self._data.acom[0]

    def centroidal_map(self) -> Array:
        """Return the centroidal momentum matrix (6, nv): linear then angular, world axes."""
        return pin.computeCentroidalMap(self._model, self._data, self._q)

    def frame_placement(self, frame: str) -> tuple[Array, Array]:
        """Return a frame's rotation (3, 3) and position (3,) in the world.

        Args:
            frame: its name, which must exist.
        """
        placement = self._data.oMf[self._frame(frame)]
        return placement.rotation, placement.translation

    def frame_jacobian(self, frame: str) -> Array:
        """Return a frame's Jacobian (6, nv): linear then angular velocity, axes of the world.

        Args:
            frame: its name, which must exist.
        """
        return pin.getFrameJacobian(self._model, self._data, self._frame(frame), _WORLD_ALIGNED)

    def frame_velocity(self, frame: str) -> Array:
        """Return a frame's velocity (6,): linear then angular, axes of the world.

        Args:
            frame: its name, which must exist.
        """
        return pin.getFrameVelocity(
            self._model, self._data, self._frame(frame), _WORLD_ALIGNED
        ).vector

    def frame_bias(self, frame: str) -> Array:
        """Return a frame's classical acceleration (6,) at zero joint acceleration, J̇ v.

        Args:
            frame: its name, which must exist.
        """
        return pin.getFrameClassicalAcceleration(
            self._model, self._data, self._frame(frame), _WORLD_ALIGNED
        ).vector

    def _frame(self, name: str) -> int:
        index = self._frames.get(name)
        if index is None:
            index = self._frames[name] = self._model.getFrameId(name)
        return index
