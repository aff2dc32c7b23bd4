"""Which links of a robot are its feet: where its lowest limbs end."""

import re
from collections.abc import Sequence
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from sealag.robot._contact import Contact, ContactKind
from sealag.robot._mimic import UNLIMITED
from sealag.robot._shapes import Balls, Shapes
from sealag.typing import Array

_FOOT = ("sole", "foot", "feet", "toe", "toes", "paw", "hoof")
_LEG = (*_FOOT, "leg", "ankle", "knee", "calf", "shank", "thigh", "hip", "kfe", "hfe", "haa")
_HAND = ("arm", "hand", "finger", "gripper", "wrist", "elbow", "shoulder", "thumb", "rotor")
_SENSOR = {"imu", "sensor", "ft", "skin", "camera", "optical", "dh", "world", "marker"}
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
"""Quaternion x, y, z, w of a base whose z axis is up."""

_OWN_JOINTS = 2  # that a leg has at least: with one it is a wheel, a rotor or a gripper's finger
_SOLE_JOINTS = 5  # from which a leg can keep a sole flat on the ground while the base moves
_SHARED_JOINTS = 3  # that legs may have in common: a waist; fingers share an arm
_LEVEL = 0.05  # of the robot's height: feet stand less apart than this, limbs of other kinds more
_NEAR = 0.15  # of the robot's height: how far above the ground an ankle may be, and no knee is
_PATCH = 0.01  # m above its lowest point, what of a sole touches the ground
_ALONG = 0.995  # cosine of 6°: how far from vertical the z axis of a sole's frame may be
_LEAST_SOLE = 0.02  # m: what is smaller both ways is a point
_ATTITUDES = (
    pin.SE3.Identity(),
    pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2.0, 0.0, 0.0), np.zeros(3)),
    pin.SE3(pin.rpy.rpyToMatrix(0.0, -np.pi / 2.0, 0.0), np.zeros(3)),
)
"""How the base may stand: its z axis up, its y axis, or its x axis."""


class Feet(NamedTuple):
    """The feet of a robot and how they were found.

    Attributes:
        legs: how many limbs are legs; of some robots no frame marks where they end.
        contacts: one of each foot; without legs those of limbs whose ends are called feet.
        half_length: m along x of a sole's frame; None if no shape tells it.
        half_width: m along y; None if no shape tells it.
        upright: (4,) quaternion x, y, z, w of the base where the robot stands upright.
        reason: a clause, such as "4 limbs with names of legs end in LF_FOOT, ...".
    """

    legs: int
    contacts: tuple[Contact, ...]
    half_length: float | None
    half_width: float | None
    upright: tuple[float, ...]
    reason: str

    @property
    def frames(self) -> list[str]:
        """Names of the feet's frames."""
        return [contact.frame for contact in self.contacts]


class _Limb(NamedTuple):
    """A chain of joints that no other limb continues.

    Attributes:
        end: number of its last joint.
        chain: numbers of all its joints from the root on.
        own: numbers of those that no other limb of its kind has.
    """

    end: int
    chain: tuple[int, ...]
    own: tuple[int, ...] = ()


def find_feet(model: Any, urdf: Path | None, postures: Sequence[Array]) -> Feet:
    """Find the feet of a robot.

    Legs are two or more limbs of equally many joints, two or more of them their own, that reach
    equally low. Where joints and links have names of legs, these decide which limbs they are; where
    they have none, legs come in pairs that mirror each other, nothing else reaches lower, and names
    of arms exclude.

    Args:
        model: the Pinocchio model of what moves.
        urdf: its file, for the links' shapes.
        postures: configurations of the model to look at, the best first: those where the legs
            point down and soles are level.
    """
    shapes = Shapes(urdf)
    level = _Search(model, shapes, postures[0], _ATTITUDES[0])
    named = level.named_legs()
    if not named:
        legs = level.unnamed_legs()
        return level.feet_of(legs, "limbs reach lowest") if legs else level.none()
    for q, upright in product(postures, _ATTITUDES):
        search = _Search(model, shapes, q, upright)
        if search.stands_on(named):
            return search.feet_of(named, "limbs with names of legs")
    return level.called_feet(named)


def _no_frames(legs: int, reason: str) -> Feet:
    return Feet(legs, (), None, None, UPRIGHT, reason)


class _Search:
    """A model in one configuration, with the shapes of its bodies.

    Args:
        model: the Pinocchio model.
        shapes: of its links.
        q: its configuration.
        upright: where its base stands.
    """

    def __init__(self, model: Any, shapes: Shapes, q: Array, upright: pin.SE3) -> None:
        self._model, self._shapes, self._upright = model, shapes, upright
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        self._at = [upright * placement for placement in data.oMi]
        self._base = 1 if model.njoints > 1 and model.joints[1].nv == 6 else 0
        self._joints = range(self._base + 1, model.njoints)
        self._links: dict[int, list[Any]] = {j: [] for j in range(model.njoints)}
        for frame in model.frames:
            if frame.type == pin.FrameType.BODY:
                self._links[frame.parentJoint].append(frame)
        self._balls: dict[int, Balls | None] = {}

    def named_legs(self) -> list[_Limb]:
        """Limbs whose joints or links have names of legs, as many as there are of one kind."""
        kinds = [
            self._separated([limb for limb in limbs if self._called(limb, _LEG)])
            for limbs in self._by_length()
        ]
        return max(kinds, key=len, default=[])

    def unnamed_legs(self) -> list[_Limb]:
        """Limbs in mirrored pairs that reach lower than all else."""
        found = []
        for limbs in self._by_length():
            lowest = min(self._lowest(limb.end) for limb in limbs)
            level = [o for o in limbs if self._lowest(o.end) < lowest + _LEVEL * self._size]
            legs = self._separated(level)
            arms = any(self._called(limb, _HAND) for limb in legs)
            if legs and not arms and self._mirrored(legs) and self.stands_on(legs):
                found.append(legs)
        return found[0] if len(found) == 1 else []

    def stands_on(self, limbs: Sequence[_Limb]) -> bool:
        """Whether limbs end equally low, and nothing else reaches as low."""
        ends = [self._lowest(limb.end) for limb in limbs]
        own = {j for limb in limbs for j in limb.own}
        rest = min(self._lowest(j) for j in (self._base, *self._joints) if j not in own)
        margin = _LEVEL * self._size
        return max(ends) - min(ends) < margin and max(ends) < rest - margin

    def none(self) -> Feet:
        """What is said of a robot without legs; contacts are ends that are called feet."""
        reason = "no two limbs reach the ground as legs do"
        named = [self._named(end) for end in self._ends()]
        called = [min(some, key=self._frame_height).name for some in named if some]
        if called:
            reason = f"{reason}, though {', '.join(called[:4])} is called a foot"
        contacts = tuple(Contact(frame=name) for name in called)
        return _no_frames(0, reason)._replace(contacts=contacts)

    def feet_of(self, legs: Sequence[_Limb], what: str) -> Feet:
        """The feet at the ends of legs.

        Args:
            legs: the limbs.
            what: what they are called in the reason.
        """
        frames = [self._frame(limb.end) for limb in legs]
        names = [frame.name for frame in frames if frame is not None]
        if len(names) < len(legs):
            ends = [self._links[o.end][0].name for o, f in zip(legs, frames, strict=True) if not f]
            return _no_frames(
                len(legs),
                f"{len(legs)} {what} end on the ground, but no link's frame is there: add a link "
                f"by a fixed joint, or in MJCF a site, at the tip of {', '.join(ends)}",
            )
        kind, half = self._soles(legs, frames)
        contacts = tuple(Contact(frame=name, kind=kind) for name in names)
        turned = pin.Quaternion(self._upright.rotation).coeffs()
        return Feet(
            len(legs),
            contacts,
            *(half or (None, None)),
            tuple(np.round(turned, 6).tolist()),
            f"{len(legs)} {what} end in {', '.join(names)}{self._tilt(kind, frames)}"
            f"{self._unseen(kind, legs, frames)}",
        )

    def _unseen(self, kind: ContactKind, legs: Sequence[_Limb], frames: Sequence[Any]) -> str:
        """A clause on points that are at the leg's last joint, with no shape that says they are
        its tip; empty if there is none."""
        if kind is ContactKind.SURFACE:
            return ""
        for limb, frame in zip(legs, frames, strict=True):
            at_joint = float(np.linalg.norm(frame.placement.translation)) < _PATCH
            named = any(frame.name == other.name for other in self._named(limb.end))
            if at_joint and not named and self._shape(limb.end) is None:
                return (
                    f" (no shape says where {frame.name} touches the ground: its frame is at its "
                    "joint; if that is a knee, add a link by a fixed joint, or in MJCF a site, at "
                    "its tip)"
                )
        return ""

    def _tilt(self, kind: ContactKind, frames: Sequence[Any]) -> str:
        """A clause on soles whose frames are not level; empty if all are."""
        tilted = [f.name for f in frames if self._placed(f).rotation[2, 2] < _ALONG]
        if kind is ContactKind.POINT or not tilted:
            return ""
        return f" (the z axis of {tilted[0]} is not up, as `sealag simulate` needs it of a sole)"

    def called_feet(self, legs: Sequence[_Limb]) -> Feet:
        """The feet of legs that do not point down, if links at their ends are called so.

        Args:
            legs: the limbs.
        """
        frames = [self._named(limb.end) for limb in legs]
        names = [some[0].name for some in frames if some]
        if len(names) < len(legs):
            return _no_frames(
                len(legs),
                f"{len(legs)} limbs have names of legs, but do not end equally low below the base "
                "where the joints are at 0, and no link at their ends is called a foot",
            )
        kind = ContactKind.SURFACE if self._flat(legs) else ContactKind.POINT
        contacts = tuple(Contact(frame=name, kind=kind) for name in names)
        reason = f"{len(legs)} limbs with names of legs end in links called {', '.join(names)}"
        return _no_frames(len(legs), reason)._replace(contacts=contacts)

    def _by_length(self) -> list[list[_Limb]]:
        """Limbs by the number of their joints, two or more of each."""
        kinds: dict[int, list[_Limb]] = {}
        for end in self._ends():
            chain = tuple(self._model.supports[end])[1 + self._base :]
            kinds.setdefault(len(chain), []).append(_Limb(end, chain))
        return [limbs for limbs in kinds.values() if len(limbs) >= 2]

    def _ends(self) -> list[int]:
        """Last joints of limbs; toes are part of a foot that reaches as low."""
        ends = set(self._joints) - set(self._model.parents)
        below = self._lowest(self._base) - _LEVEL * self._size
        for end in sorted(ends):
            parent = self._model.parents[end]
            if parent > self._base and self._shape(parent) and self._shape(end):
                apart = self._lowest(parent) - self._lowest(end)
                if abs(apart) < _PATCH and self._lowest(parent) < below:
                    ends = (ends - {end}) | {parent}
        inner = {j for end in ends for j in tuple(self._model.supports[end])[:-1]}
        return sorted(ends - inner)

    def _separated(self, limbs: Sequence[_Limb]) -> list[_Limb]:
        """The limbs with the joints that each has for itself; empty if they are too few for legs,
        or hang on a long common chain."""
        found = []
        for limb in limbs:
            others = {j for other in limbs if other is not limb for j in other.chain}
            own = tuple(j for j in limb.chain if j not in others)
            shared, wheel = len(limb.chain) - len(own), self._wheel(limb.end)
            if len(own) - wheel >= _OWN_JOINTS and shared <= _SHARED_JOINTS:
                found.append(limb._replace(own=own))
        return found if len(found) == len(limbs) >= 2 else []

    def _wheel(self, joint: int) -> bool:
        """Whether a body turns without end about an axis through its own middle."""
        at, balls = self._model.joints[joint], self._shape(joint)
        endless = at.nv == 1 and self._model.upperPositionLimit[at.idx_q] > UNLIMITED
        if not endless or balls is None:
            return False
        own = balls.moved(self._at[joint].inverse()).center
        low, high = own.min(axis=0), own.max(axis=0)
        off = np.cross(np.ravel(at.createData().S)[3:], (low + high) / 2.0)
        return bool(np.linalg.norm(off) < 0.1 * (high - low).max())

    def _mirrored(self, limbs: Sequence[_Limb]) -> bool:
        """Whether each limb has one on the other side, and more than two stand on an area."""
        ends = np.array([self._at[limb.end].translation[:2] for limb in limbs])
        near = _LEVEL * self._size
        paired = all(
            np.abs(ends - end * [1.0, -1.0]).max(axis=1).min() < near and abs(end[1]) > near / 2.0
            for end in ends
        )
        return paired and (len(ends) == 2 or bool(np.ptp(ends[:, 0]) > 2.0 * near))

    def _called(self, limb: _Limb, words: Sequence[str]) -> bool:
        """Whether names of a limb's last joints and links end with one of the words."""
        last = (limb.own or limb.chain)[-6:]
        names = [self._model.names[j] for j in last]
        names += [frame.name for j in last for frame in self._links[j]]
        return any(_ends_with(name, words) for name in names)

    @cached_property
    def _size(self) -> float:
        """From the lowest to the highest body, m."""
        heights = [self._lowest(j) for j in (self._base, *self._joints)]
        return max(heights) - min(heights)

    def _shape(self, joint: int) -> Balls | None:
        """The balls of a joint's body, in the world; None if no shape of it can be read."""
        if joint not in self._balls:
            found = []
            for frame in self._links[joint]:
                balls = self._shapes.of_link(frame.name)
                if balls is not None:
                    found.append(balls.moved(self._at[joint] * frame.placement))
            parts = zip(*found, strict=True)
            self._balls[joint] = Balls(*(np.concatenate(part) for part in parts)) if found else None
        return self._balls[joint]

    def _lowest(self, joint: int) -> float:
        """How low a joint's body reaches, m: its shapes, or without any its links' frames."""
        balls = self._shape(joint)
        if balls is not None:
            return balls.lowest
        own = float(self._at[joint].translation[2])
        return min([own, *(self._frame_height(frame) for frame in self._links[joint])])

    def _placed(self, frame: Any) -> pin.SE3:
        return self._at[frame.parentJoint] * frame.placement

    def _frame(self, joint: int) -> Any:
        """The link of a limb's end that touches the ground; None if none is near it.

        Names of soles go before names of feet; without such a name the link that the joint moves
        goes first. Of several it is the lowest.
        """
        every = [frame for frame in self._links[joint] if not _of_sensor(frame.name)]
        for frames in (self._named(joint), every[:1], every):
            for frame in sorted(frames, key=self._frame_height):
                if self._frame_height(frame) - self._lowest(joint) < _NEAR * self._size:
                    return frame
        return None

    def _named(self, joint: int) -> list[Any]:
        """The links of a body that are called soles; without one those that are called feet."""
        every = [frame for frame in self._links[joint] if not _of_sensor(frame.name)]
        soles = [frame for frame in every if _ends_with(frame.name, ("sole",))]
        return soles or [frame for frame in every if _ends_with(frame.name, _FOOT)]

    def _frame_height(self, frame: Any) -> float:
        return float(self._placed(frame).translation[2])

    def _flat(self, legs: Sequence[_Limb]) -> bool:
        """Whether legs can keep soles flat on the ground."""
        flat = all(len(o.own) >= _SOLE_JOINTS and not self._wheel(o.end) for o in legs)
        return flat and len(legs) == 2

    def _soles(
        self, legs: Sequence[_Limb], frames: Sequence[Any]
    ) -> tuple[ContactKind, tuple[float, float] | None]:
        """What the feet are, and half length and width of soles, m."""
        if not self._flat(legs):
            return ContactKind.POINT, None
        sizes = []
        for limb, frame in zip(legs, frames, strict=True):
            balls = self._shape(limb.end)
            if balls is not None:
                at = self._placed(frame)
                if at.rotation[2, 2] < _ALONG:  # the plane of a sole is its frame's x and y
                    return ContactKind.SURFACE, None
                low = balls.center[:, 2] - balls.radius < balls.lowest + _PATCH
                own = (balls.center[low] - at.translation) @ at.rotation
                sizes.append(np.ptp(own, axis=0)[:2] / 2.0)
        if not sizes:
            return ContactKind.SURFACE, None
        length, width = np.min(sizes, axis=0).tolist()
        if max(length, width) < _LEAST_SOLE:
            return ContactKind.POINT, None
        return ContactKind.SURFACE, (length, width)


def _words(name: str) -> list[str]:
    """The words of a name: `LeftFootIMU`, `left_foot_imu` and `LEFT-FOOT-IMU` have the same."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def _ends_with(name: str, endings: Sequence[str]) -> bool:
    """Whether a word of a name ends with one of some words: `LLEG`, `lowerleg` with leg."""
    return any(word.endswith(tuple(endings)) for word in _words(name) or [""])


def _of_sensor(name: str) -> bool:
    return not _SENSOR.isdisjoint(_words(name))
