"""Memory for evaluating a robot's terms again and again, as a controller or simulator does."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from sealag.kernels import keep
from sealag.robot._mimic import Coupling
from sealag.robot._tree import frame_mounts
from sealag.typing import Array

if TYPE_CHECKING:
    from sealag.kernels.dynamics import Frames, Mounts, Tree


class Workspace:
    """All terms of a robot at one configuration and velocity; `update` first, then read.

    Arrays are views of memory that the next `update` overwrites: copy what must last.

    Attributes:
        nv: number of velocities.
        nv_base: number of base velocities, 6 or 0.
        M: mass matrix (nv, nv), symmetric.
        nle: Coriolis, centrifugal and gravity torques (nv,).
        com: centre of mass (3,) in the world, m.
        com_velocity: velocity (3,) of the centre of mass in the world, m/s.
        momentum: centroidal momentum (6,): linear, then angular about the centre of mass.
        terms: all of it, as `sealag.kernels.dynamics.Terms`.
    """

    def __init__(self, model: Any, coupling: Coupling, tree: "Tree", *, nv_base: int) -> None:
        """Allocate memory for a model.

        Args:
            model: the Pinocchio model of a `Robot`.
            coupling: how its joints move with the robot's coordinates.
            tree: the same as compiled kernels take it.
            nv_base: number of base velocities, 6 or 0.
        """
        from sealag.kernels import dynamics

        self._model, self._kernel = model, dynamics
        self._coupling, self._tree = coupling, tree
        self._data = model.createData()
        self._frames: dict[str, _Frame] = {}
        self.nv, self.nv_base = coupling.T.shape[1], nv_base
        self._q, self._v = coupling.restrict(pin.neutral(model)), np.zeros(self.nv)
        self.terms = dynamics.allocate(tree)
        self._kept = keep(dynamics.Model(tree, self.terms))
        self.M, self.nle, self.momentum = self.terms.M, self.terms.nle, self.terms.momentum
        self.com, self.com_velocity = self.terms.com, self.terms.com_velocity
        self._weight = dynamics.GRAVITY * sum(inertia.mass for inertia in model.inertias[1:])

    def update(self, q: Array, v: Array) -> None:
        """Evaluate everything at a configuration and velocity; both are kept, not copied.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity.
        """
        self._q, self._v = q, v
        self._kernel.evaluate(self._kept, q, v)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it is made of and where it was evaluated; memory is allocated anew."""
        made_of = (self._model, self._coupling, self._tree, self.nv_base)
        return _evaluated, (*made_of, self._q, self._v)

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy of the links, J."""
        return float(self.terms.energy[self._kernel.KINETIC])

    @property
    def potential_energy(self) -> float:
        """Gravity potential, J."""
        return float(self.terms.energy[self._kernel.POTENTIAL])

    def gravity(self) -> Array:
        """Return the gravity torque (nv,)."""
        return self._weight * self.terms.com_jacobian[2]

    def gravity_gradient(self) -> Array:
        """Return ∂g/∂q (nv, nv) as `sealag.robot.Robot.gravity_gradient`; new memory."""
        H = np.empty((self.nv, self.nv))
        self._kernel.gravity_gradient(self._kept, H)
        return H

    def com_jacobian(self) -> Array:
        """Return the Jacobian (3, nv) of the centre of mass."""
        return self.terms.com_jacobian

    def center_of_mass(self, q: Array) -> Array:
        """Return a copy of the centre of mass (3,) at a configuration, and evaluate nothing else.

        Args:
            q: (nq,) configuration.
        """
        return pin.centerOfMass(self._model, self._data, self._coupling.expand(q), False).copy()

    def com_bias(self) -> Array:
        """Return the acceleration (3,) of the centre of mass at zero joint acceleration."""
        return self.terms.com_drift

    def centroidal_map(self) -> Array:
        """Return the centroidal momentum matrix (6, nv): linear then angular, world axes."""
        A = pin.computeCentroidalMap(self._model, self._data, self._coupling.expand(self._q))
        return A if self._coupling.trivial else A @ self._coupling.T

    def frame_placement(self, frame: str) -> tuple[Array, Array]:
        """Return a frame's rotation (3, 3) and position (3,) in the world.

        Args:
            frame: its name, which must exist.
        """
        found = self._frame(frame).terms
        return found.R[0], found.p[0]

    def frame_jacobian(self, frame: str) -> Array:
        """Return a frame's Jacobian (6, nv): linear then angular velocity, axes of the world.

        Args:
            frame: its name, which must exist.
        """
        return self._frame(frame).terms.J[0]

    def frame_velocity(self, frame: str) -> Array:
        """Return a frame's velocity (6,): linear then angular, axes of the world.

        Args:
            frame: its name, which must exist.
        """
        found = self._frame(frame)
        twist = self.terms.twist[found.mounts.joint[0]]
        arm = found.terms.p[0] - self.terms.position[1]
        return np.concatenate([twist[:3] + np.cross(twist[3:], arm), twist[3:]])

    def frame_bias(self, frame: str) -> Array:
        """Return a frame's classical acceleration (6,) at zero joint acceleration, J̇ v.

        Args:
            frame: its name, which must exist.
        """
        return self._frame(frame).terms.drift[0]

    def _frame(self, name: str) -> "_Frame":
        """Return what is known of a frame now."""
        found = self._frames.get(name)
        if found is None:
            mounts = frame_mounts(self._model, self._coupling, [name])
            terms = self._kernel.allocate_frames(1, self.nv)
            kept = keep(self._kernel.Placed(self.terms, mounts, terms))
            found = self._frames[name] = _Frame(mounts=mounts, terms=terms, kept=kept)
        self._kernel.frames(found.kept)
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class _Frame:
    """How one frame is fixed, and its terms."""

    mounts: "Mounts"
    terms: "Frames"
    kept: Any


def _evaluated(
    model: Any, coupling: Coupling, tree: "Tree", nv_base: int, q: Array, v: Array
) -> Workspace:
    """The workspace of a pickle."""
    workspace = Workspace(model, coupling, tree, nv_base=nv_base)
    workspace.update(q, v)
    return workspace
