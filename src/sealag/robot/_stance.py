"""A posture to stand in: knees bent, feet level on flat ground, the centre of mass over them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from sealag.robot._contact import Contact, ContactKind
from sealag.robot._mimic import Coupling
from sealag.typing import Array, IntArray

_STRETCH = {ContactKind.SURFACE: 0.94, ContactKind.POINT: 0.85}
"""Of a leg's greatest length: a knee of 40°, as humanoids stand, or of 64°, as quadrupeds do."""
_SEEDS = 30  # starts of each leg's inverse kinematics: it finds knees bent either way
_SAMPLES = 400  # postures among which a leg's greatest length is sought; it is right to 1 %
_STEPS = 60  # of Gauss-Newton; good starts need ten
_SHIFTS = 8  # of the feet below the centre of mass; each leaves a tenth of the offset
_INSIDE = 5e-3  # rad, m from a limit: more than what four digits round away
_WIDEST = np.pi  # rad, m: where there is no limit
_DAMPING = 1e-8  # of J Jᵀ: keeps steps near straight knees finite
_PLACED = 1e-4  # m, rad: the error of a foot that stands
_ALIKE = 0.1  # rad²: postures that differ less from the relaxed one are equally natural
_ASIDE = 0.05  # weight of errors sideways: legs of few joints keep height and soles exact
_UNREACHED = 0.02  # m by which a foot may miss its place sideways: it still stands on the ground


class Stance(NamedTuple):
    """A posture in which a robot stands.

    Attributes:
        joints: (n,) positions, rad or m.
        height: of the base where the lowest foot's frame is at 0, m.
    """

    joints: Array
    height: float


class _Leg(NamedTuple):
    """What inverse kinematics knows of one leg.

    Attributes:
        frame: number of the foot's frame.
        columns: (m,) places of the leg's own joints among the robot's.
        hip: number of the model's joint before the knee.
        knee: number of the joint that changes the leg's length most.
        length: greatest distance from hip to foot within the limits, m.
        place: (2,) where the foot stands below the hip, upright and in the base's axes, m.
        level: (3, 3) rotation of the foot's frame where the sole is level.
    """

    frame: int
    columns: IntArray
    hip: int
    knee: int
    length: float
    place: Array
    level: Array


def find_stance(
    model: Any,
    coupling: Coupling,
    contacts: Sequence[Contact],
    upright: Sequence[float],
    lower: Array,
    upper: Array,
    relaxed: Array,
) -> Stance | None:
    """Find a posture to stand in by inverse kinematics, leg by leg.

    Args:
        model: the Pinocchio model of what moves.
        coupling: how it moves with the robot's coordinates.
        contacts: one of each foot, two or more.
        upright: (4,) quaternion x, y, z, w of the base where the robot stands upright.
        lower: (n,) limits, -inf where there is none.
        upper: (n,) limits, inf where there is none.
        relaxed: (n,) positions of the joints that are in no leg.

    Returns:
        The posture; None if none was found.
    """
    room = np.minimum(_INSIDE, (upper - lower) / 4.0)
    lower, upper = np.maximum(lower + room, -_WIDEST), np.minimum(upper - room, _WIDEST)
    up = pin.Quaternion(np.array(upright)).toRotationMatrix()
    return _Search(model, coupling, contacts, up, _Limits(lower, upper, relaxed)).find()


class _Limits(NamedTuple):
    """Where joints may be.

    Attributes:
        lower: (n,) rad or m.
        upper: (n,) rad or m.
        relaxed: (n,) where they need no choice.
    """

    lower: Array
    upper: Array
    relaxed: Array


class _Search:
    """Search for a posture: the base stays upright at the origin, and the feet move below it."""

    def __init__(
        self,
        model: Any,
        coupling: Coupling,
        contacts: Sequence[Contact],
        up: Array,
        limits: _Limits,
    ) -> None:
        self._model, self._data, self._coupling = model, model.createData(), coupling
        self._kind, self._up = contacts[0].kind, up
        self._base = model.nq - len(coupling.offset)
        self._lower, self._upper = limits.lower, limits.upper
        self._relaxed = np.clip(limits.relaxed, limits.lower, limits.upper)
        self._legs = self._read_legs([contact.frame for contact in contacts])

    def find(self) -> Stance | None:
        joints, grounds = self._relaxed.copy(), []
        self._move(joints)
        for leg in self._legs:
            hip = self._place(leg.hip)
            stretched = _STRETCH[self._kind] * leg.length
            aside = np.linalg.norm(hip[:2] - leg.place)
            grounds.append(hip[2] - np.sqrt(max(stretched**2 - aside**2, 0.0)))
        shift, seeds = np.zeros(2), _SEEDS
        for _ in range(_SHIFTS):
            for leg in self._legs:
                target = np.array([*(leg.place + shift), max(grounds)])
                found = self._solve(leg, target, joints, seeds)
                if found is None:
                    return None
                joints = found
            self._move(joints)
            stands = np.mean([self._foot(leg) for leg in self._legs], axis=0)
            com = pin.centerOfMass(self._model, self._data, self._q(joints))
            off = (self._up @ com - stands)[:2]
            if np.abs(off).max() < _PLACED:
                break
            shift, seeds = shift + off, 0
        self._move(joints)
        return Stance(joints, -min(float(self._foot(leg)[2]) for leg in self._legs))

    def _read_legs(self, frames: Sequence[str]) -> list[_Leg]:
        model = self._model
        ids = [model.getFrameId(name, pin.FrameType.BODY) for name in frames]
        chains = [tuple(model.supports[model.frames[k].parentJoint])[1:] for k in ids]
        legs = []
        for number, (frame, chain) in enumerate(zip(ids, chains, strict=True)):
            others = {j for k, other in enumerate(chains) if k != number for j in other}
            own = [j for j in chain if j not in others and model.joints[j].nv == 1]
            rows = self._coupling.T[[model.joints[j].idx_v for j in own]]
            columns = np.flatnonzero(rows.any(axis=0)) - self._base_columns
            hip, knee, length = self._thigh(frame, own, columns)
            self._move(np.zeros(len(self._relaxed)))
            placed = self._data.oMf[frame]
            place = self._up @ placed.translation
            place[0] = self._place(own[-2] if len(own) > 1 else own[-1])[0]
            level = self._up @ placed.rotation
            legs.append(_Leg(frame, columns, hip, knee, length, place[:2], level))
        return legs

    def _thigh(self, frame: int, own: Sequence[int], columns: IntArray) -> tuple[int, int, float]:
        """Hip and knee of a leg, and the greatest distance from hip to foot, m."""
        rng, joints = np.random.default_rng(0), self._relaxed.copy()
        low, high = self._lower[columns], self._upper[columns]
        effect, ways = np.zeros(len(own)), []
        for sample in (joints[columns], *rng.uniform(low, high, (_SAMPLES, len(low)))):
            joints[columns] = sample
            J = pin.computeFrameJacobian(
                self._model, self._data, self._q(joints), frame, pin.LOCAL_WORLD_ALIGNED
            )
            pin.updateFramePlacements(self._model, self._data)
            foot = self._data.oMf[frame].translation
            ways.append([foot - self._data.oMi[j].translation for j in own])
            along = ways[-1][0] / max(np.linalg.norm(ways[-1][0]), 1e-9)
            effect += np.abs([along @ J[:3, self._model.joints[j].idx_v] for j in own])
        knee = int(np.argmax(effect))
        hip = max(knee - 1, 0)
        return own[hip], own[knee], float(np.linalg.norm(np.array(ways)[:, hip], axis=1).max())

    @property
    def _base_columns(self) -> int:
        return self._coupling.T.shape[1] - len(self._relaxed)

    def _q(self, joints: Array) -> Array:
        base = pin.neutral(self._model)[: self._base]
        return self._coupling.expand(np.concatenate([base, joints]))

    def _move(self, joints: Array) -> None:
        pin.framesForwardKinematics(self._model, self._data, self._q(joints))

    def _foot(self, leg: _Leg) -> Array:
        return self._up @ self._data.oMf[leg.frame].translation

    def _place(self, joint: int) -> Array:
        return self._up @ self._data.oMi[joint].translation

    def _solve(self, leg: _Leg, target: Array, joints: Array, seeds: int) -> Array | None:
        """Positions (n,) with a leg's foot at a place; the most natural of what starts find.

        Args:
            leg: the leg.
            target: (3,) where its foot stands, m.
            joints: (n,) of the others, and the first start.
            seeds: how many starts more.
        """
        low, high = self._lower[leg.columns], self._upper[leg.columns]
        starts = np.random.default_rng(0).uniform(low, high, (seeds, len(low)))
        found = [
            self._descend(leg, target, joints, start) for start in (joints[leg.columns], *starts)
        ]
        stands = [one for one in found if one is not None]
        if not stands:
            return None
        far = [float(np.square((one - self._relaxed)[leg.columns]).sum()) for one in stands]
        near = [one for one, cost in zip(stands, far, strict=True) if cost < min(far) + _ALIKE]
        return max(near, key=lambda one: self._knee(leg, one))

    def _knee(self, leg: _Leg, joints: Array) -> float:
        """How far the knee is to the side where it is expected, m: in front of a humanoid's leg,
        behind a quadruped's."""
        self._move(joints)
        forward = self._place(leg.knee)[0]
        side = 1.0 if len(self._legs) == 2 else -1.0
        return float(round(side * (forward - self._foot(leg)[0]), 3))

    def _descend(self, leg: _Leg, target: Array, joints: Array, start: Array) -> Array | None:
        """Gauss-Newton from one start, kept within the limits; None if the foot does not stand."""
        joints = joints.copy()
        joints[leg.columns] = start
        for _ in range(_STEPS):
            error, jacobian = self._error(leg, target, joints)
            if np.abs(error).max() < 0.1 * _PLACED:
                break
            square = jacobian @ jacobian.T
            square += (_DAMPING + 1e-3 * float(error @ error)) * np.eye(len(error))
            step = -jacobian.T @ np.linalg.solve(square, error)
            step *= min(1.0, 0.5 / max(np.abs(step).max(), 1e-9))
            joints[leg.columns] = np.clip(
                joints[leg.columns] + step, self._lower[leg.columns], self._upper[leg.columns]
            )
        error, _ = self._error(leg, target, joints)
        wide = np.abs(error[:2]).max() < _ASIDE * _UNREACHED and np.abs(error[2:]).max() < _PLACED
        return joints if wide else None

    def _error(self, leg: _Leg, target: Array, joints: Array) -> tuple[Array, Array]:
        """Errors of a foot and their Jacobian: place, and of a sole its rotation."""
        q = self._q(joints)
        pin.computeJointJacobians(self._model, self._data, q)
        pin.updateFramePlacements(self._model, self._data)
        J = pin.getFrameJacobian(self._model, self._data, leg.frame, pin.LOCAL_WORLD_ALIGNED)
        J = J @ self._coupling.T[:, self._base_columns + leg.columns]
        scale = np.array([_ASIDE, _ASIDE, 1.0])
        error, jacobian = scale * (self._foot(leg) - target), scale[:, None] * (self._up @ J[:3])
        if self._kind is ContactKind.SURFACE:
            turned = self._up @ self._data.oMf[leg.frame].rotation @ leg.level.T
            error = np.concatenate([error, pin.log3(turned)])
            jacobian = np.vstack([jacobian, self._up @ J[3:]])
        return error, jacobian
