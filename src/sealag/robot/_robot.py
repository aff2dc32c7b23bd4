"""The robot: names, limits, configurations and its dynamics at one configuration."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pinocchio as pin

from sealag.constants import GRAVITY
from sealag.errors import InputError, UnknownNameError, near
from sealag.robot._contact import Contact
from sealag.robot._feet import UPRIGHT, Feet, find_feet
from sealag.robot._limits import refuse_outside
from sealag.robot._mimic import Coupling, Follower, couple
from sealag.robot._reference import ReferencePosture, posture_beside, relaxed_positions
from sealag.robot._stance import Stance, find_stance
from sealag.robot._tree import frame_mounts, tree_of
from sealag.robot._workspace import Workspace
from sealag.typing import Array, ArrayLike, BoolArray

if TYPE_CHECKING:
    from sealag.kernels.dynamics import Mounts, Tree


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """A floating- or fixed-base robot whose actuated joints have one degree of freedom each.

    A configuration is [base position, base quaternion x y z w, joints], a velocity [linear,
    angular velocity of the base in its own frame, joint rates]; without a floating base only the
    joints. The selection matrix is U = [0 I]: torques act on the last n velocities.

    Attributes:
        name: the URDF's robot name.
        urdf_path: the file it was read from; None if it is of a Pinocchio model.
        urdf_sha256: the file's SHA-256; of the expanded text where it is xacro or includes others,
            of the model as Pinocchio writes it where it is no file.
        floating_base: whether the root link moves freely.
        joints: (n) names of the actuated joints, in the order of all arrays.
        followers: joints that move with one of `joints` and have no coordinate, by name. All terms
            (M, g, Jacobians, ...) are those of the coupled robot.
        skipped: why joints that move cannot be actuated, by name, if `load_robot` skips such.
        remarks: what is read otherwise than the file says it, a sentence each.
        position_lower: (n,) rad or m, -inf where there is none; the followers' limits count.
        position_upper: (n,) rad or m, inf where there is none; the followers' limits count.
        sliding: (n,) whether a joint is prismatic, with positions in m.
        velocity_limit: (n,) rad/s or m/s as the URDF says it, 0 too, inf where there is none; what
            limits followers is not in it.
        effort_limit: (n,) Nm or N as the URDF says it, 0 too, inf where there is none; what limits
            followers is not in it.
        rotor_inertia: (n,) reflected rotor inertia that the URDF states, else 0, kg m²; the
            followers' is in it.
        damping: (n,) viscous damping of the links' joints that the URDF states, else 0, Nms/rad or
            Ns/m; a follower adds multiplier² times its own.
        friction: (n,) Coulomb friction of the links' joints that the URDF states, else 0, Nm or N;
            a follower adds |multiplier| times its own.
        mass: of everything that moves, kg; what is fixed to the world is not in it.
        tree: its bodies and joints, as compiled kernels take them.
    """

    UNIT_TOLERANCE: ClassVar[float] = 1e-3
    """How far the length of a base quaternion may be from 1: what rounding to a few digits does."""

    name: str
    urdf_path: Path | None
    urdf_sha256: str
    floating_base: bool
    joints: tuple[str, ...]
    followers: Mapping[str, Follower]
    skipped: Mapping[str, str]
    remarks: tuple[str, ...]
    position_lower: Array
    position_upper: Array
    sliding: BoolArray
    velocity_limit: Array
    effort_limit: Array
    rotor_inertia: Array
    damping: Array
    friction: Array
    mass: float
    _model: Any = field(repr=False)
    tree: "Tree" = field(init=False, repr=False, compare=False)
    _coupling: Coupling = field(init=False, repr=False, compare=False)
    _scratch: threading.local = field(default_factory=threading.local, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Take coupling and tree from the model."""
        coupling = couple(self._model, self.followers)
        object.__setattr__(self, "_coupling", coupling)
        object.__setattr__(self, "tree", tree_of(self._model, coupling))

    @property
    def n(self) -> int:
        """Number of actuated joints."""
        return len(self.joints)

    @property
    def nv_base(self) -> int:
        """Number of base velocities: 6 or 0."""
        return 6 if self.floating_base else 0

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return self.nv_base + self.n

    @property
    def nq(self) -> int:
        """Number of configuration entries."""
        return self.n + (7 if self.floating_base else 0)

    @property
    def weight(self) -> float:
        """Gravity force on everything that moves, N."""
        return self.mass * GRAVITY

    def __getstate__(self) -> dict[str, Any]:
        """Leave scratch memory out of a pickle."""
        return {name: getattr(self, name) for name in self.__slots__ if name != "_scratch"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore from a pickle."""
        for name, value in {**state, "_scratch": threading.local()}.items():
            object.__setattr__(self, name, value)

    def workspace(self) -> Workspace:
        """Return new memory for repeated evaluation, one for each thread."""
        return Workspace(self._model, self._coupling, self.tree, nv_base=self.nv_base)

    def workspace_at(self, q: ArrayLike, v: ArrayLike | None = None) -> Workspace:
        """Return the robot's scratch memory of this thread, evaluated; its next call overwrites it.

        Args:
            q: (nq,).
            v: (nv,); at rest if None.
        """
        mine = self._scratch
        if not hasattr(mine, "workspace"):
            mine.workspace = self.workspace()
        q = self._checked(q, self.nq, "configuration")
        v = np.zeros(self.nv) if v is None else self._checked(v, self.nv, "velocity")
        mine.workspace.update(q, v)
        return mine.workspace

    def _checked(self, values: ArrayLike, length: int, what: str) -> Array:
        array = np.ascontiguousarray(values, dtype=float)
        if array.shape != (length,):
            raise InputError(
                f"A {what} of {self.name} has {length} numbers; the one given has shape "
                f"{array.shape}."
            )
        if not np.isfinite(array).all():
            raise InputError(f"The {what} of {self.name} has entries that are not finite.")
        return array

    def joint_index(self, name: str) -> int:
        """Return the place of a joint in arrays of length n.

        Args:
            name: an actuated joint.

        Raises:
            UnknownNameError: there is no such joint, or it follows another one.
        """
        if name in self.followers:
            leader = self.followers[name].leader
            raise UnknownNameError(
                f"Joint {name} of {self.name} follows {leader} and has no position of its own; "
                f"give that of {leader}."
            )
        if name not in self.joints:
            raise near(name, self.joints, what=f"actuated joint of {self.name}")
        return self.joints.index(name)

    def neutral(self) -> Array:
        """Return the configuration (nq,) with all joints at 0 and the base at the origin."""
        return self.configuration(np.zeros(self.n))

    def configuration(
        self,
        joints: Mapping[str, float] | ArrayLike,
        *,
        base_position: ArrayLike = (0.0, 0.0, 0.0),
        base_quaternion: ArrayLike = UPRIGHT,
    ) -> Array:
        """Build a configuration.

        Args:
            joints: positions by name (others are 0) or (n,) in the order of `joints`, rad or m.
            base_position: (3,) m in the world; ignored without a floating base.
            base_quaternion: (4,) x, y, z, w; it is normalised.

        Returns:
            (nq,) configuration.

        Raises:
            UnknownNameError: a joint does not exist.
            InputError: lengths are wrong, values are not finite, or the quaternion is 0.
        """
        if isinstance(joints, Mapping):
            positions = np.zeros(self.n)
            for name, value in joints.items():
                positions[self.joint_index(name)] = value
        else:
            positions = self._checked(joints, self.n, "joint position")
        if not self.floating_base:
            return self._checked(positions, self.nq, "configuration")
        quaternion = np.asarray(base_quaternion, dtype=float)
        norm = np.linalg.norm(quaternion)
        if quaternion.shape != (4,) or not norm > 1e-6:
            raise InputError(f"The base quaternion {base_quaternion} is not one; x, y, z, w.")
        base = np.asarray(base_position, dtype=float)
        return self._checked(
            np.concatenate([base, quaternion / norm, positions]), self.nq, "configuration"
        )

    def require_within_limits(self, q: ArrayLike) -> None:
        """Refuse configurations outside the URDF's position limits, or far outside any range.

        A revolute joint without limits may turn by 4π either way, a sliding one move by 1 km.

        Args:
            q: (nq,) or (N, nq) rad and m.

        Raises:
            InputError: a position lies outside; the message names joint, row, value and limits.
        """
        refuse_outside(
            q, self.joints, lower=self.position_lower, upper=self.position_upper,
            sliding=self.sliding, floating=self.floating_base,
        )  # fmt: skip

    def reference_posture(self) -> ReferencePosture | None:
        """Return the posture that an SRDF beside the URDF names, one to stand in before others;
        None if there is none. Joints that it puts outside their limits are at the nearer one."""
        limits = (self.position_lower, self.position_upper)
        return posture_beside(self.urdf_path, self.joints, *limits)

    def relaxed_posture(self) -> Array:
        """Return joint positions (n,) that need no choice: those of `reference_posture`; without
        one 0 where the limits allow it, else the middle of the range, rad or m."""
        limits = self.position_lower, self.position_upper
        return relaxed_positions(self.reference_posture(), self.joints, *limits)

    def feet(self) -> Feet:
        """Return the feet, found by where limbs end, by the links' shapes and by names."""
        straight, relaxed = np.zeros(self.n), self.relaxed_posture()
        at = [self._coupling.expand(self.configuration(q)) for q in (straight, relaxed)]
        return find_feet(self._model, self.urdf_path, at)

    def stance(self, feet: Sequence[Contact], upright: Sequence[float] = UPRIGHT) -> Stance | None:
        """Return a posture to stand in: knees bent, feet level, the centre of mass between them;
        None if inverse kinematics finds none.

        Args:
            feet: one contact of each, at least two.
            upright: (4,) quaternion x, y, z, w of the base.
        """
        limits = self.position_lower, self.position_upper, self.relaxed_posture()
        return find_stance(self._model, self._coupling, feet, upright, *limits)

    def joint_positions(self, q: ArrayLike) -> Array:
        """Return the joints' part (…, n) of configurations.

        Args:
            q: (…, nq).
        """
        return np.asarray(q, dtype=float)[..., self.nq - self.n :]

    def joint_velocities(self, v: ArrayLike) -> Array:
        """Return the joints' part (…, n) of velocities.

        Args:
            v: (…, nv).
        """
        return np.asarray(v, dtype=float)[..., self.nv - self.n :]

    def integrate(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Move a configuration along a tangent vector.

        Args:
            q: (nq,).
            v: (nv,) velocity times time.
        """
        start = self._coupling.expand(self._checked(q, self.nq, "configuration"))
        step = self._coupling.T @ np.asarray(v, float)
        return self._coupling.restrict(pin.integrate(self._model, start, step))

    def difference(self, q_from: ArrayLike, q_to: ArrayLike) -> Array:
        """Return the tangent vector (nv,) that leads from one configuration to another.

        Args:
            q_from: (nq,).
            q_to: (nq,).
        """
        ends = (self._coupling.expand(np.asarray(q, float)) for q in (q_from, q_to))
        return self._coupling.restrict(pin.difference(self._model, *ends))

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q) (nv, nv) of Eq. (4), without rotor inertia.

        Args:
            q: (nq,).
        """
        return self.workspace_at(q).M.copy()

    def nonlinear_effects(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return h(q, v) (nv,) of Eq. (4): Coriolis, centrifugal and gravity torques.

        Args:
            q: (nq,).
            v: (nv,).
        """
        return self.workspace_at(q, v).nle.copy()

    def gravity(self, q: ArrayLike) -> Array:
        """Return the gravity torque g(q) (nv,).

        Args:
            q: (nq,).
        """
        return self.workspace_at(q).gravity().copy()

    def gravity_gradient(self, q: ArrayLike) -> Array:
        """Return ∂g/∂q (nv, nv): ∂²V/∂q², V the gravity potential, symmetric.

        Among the base's own directions it is the second derivative along q ⊕ u at u = 0.

        Args:
            q: (nq,).
        """
        return self.workspace_at(q).gravity_gradient()

    def center_of_mass(self, q: ArrayLike) -> Array:
        """Return the centre of mass (3,) of everything that moves, in the world, m.

        Args:
            q: (nq,).
        """
        return self.workspace_at(q).com.copy()

    def com_jacobian(self, q: ArrayLike) -> Array:
        """Return the Jacobian (3, nv) of the centre of mass.

        Args:
            q: (nq,).
        """
        return self.workspace_at(q).com_jacobian().copy()

    def frame_names(self) -> tuple[str, ...]:
        """Return the names of all frames: links and joints."""
        return tuple(dict.fromkeys(frame.name for frame in self._model.frames))

    def link_names(self) -> tuple[str, ...]:
        """Return the names of the URDF's links, which are frames too."""
        return tuple(f.name for f in self._model.frames if f.type == pin.FrameType.BODY)

    def check_frame(self, frame: str) -> str:
        """Return the name of a frame if it exists; where a link and a joint share it, the link's.

        Args:
            frame: the name.

        Raises:
            UnknownNameError: there is no such frame.
        """
        if not self._model.existFrame(frame):
            raise near(frame, self.frame_names(), what=f"frame of {self.name}")
        return frame

    def frame_mounts(self, frames: Sequence[str]) -> "Mounts":
        """Return how frames are fixed to their joints, as compiled kernels take it.

        Args:
            frames: F names.

        Raises:
            UnknownNameError: a frame does not exist.
        """
        names = [self.check_frame(name) for name in frames]
        return frame_mounts(self._model, self._coupling, names)

    def carriers(self, frames: Sequence[str]) -> BoolArray:
        """Return (n,) whether a joint, or one that follows it, moves any of the frames.

        Args:
            frames: their names.

        Raises:
            UnknownNameError: a frame does not exist.
        """
        return np.isin(np.arange(self.nv_base, self.nv) + 1, self.frame_mounts(frames).support)

    def frame_placement(self, frame: str, q: ArrayLike) -> tuple[Array, Array]:
        """Return a frame's rotation (3, 3) and position (3,) in the world.

        Args:
            frame: its name.
            q: (nq,).
        """
        rotation, position = self.workspace_at(q).frame_placement(self.check_frame(frame))
        return rotation.copy(), position.copy()

    def link_heights(self, links: Sequence[str], q: ArrayLike) -> Array:
        """Return the heights (k,) of links' frames in the world, m, without compiled kernels.

        Args:
            links: their names, of `link_names`.
            q: (nq,).
        """
        data = self._model.createData()
        start = self._coupling.expand(self._checked(q, self.nq, "configuration"))
        pin.framesForwardKinematics(self._model, data, start)
        numbers = (self._model.getFrameId(name, pin.FrameType.BODY) for name in links)
        return np.array([data.oMf[number].translation[2] for number in numbers])

    def frame_jacobian(self, frame: str, q: ArrayLike) -> Array:
        """Return a frame's Jacobian (6, nv): linear then angular velocity, axes of the world.

        Args:
            frame: its name.
            q: (nq,).
        """
        return self.workspace_at(q).frame_jacobian(self.check_frame(frame)).copy()

    def contact_jacobian(self, contacts: Sequence[Contact], q: ArrayLike) -> Array:
        """Return J_s (c, nv), the contacts' rows below one another.

        Args:
            contacts: which frames are held.
            q: (nq,).
        """
        at = self.workspace_at(q)
        rows = [at.frame_jacobian(self.check_frame(c.frame))[: c.kind.rows] for c in contacts]
        return np.vstack(rows) if rows else np.zeros((0, self.nv))

    def contact_bias(self, contacts: Sequence[Contact], q: ArrayLike, v: ArrayLike) -> Array:
        """Return J̇_s v (c,), the contacts' accelerations at zero joint acceleration.

        Args:
            contacts: which frames are held.
            q: (nq,).
            v: (nv,).
        """
        at = self.workspace_at(q, v)
        rows = [at.frame_bias(self.check_frame(c.frame))[: c.kind.rows] for c in contacts]
        return np.concatenate(rows) if rows else np.zeros(0)
