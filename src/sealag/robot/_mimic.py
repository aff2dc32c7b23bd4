"""Joints that follow others: mimic joints, and how a tree moves with the coordinates that lead."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from sealag.errors import RobotError, SealagError, near
from sealag.robot._urdf import ROOT_JOINT, number
from sealag.typing import Array, IntArray

UNLIMITED = 1e8  # rad, m, Nm, N: what a larger limit limits is no robot
_SINGLE = ("revolute", "continuous", "prismatic")
_DEFAULTS = {"multiplier": "1", "offset": "0"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Follower:
    """A mimic joint: its position is multiplier * q_leader + offset, it has no coordinate.

    Attributes:
        leader: the joint that it follows; of a chain of mimic joints the first, which leads.
        multiplier: rad or m per rad or m of the leader.
        offset: rad or m where the leader is at 0.
    """

    leader: str
    multiplier: float
    offset: float

    def position(self, leader: float) -> float:
        """Return where it is, rad or m.

        Args:
            leader: position of its leader, rad or m.
        """
        return self.multiplier * leader + self.offset


class Mimics(NamedTuple):
    """The movable joints of a URDF that mimic others.

    Attributes:
        followers: each with the joint that leads it.
        astray: those that mimic a joint that does not exist, with what is wrong.
    """

    followers: dict[str, Follower]
    astray: dict[str, SealagError]


def read_followers(root: Element, path: Path) -> Mimics:
    """Return the movable joints of a URDF that mimic others.

    Args:
        root: the URDF's root element.
        path: what messages call it.

    Raises:
        RobotError: joints mimic each other in a circle, a multiplier or offset is not finite, or a
            joint has more than one degree of freedom.
    """
    kinds = {joint.get("name", ""): joint.get("type", "") for joint in root.iterfind("joint")}
    direct: dict[str, Follower] = {}
    astray: dict[str, SealagError] = {}
    for joint in root.iterfind("joint"):
        name, mimic = joint.get("name", ""), joint.find("mimic")
        if mimic is None or joint.get("type") == "fixed":
            continue
        leader = mimic.get("joint", "")
        if leader in kinds:
            direct[name] = _mimic(name, mimic.attrib, kinds, path)
        else:
            what = f"joint (that joint {name} mimics) of {path.name}"
            astray[name] = near(leader, kinds, what=what)
    return Mimics({name: _resolved(name, direct, path) for name in direct}, astray)


def _mimic(name: str, said: Mapping[str, str], kinds: Mapping[str, str], path: Path) -> Follower:
    """What the URDF says of one mimic joint."""
    leader = said.get("joint", "")
    for one in (name, leader):
        if kinds[one] not in (*_SINGLE, "fixed"):
            raise RobotError(
                f"{path}: joint {name} mimics {leader}, but {one} is {kinds[one]}; both must be "
                "revolute, continuous or prismatic."
            )
    numbers = {key: number(said.get(key, default)) for key, default in _DEFAULTS.items()}
    for key, value in numbers.items():
        if not math.isfinite(value):
            raise RobotError(
                f"{path}: the {key} of joint {name}, which mimics {leader}, is "
                f"{said.get(key, '')!r}; it must be a finite number."
            )
    return Follower(leader=leader, **numbers)


def _resolved(name: str, direct: Mapping[str, Follower], path: Path) -> Follower:
    """A follower of the joint at the end of its chain."""
    found, way = direct[name], [name]
    while found.leader in direct:
        if found.leader in way:
            raise RobotError(
                f"{path}: joints {', '.join(way)} mimic each other in a circle; one must lead."
            )
        way.append(found.leader)
        ahead = direct[found.leader]
        found = Follower(
            leader=ahead.leader,
            multiplier=found.multiplier * ahead.multiplier,
            offset=found.position(ahead.offset),
        )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Coupling:
    """How the joints of a model move with a robot's own coordinates: v_model = T v.

    Attributes:
        T: (nv_model, nv).
        offset: (joints of the model,) rad or m, where the leaders are at 0.
        own: (n,) places of the robot's joints among the model's.
    """

    T: Array
    offset: Array
    own: IntArray

    @property
    def trivial(self) -> bool:
        """Whether no joint follows another."""
        return len(self.own) == len(self.offset)

    def expand(self, q: Array) -> Array:
        """Return the model's configuration.

        Args:
            q: (nq,) of the robot.
        """
        if self.trivial:
            return q
        count, n = len(self.offset), len(self.own)
        base, joints = q[: len(q) - n], q[len(q) - n :]
        return np.concatenate([base, self.T[-count:, -n:] @ joints + self.offset])

    def restrict(self, of_model: Array) -> Array:
        """Return the robot's own part of what is laid out as the model's q or v.

        Args:
            of_model: (nq_model,) or (nv_model,).
        """
        if self.trivial:
            return of_model
        first = len(of_model) - len(self.offset)
        return np.concatenate([of_model[:first], of_model[first:][self.own]])


def couple(model: Any, followers: Mapping[str, Follower]) -> Coupling:
    """Return how a model's joints move with those that follow no other one.

    Args:
        model: the Pinocchio model of leaders and followers; its base comes first, and all other
            joints have one degree of freedom.
        followers: by joint name.
    """
    names = [str(name) for name in model.names[1:] if name != ROOT_JOINT]
    leaders = [name for name in names if name not in followers]
    base, count = model.nv - len(names), len(names)
    T, offset = np.zeros((model.nv, base + len(leaders))), np.zeros(count)
    T[:base, :base] = np.eye(base)
    for k, name in enumerate(names):
        follower = followers.get(name, Follower(leader=name, multiplier=1.0, offset=0.0))
        T[base + k, base + leaders.index(follower.leader)] = follower.multiplier
        offset[k] = follower.offset
    own = np.array([names.index(name) for name in leaders], dtype=np.int64)
    return Coupling(T=T, offset=offset, own=own)


def position_limits(model: Any, coupling: Coupling, path: Path) -> tuple[Array, Array]:
    """Return lower and upper limits (n,) of the robot's joints, so that followers keep theirs too.

    Args:
        model: the Pinocchio model of leaders and followers.
        coupling: how they move together.
        path: what messages call it.

    Raises:
        RobotError: a follower's limits leave its leader no position.
    """
    count, n = len(coupling.offset), len(coupling.own)
    ends = np.stack([model.lowerPositionLimit[-count:], model.upperPositionLimit[-count:]])
    free = (np.abs(ends).max(axis=0) > UNLIMITED) | (ends == 0.0).all(axis=0)
    ends[:, free] = [[-np.inf], [np.inf]]
    limits, names = ends[:, coupling.own].copy(), list(model.names[-count:])
    for k in set(range(count)) - set(coupling.own.tolist()):
        row = coupling.T[-count + k, -n:]
        at = int(np.flatnonzero(row)[0])
        low, high = np.sort((ends[:, k] - coupling.offset[k]) / row[at])
        limits[0, at], limits[1, at] = max(limits[0, at], low), min(limits[1, at], high)
        if limits[0, at] > limits[1, at]:
            raise RobotError(
                f"{path}: joint {names[k]} follows {names[coupling.own[at]]}, whose limits "
                f"{ends[0, coupling.own[at]]:g} … {ends[1, coupling.own[at]]:g} would put it "
                f"outside its own, {ends[0, k]:g} … {ends[1, k]:g}; correct <limit> or <mimic>."
            )
    return limits[0], limits[1]
