"""Reading a URDF: checking it, building its model, locking what is not actuated."""

import ctypes
import hashlib
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from sealag.constants import GRAVITY
from sealag.errors import RobotError, SealagError, near
from sealag.robot._document import read_document
from sealag.robot._mimic import Coupling, Follower, read_followers
from sealag.robot._urdf import (
    LEAST_INERTIA,
    ROOT_JOINT,
    check_urdf,
    joint_dynamics,
    kinematics,
    swap_limits,
)
from sealag.typing import Array

_LOG = "libconsole_bridge.so.1.0"
_SET_LOG_LEVEL = "_ZN14console_bridge11setLogLevelENS_8LogLevelE"  # setLogLevel(LogLevel) in C++
_LOG_NOTHING = 4  # CONSOLE_BRIDGE_LOG_NONE
_ACTUATED = {f"JointModel{kind}" for kind in ("RX", "RY", "RZ", "RevoluteUnaligned", "PX", "PY",
                                             "PZ", "PrismaticUnaligned")}  # fmt: skip
"""Pinocchio's revolute and prismatic joints, whose position is one number."""
_ROUNDED = 0.05  # of the largest moment: what two significant digits do to a plate's
_SINGULAR = 1e-9  # least eigenvalue of the mass matrix scaled to a unit diagonal


class Description(NamedTuple):
    """What a URDF says.

    Attributes:
        model: the Pinocchio model with all movable joints, mimic joints too.
        followers: its mimic joints by name.
        astray: why a mimic joint follows nothing, by name: it can only be locked.
        rotors: reflected rotor inertia by joint name; it is not in the model.
        remarks: what is read otherwise than it is written, a sentence each.
        sha256: of the file.
    """

    model: Any
    followers: dict[str, Follower]
    astray: dict[str, SealagError]
    rotors: dict[str, float]
    remarks: tuple[str, ...]
    sha256: str

    @property
    def movable(self) -> list[str]:
        """Names of all joints that are neither fixed nor the free base."""
        return [str(name) for name in self.model.names[1:] if name != ROOT_JOINT]


def read_model(path: Path, *, floating_base: bool) -> Description:
    """Read a URDF into a Pinocchio model with all its joints.

    Args:
        path: the URDF.
        floating_base: whether the root link is free to move.

    Raises:
        FileError: the file is missing, unreadable or too large.
        RobotError: it is not a URDF, or one that cannot be a robot; the message gives the reason.
        UnknownNameError: a joint names a link or joint that does not exist.
    """
    root, content = read_document(path)
    remarks = swap_limits(root)
    check_urdf(root, path)
    followers, astray = read_followers(root, path)
    for joint in root.iterfind("joint[@type='continuous']"):
        _unlimit(joint)
    text = ElementTree.tostring(kinematics(root, path.stem), encoding="unicode")
    model = _build(text, path, floating_base=floating_base)
    _check_bodies(model, path)
    rotors = {j.get("name", ""): joint_dynamics(j).armature for j in root.iterfind("joint")}
    return Description(
        model=model, followers=followers, astray=astray, rotors=rotors, remarks=remarks,
        sha256=hashlib.sha256(content).hexdigest(),
    )  # fmt: skip


def describe_model(model: Any, *, floating_base: bool) -> Description:
    """Describe a Pinocchio model, which stays as it is.

    Args:
        model: the `pinocchio.Model`.
        floating_base: whether its first joint, a free flyer, is the base's.

    Raises:
        RobotError: it has no free base and should have one, mimics, another gravity, or a body that
            cannot be.
    """
    path = Path(model.name or "model")
    own = pin.Model(model)
    gravity = own.gravity.vector
    if not np.allclose(gravity, [0.0, 0.0, -GRAVITY, 0.0, 0.0, 0.0]):
        raise RobotError(f"{path}: the model's gravity is {gravity[:3]}; it must be 0 0 -9.81.")
    for name, joint in list(zip(own.names, own.joints))[1:]:
        if joint.nv == 0:
            raise RobotError(
                f"{path}: joint {name} is one of Pinocchio's mimic joints, which are not read; "
                "give the URDF, whose mimic joints are."
            )
    if _has_free_base(own):
        own = _named_base(own) if floating_base else _lock(own, [1], pin.neutral(own))
    elif floating_base:
        raise RobotError(
            f"{path}: the model has no free base; build it with pinocchio.JointModelFreeFlyer(), "
            "or let floating_base be False."
        )
    _check_bodies(own, path)
    joints = list(zip(own.names, own.joints))[1:]
    rotors = {str(name): float(own.armature[joint.idx_v]) for name, joint in joints}
    own.armature = np.zeros(own.nv)
    return Description(
        model=own, followers={}, astray={}, rotors=rotors, remarks=(),
        sha256=hashlib.sha256(model.saveToString().encode()).hexdigest(),
    )  # fmt: skip


def _build(text: str, path: Path, *, floating_base: bool) -> Any:
    """Build a model whose first joint is the free base, or that has none.

    A URDF whose root joint is floating has its base below that joint.
    """
    _silence_parser()
    try:
        model = pin.buildModelFromXML(text)
        if _has_free_base(model):
            return _named_base(model) if floating_base else _lock(model, [1], pin.neutral(model))
        if not floating_base:
            return model
        return pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    except Exception as error:
        reason = _parser_words(text) or " ".join(str(error).split())[:200]
        raise RobotError(f"{path} cannot be read as a robot: {reason.rstrip('.')}.") from error


def _has_free_base(model: Any) -> bool:
    """Whether all that moves hangs on a single joint that is free."""
    alone = list(model.parents)[1:].count(0) == 1
    return alone and model.joints[1].shortname() == pin.JointModelFreeFlyer().shortname()


def _named_base(model: Any) -> Any:
    """Call the free joint of a model what Pinocchio calls it; its frame too."""
    for frame in model.frames:
        if frame.type == pin.FrameType.JOINT and frame.parentJoint == 1:
            frame.name = ROOT_JOINT
    model.names[1] = ROOT_JOINT
    return model


def _check_bodies(model: Any, path: Path) -> None:
    """Refuse what moves as one if no rigid body can have its inertia (triangle inequality)."""
    links = _links(model)
    for number, body in enumerate(model.inertias[1:], start=1):
        least, middle, largest = np.linalg.eigvalsh(body.inertia)
        if largest - middle - least > _ROUNDED * max(largest, LEAST_INERTIA):
            raise RobotError(
                f"{path}: link {links[number]} has, with what is fixed to it, principal moments of "
                f"inertia {least:.3g}, {middle:.3g} and {largest:.3g} kg m²; no body's largest one "
                "exceeds the sum of the others (triangle inequality): correct <inertia> there."
            )


def _links(model: Any) -> dict[int, str]:
    """The first link that each joint moves, by the joint's number."""
    bodies = (f for f in reversed(model.frames) if f.type == pin.FrameType.BODY)
    return {frame.parentJoint: frame.name for frame in bodies}


def _unlimit(joint: ElementTree.Element) -> None:
    """Make a continuous joint a revolute one without limits: its position is one number."""
    joint.set("type", "revolute")
    limit = joint.find("limit")
    if limit is None:
        limit = ElementTree.SubElement(joint, "limit", effort="1e9", velocity="1e9")
    limit.set("lower", "-1e9")
    limit.set("upper", "1e9")


@cache
def _silence_parser() -> None:
    """Keep the URDF parser from printing its complaints to the process's standard error.

    It logs through console_bridge, which Python does not reach otherwise. Where the library has
    another name, the parser prints.
    """
    with suppress(OSError, AttributeError):
        ctypes.CDLL(_LOG)[_SET_LOG_LEVEL](_LOG_NOTHING)


def _parser_words(text: str) -> str:
    """What the parser says about a URDF that it refuses; heard in a process of its own."""
    program = "import pinocchio, sys; pinocchio.buildModelFromXML(sys.stdin.read())"
    try:
        done = subprocess.run(
            [sys.executable, "-c", program], input=text.encode("utf-8", "replace"),
            capture_output=True, timeout=60, check=False,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return ""
    lines = done.stderr.decode("utf-8", "replace").splitlines()
    said = [line.removeprefix("Error:") for line in lines if line.startswith("Error:")]
    words = [" ".join(line.split()) for line in said if "xml is not initialized" not in line]
    return "; ".join(word.rstrip(".") for word in words)[:300]


def check_inertias(model: Any, coupling: Coupling, path: Path) -> None:
    """Refuse a robot without mass, and joints that move almost nothing.

    Args:
        model: the model of all joints that move.
        coupling: how they move with the robot's coordinates.
        path: what messages call it.

    Raises:
        RobotError: the robot has no mass, or the mass matrix is singular; the message names links
            and joints.
    """
    weak = weak_joints(model, coupling, path)
    if ROOT_JOINT in weak:
        raise RobotError(
            f"{path}: link {weak[ROOT_JOINT]} has almost no inertia and would float; give it an "
            "<inertial>, or let the base be fixed (init --base fixed)."
        )
    if weak:
        names = ", ".join(f"{link} (joint {joint})" for joint, link in weak.items())
        raise RobotError(
            f"{path} gives almost no inertia to what moves at {names}; correct <inertial> there, "
            "or leave the joint out of robot.actuated."
        )


def weak_joints(model: Any, coupling: Coupling, path: Path) -> dict[str, str]:
    """Return the joints that move almost no inertia, alone or together, with their links.

    Args:
        model: the model of all joints that move.
        coupling: how they move with the robot's coordinates.
        path: what messages call it.

    Raises:
        RobotError: the robot has no mass.
    """
    if not sum(body.mass for body in model.inertias[1:]) > 0.0:
        raise RobotError(f"{path} gives the robot no positive, finite mass; add <inertial> tags.")
    q = coupling.expand(coupling.restrict(pin.neutral(model)))
    M = coupling.T.T @ pin.crba(model, model.createData(), q) @ coupling.T
    own = np.diag(M)
    size = np.sqrt(np.maximum(own, np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    weak = (own < LEAST_INERTIA) | ((values[0] < _SINGULAR) & (np.abs(vectors[:, 0]) > 0.3))
    links, velocities = _links(model), coupling.restrict(np.arange(model.nv))[weak]
    return {
        str(model.names[k]): links.get(k, "?")
        for k, joint in enumerate(model.joints)
        if k and ((velocities >= joint.idx_v) & (velocities < joint.idx_v + joint.nv)).any()
    }


def reduce_model(
    said: Description, path: Path, *, actuated: Sequence[str] | None
) -> tuple[Any, dict[str, Follower]]:
    """Lock every joint that neither is actuated nor follows one that is.

    Followers are locked where their leader's neutral position puts them.

    Args:
        said: what the file says.
        path: what messages call it.
        actuated: names of the joints that have actuators; None for all that mimic no other one.

    Returns:
        The model of what moves, and the followers in it.

    Raises:
        UnknownNameError: an actuated joint does not exist, or mimics one that does not.
        RobotError: no joint is left, or one mimics another or has more than one degree of freedom.
    """
    model, followers = said.model, said.followers
    names = _actuated(said, path, actuated=actuated)
    driven = {
        name: follower
        for name, follower in followers.items()
        if follower.leader in names and follower.multiplier != 0.0
    }
    locked, at = [], pin.neutral(model)
    for name in said.movable:
        number = model.getJointId(name)
        if name in followers:
            at[model.joints[number].idx_q] = followers[name].offset
        if name not in names and name not in driven:
            locked.append(number)
    reduced = _lock(model, locked, at) if locked else model
    for name in names:
        problem = not_actuated(reduced.joints[reduced.getJointId(name)])
        if problem:
            raise RobotError(f"{path}: joint {name} {problem}.")
    return reduced, driven


def not_actuated(joint: Any) -> str:
    """Return why a joint of a model cannot have an actuator; empty if it can.

    Args:
        joint: Pinocchio's model of it.
    """
    must = "actuated joints must be revolute, continuous or prismatic"
    if joint.nv != 1:
        return f"has more than one degree of freedom; {must}"
    if joint.shortname() not in _ACTUATED:
        return f"is a {joint.shortname()} of Pinocchio; {must}, with a position of one number"
    return ""


def _actuated(said: Description, path: Path, *, actuated: Sequence[str] | None) -> list[str]:
    """Names of the joints that have actuators, checked."""
    movable, followers = said.movable, said.followers
    if not movable:
        raise RobotError(f"{path}: no joint moves, so there is nothing to actuate.")
    names = [j for j in movable if j not in followers] if actuated is None else list(actuated)
    for name in names:
        if name not in movable:
            raise near(name, movable, what=f"joint of {path.name}")
        if name in said.astray:
            raise said.astray[name]
        if name in followers:
            raise _follows(name, followers[name], path)
    if len(set(names)) < len(names):
        raise RobotError(f"{path}: an actuated joint is listed twice.")
    if not names:
        raise RobotError(f"{path}: no joint is actuated; one at least must be.")
    return names


def _lock(model: Any, joints: Sequence[int], at: Array) -> Any:
    """The model with joints locked where a configuration has them.

    Pinocchio looks for frames by the joints' names alone, which links may share: theirs are others
    meanwhile.
    """
    mark = "link of the URDF: "
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name = mark + frame.name
    reduced = pin.buildReducedModel(model, joints, at)
    for frame in (*model.frames, *reduced.frames):
        if frame.type == pin.FrameType.BODY:
            frame.name = frame.name.removeprefix(mark)
    return reduced


def _follows(name: str, follower: Follower, path: Path) -> RobotError:
    """Say that a mimic joint needs no actuator, and where it is without one."""
    law = f"{follower.multiplier:g} times {follower.leader} plus {follower.offset:g}"
    return RobotError(
        f"{path}: joint {name} mimics {follower.leader} and has no actuator of its own; leave it "
        f"out of robot.actuated: it follows at {law}, and is locked at {follower.offset:g} if "
        f"{follower.leader} is not actuated."
    )
