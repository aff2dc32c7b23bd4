"""Memory for evaluating a robot's terms again and again, as a controller or simulator does."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from sealag.typing import Array

_WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Workspace:
    """All terms of a robot at one configuration and velocity; `update` first, then read.

    Arrays are views of memory that the next `update` overwrites: copy what must last, and keep
    the workspace as long as its views.

    Attributes:
        nv: number of velocities.
        nv_base: number of base velocities, 6 or 0.
        M: mass matrix (nv, nv), symmetric.
        nle: Coriolis, centrifugal and gravity torques (nv,).
        com: centre of mass (3,) in the world, m.
        com_velocity: velocity (3,) of the centre of mass in the world, m/s.
        momentum: centroidal momentum (6,): linear, then angular about the centre of mass.
        terms: what compiled kernels take, live like the rest: M, nle, the joints' spatial
            Jacobian (nv, 6) about the world's origin, and of every joint its rotation (N, 3, 3),
            position (N, 3), spatial velocity (N, 6) and, less gravity's, acceleration at zero v̇
            (N, 6), both in its own axes. `sealag.kernels.rigid.frames` makes frames of them.
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
        self._frames: dict[str, tuple[int, Array, Array]] = {}
        self.nv = nv = int(model.nv)
        self.nv_base = nv_base
        self._q, self._v = pin.neutral(model), self._zero
        data = self._data
        self.M: Array = data.M.reshape(nv, nv)
        self.nle: Array = data.nle
        self.com: Array = data.com[0]
        self.com_velocity: Array = data.vcom[0]
        self.momentum: Array = data.hg.vector
        self._com_acceleration: Array = data.acom[0]
        self._com_jacobian: Array = data.Jcom.reshape(3, nv)
        self.terms: tuple[Array, ...] = (
            self.M.T,
            self.nle,
            data.J.reshape(6, nv).T,
            _stacked([placement.rotation for placement in data.oMi]),
            _stacked([placement.translation for placement in data.oMi]),
            _stacked([twist.vector for twist in data.v]),
            _stacked([twist.vector for twist in data.a_gf]),
        )

    def update(self, q: Array, v: Array) -> None:
        """Evaluate everything at a configuration and velocity, which are kept, not copied.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.
        """
        model, data = self._model, self._data
        self._q, self._v = q, v
        pin.computeAllTerms(model, data, q, v)

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
        return self._com_jacobian

    def center_of_mass(self, q: Array) -> Array:
        """Return a copy of the centre of mass (3,) at a configuration, and evaluate nothing else.

        Args:
            q: (nq,) configuration.
        """
        return pin.centerOfMass(self._model, self._data, q, False).copy()

    def com_bias(self) -> Array:
        """Return the acceleration (3,) of the centre of mass at zero joint acceleration."""
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, self._q, self._v, self._zero)
        pin.centerOfMass(model, data, pin.KinematicLevel.ACCELERATION)
        return self._com_acceleration

    def centroidal_map(self) -> Array:
        """Return the centroidal momentum matrix (6, nv): linear then angular, world axes."""
        return pin.computeCentroidalMap(self._model, self._data, self._q)

    def frame_placement(self, frame: str) -> tuple[Array, Array]:
        """Return a frame's rotation (3, 3) and position (3,) in the world.

        Args:
            frame: its name, which must exist.
        """
        index, rotation, translation = self._frame(frame)
        pin.updateFramePlacement(self._model, self._data, index)
        return rotation, translation

    def frame_jacobian(self, frame: str) -> Array:
        """Return a frame's Jacobian (6, nv): linear then angular velocity, axes of the world.

        Args:
            frame: its name, which must exist.
        """
        return pin.getFrameJacobian(self._model, self._data, self._frame(frame)[0], _WORLD_ALIGNED)

    def frame_velocity(self, frame: str) -> Array:
        """Return a frame's velocity (6,): linear then angular, axes of the world.

        Args:
            frame: its name, which must exist.
        """
        return pin.getFrameVelocity(
            self._model, self._data, self._frame(frame)[0], _WORLD_ALIGNED
        ).vector

    def frame_bias(self, frame: str) -> Array:
        """Return a frame's classical acceleration (6,) at zero joint acceleration, J̇ v.

        Args:
            frame: its name, which must exist.
        """
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, self._q, self._v, self._zero)
        return pin.getFrameClassicalAcceleration(
            model, data, self._frame(frame)[0], _WORLD_ALIGNED
        ).vector

    def _frame(self, name: str) -> tuple[int, Array, Array]:
        """Return a frame's number and the views of its placement."""
        found = self._frames.get(name)
        if found is None:
            index = self._model.getFrameId(name)
            placement = self._data.oMf[index]
            found = self._frames[name] = index, placement.rotation, placement.translation
        return found


def _stacked(parts: Sequence[Array]) -> Array:
    """Return one live view (N, …) of arrays that lie in memory at equal distances."""
    starts = np.array([part.__array_interface__["data"][0] for part in parts])
    step = int(starts[1] - starts[0])
    if (np.diff(starts) != step).any():
        raise RuntimeError("Pinocchio does not keep its joints' terms side by side.")
    first = parts[0]
    return np.lib.stride_tricks.as_strided(
        first, (len(parts), *first.shape), (step, *first.strides)
    )
