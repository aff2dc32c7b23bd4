"""Reading a URDF: finding it, checking it, locking what is not actuated."""

import hashlib
import math
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from sealag.errors import FileError, RobotError, UnknownNameError, either, near
from sealag.files import read_whole

LARGEST_URDF_BYTES = 50_000_000
_ROOT = "root_joint"  # Pinocchio's name for the joint of a floating base
_ENDS = ("lower", "upper")
_INDEFINITE = 1e-6  # relative: what rounding in a URDF does to a principal inertia
_LEAST_INERTIA = 1e-9  # kg m², kg: of what an actuated joint moves
_SINGULAR = 1e-9  # least eigenvalue of the mass matrix scaled to a unit diagonal


def bundled_robot_path(name: str) -> Path:
    """Return the path of a robot that ships with sealag.

    Args:
        name: such as `hume` or `hume.urdf`.

    Raises:
        UnknownNameError: there is no such robot.
    """
    folder = Path(str(resources.files("sealag.data")))
    path = folder / (name if name.endswith(".urdf") else f"{name}.urdf")
    if not path.is_file():
        known = [found.stem for found in folder.glob("*.urdf")]
        raise UnknownNameError(f"No bundled robot is called {name!r}; there is {either(known)}.")
    return path


def example_robot_path(relative: str) -> Path:
    """Return the path of a file of the package `example-robot-data`.

    Args:
        relative: path below its `robots` folder, such as
            `anymal_b_simple_description/robots/anymal.urdf`.

    Raises:
        FileError: the package or the file is not there.
    """
    roots = [
        Path(entry).parent / "cmeel.prefix" / "share" if leaf is None else Path(entry) / leaf
        for entry in sys.path
        for leaf in (None, "cmeel.prefix/share")
    ] + [Path(sys.prefix) / "share"]
    for root in roots:
        path = root / "example-robot-data" / "robots" / relative
        if path.is_file():
            return path
    raise FileError(
        f"The example robot {relative} is not installed; "
        "install the Python package example-robot-data or give the path of your URDF."
    )


def resolve_urdf(text: str, *, relative_to: Path = Path()) -> Path:
    """Turn the way a project file names a URDF into a path.

    Args:
        text: a path, `bundled:hume.urdf` or `example-robot-data:<path below robots>`.
        relative_to: folder from which a relative path starts.

    Raises:
        UnknownNameError: no bundled robot has this name.
        FileError: an example robot is not installed.
    """
    if text.startswith("bundled:"):
        return bundled_robot_path(text.removeprefix("bundled:"))
    if text.startswith("example-robot-data:"):
        return example_robot_path(text.removeprefix("example-robot-data:"))
    return relative_to / Path(text).expanduser()


def read_model(path: Path, *, floating_base: bool) -> tuple[Any, dict[str, str], str]:
    """Read a URDF into a Pinocchio model with all its joints.

    Args:
        path: the URDF.
        floating_base: whether the root link is free to move.

    Returns:
        The model, for each joint that mimics another one the other's name, and the file's SHA-256.

    Raises:
        FileError: the file is missing, unreadable or too large.
        RobotError: it is not a URDF, or one that cannot be a robot; the message gives the reason.
    """
    content = read_whole(path, what="The URDF", largest=LARGEST_URDF_BYTES)
    if not content.strip():
        raise RobotError(f"{path} is empty; a URDF is needed.")
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise RobotError(f"{path} is not well-formed XML: {error}.") from error
    _check_description(root, path)
    for joint in root.iterfind("joint[@type='continuous']"):
        _unlimit(joint)
    text, build = ElementTree.tostring(root, encoding="unicode"), pin.buildModelFromXML
    model, reason = None, ""
    with _overheard() as errors:
        try:
            model = build(text, pin.JointModelFreeFlyer()) if floating_base else build(text)
        except Exception as error:
            reason = " ".join(str(error).split())[:200]
    said = "; ".join(errors) or reason
    if model is None or said:
        raise RobotError(f"{path} cannot be read as a robot: {said.rstrip('.')}.")
    mimics = {
        joint.get("name", ""): mimic.get("joint", "")
        for joint in root.iterfind("joint")
        if (mimic := joint.find("mimic")) is not None
    }
    return model, mimics, hashlib.sha256(content).hexdigest()


def _check_description(root: ElementTree.Element, path: Path) -> None:
    """Refuse what the parser would accept, or refuse without saying why."""
    if any("xacro" in element.tag for element in root.iter()):
        raise RobotError(
            f"{path} is a xacro file; expand it first: xacro {path.name} > robot.urdf."
        )
    if root.tag != "robot" or root.find("link") is None:
        raise RobotError(f"{path} is not a URDF: it needs a <robot> with at least one <link>.")
    if root.find("joint") is None:
        raise RobotError(f"{path} has no joints, so there is nothing to actuate.")
    for joint in root.iterfind("joint"):
        name, limit, axis = joint.get("name", ""), joint.find("limit"), joint.find("axis")
        if name in ("", _ROOT):
            raise RobotError(f"{path}: a joint is called {name!r}; give it another name.")
        lower, upper = (limit.get(key, "0") if limit is not None else "0" for key in _ENDS)
        if _number(lower) > _number(upper):
            raise RobotError(
                f"{path}: the limits of joint {name} are {lower} … {upper}; the lower one must "
                "come first."
            )
        ways = axis.get("xyz", "1 0 0") if axis is not None else "1 0 0"
        if joint.get("type") != "fixed" and not any(map(_number, ways.split())):
            raise RobotError(f"{path}: the axis of joint {name} is zero; it needs a direction.")


def _number(text: str) -> float:
    """A number of the URDF; NaN if it is none, which the parser reports itself."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _unlimit(joint: ElementTree.Element) -> None:
    """Make a continuous joint a revolute one without limits: its position is one number."""
    joint.set("type", "revolute")
    limit = joint.find("limit")
    if limit is None:
        limit = ElementTree.SubElement(joint, "limit", effort="1e9", velocity="1e9")
    limit.set("lower", "-1e9")
    limit.set("upper", "1e9")


@contextmanager
def _overheard() -> Iterator[list[str]]:
    """Keep what the URDF parser prints to standard error from the user, and collect its errors."""
    sys.stderr.flush()
    errors: list[str] = []
    saved = os.dup(2)
    with tempfile.TemporaryFile() as heard:
        try:
            os.dup2(heard.fileno(), 2)
            yield errors
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            heard.seek(0)
            lines = heard.read().decode("utf-8", "replace").splitlines()
    said = [" ".join(line.removeprefix("Error:").split()) for line in lines if "Error:" in line]
    errors += [line.rstrip(".") for line in said if "xml is not initialized" not in line]


def check_inertias(model: Any, path: Path) -> None:
    """Refuse bodies that cannot be, and joints that move almost nothing.

    Args:
        model: the model, whose bodies are links with all that is fixed to them.
        path: what messages call it.

    Raises:
        RobotError: the robot has no mass, a body's mass or inertia is negative, or the mass matrix
            is singular; the message names links and joints.
    """
    links = {f.parentJoint: f.name for f in reversed(model.frames) if f.type == pin.FrameType.BODY}
    for number, body in enumerate(model.inertias[1:], start=1):
        values = np.linalg.eigvalsh(body.inertia)
        if body.mass < 0.0 or values[0] < -_INDEFINITE * max(values[2], _LEAST_INERTIA):
            raise RobotError(
                f"{path}: link {links[number]} has, with what is fixed to it, a mass of "
                f"{body.mass:g} kg and principal inertias {', '.join(f'{v:.3g}' for v in values)} "
                "kg m²; none can be negative."
            )
    if not sum(body.mass for body in model.inertias[1:]) > 0.0:
        raise RobotError(f"{path} gives the robot no positive, finite mass; add <inertial> tags.")
    M = pin.crba(model, model.createData(), pin.neutral(model))
    own = np.diag(M)
    size = np.sqrt(np.maximum(own, np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(M / np.outer(size, size))
    weak = (own < _LEAST_INERTIA) | ((values[0] < _SINGULAR) & (np.abs(vectors[:, 0]) > 0.3))
    if weak.any():
        moved = [
            k for k, j in enumerate(model.joints) if k and weak[j.idx_v : j.idx_v + j.nv].any()
        ]
        names = ", ".join(f"{links.get(k, '?')} (joint {model.names[k]})" for k in moved)
        raise RobotError(
            f"{path} gives almost no inertia to what moves at {names}; correct <inertial> there, "
            "or leave the joint out of robot.actuated."
        )


def reduce_model(
    model: Any, path: Path, *, actuated: Sequence[str] | None, mimics: Mapping[str, str]
) -> Any:
    """Lock every movable joint that is not actuated at its neutral position.

    Args:
        model: the whole model.
        path: what messages call it.
        actuated: names of the joints that have actuators; None for all that mimic no other one.
        mimics: for each joint that mimics another one the other's name.

    Raises:
        UnknownNameError: an actuated joint does not exist.
        RobotError: no joint is left, or one mimics another or has more than one degree of freedom.
    """
    movable = [name for name in model.names[1:] if name != _ROOT]
    names = [j for j in movable if j not in mimics] if actuated is None else list(actuated)
    for name in names:
        if name not in movable:
            raise near(name, movable, what=f"joint of {path.name}")
        if name in mimics:
            raise RobotError(
                f"{path}: joint {name} mimics {mimics[name]} and has no actuator of its own; leave "
                "it out of robot.actuated, it is then locked at 0."
            )
    if len(set(names)) < len(names):
        raise RobotError(f"{path}: an actuated joint is listed twice.")
    if not names:
        raise RobotError(f"{path}: no joint is actuated.")
    locked = [model.getJointId(name) for name in movable if name not in set(names)]
    reduced = pin.buildReducedModel(model, locked, pin.neutral(model)) if locked else model
    for name in names:
        if reduced.joints[reduced.getJointId(name)].nv != 1:
            raise RobotError(
                f"{path}: joint {name} has more than one degree of freedom; "
                "actuated joints must be revolute, continuous or prismatic."
            )
    return reduced
