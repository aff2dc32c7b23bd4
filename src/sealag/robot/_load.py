"""Reading a URDF: finding it, checking it, locking what is not actuated."""

import hashlib
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from sealag.errors import FileError, RobotError, UnknownNameError, either, near

LARGEST_URDF_BYTES = 50_000_000


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


def read_model(path: Path, *, floating_base: bool) -> tuple[Any, str]:
    """Read a URDF into a Pinocchio model with all its joints.

    Args:
        path: the URDF.
        floating_base: whether the root link is free to move.

    Returns:
        The model and the file's SHA-256.

    Raises:
        FileError: the file is missing, unreadable or too large.
        RobotError: it is not a URDF, or one that Pinocchio cannot build.
    """
    content = _read(path)
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise RobotError(f"{path} is not well-formed XML: {error}.") from error
    if root.tag != "robot" or root.find("link") is None:
        raise RobotError(f"{path} is not a URDF: it needs a <robot> with at least one <link>.")
    if root.find("joint") is None:
        raise RobotError(f"{path} has no joints, so there is nothing to actuate.")
    for joint in root.iterfind("joint[@type='continuous']"):
        _unlimit(joint)
    text = ElementTree.tostring(root, encoding="unicode")
    try:
        with _quiet():
            model = (
                pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
                if floating_base
                else pin.buildModelFromXML(text)
            )
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise RobotError(f"{path} cannot be read as a robot: {reason}.") from error
    _check_inertias(model, path)
    return model, hashlib.sha256(content).hexdigest()


def _unlimit(joint: ElementTree.Element) -> None:
    """Make a continuous joint a revolute one without limits: its position is one number."""
    joint.set("type", "revolute")
    limit = joint.find("limit")
    if limit is None:
        limit = ElementTree.SubElement(joint, "limit", effort="1e9", velocity="1e9")
    limit.set("lower", "-1e9")
    limit.set("upper", "1e9")


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > LARGEST_URDF_BYTES:
            raise RobotError(f"{path} is larger than {LARGEST_URDF_BYTES // 10**6} MB.")
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"The URDF {path} cannot be read: {error.strerror or error}.") from error
    if not content.strip():
        raise RobotError(f"{path} is empty; a URDF is needed.")
    return content


def _check_inertias(model: Any, path: Path) -> None:
    masses = [inertia.mass for inertia in model.inertias[1:]]
    if not np.isfinite(masses).all() or min(masses, default=0.0) < 0.0 or not sum(masses) > 0.0:
        raise RobotError(f"{path} gives the robot no positive, finite mass; add <inertial> tags.")


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what the URDF parser prints to standard error from the user."""
    sys.stderr.flush()
    saved = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


def reduce_model(model: Any, path: Path, *, actuated: Sequence[str] | None) -> Any:
    """Lock every movable joint that is not actuated at its neutral position.

    Args:
        model: the whole model.
        path: what messages call it.
        actuated: names of the joints that have actuators; None for all.

    Raises:
        UnknownNameError: an actuated joint does not exist.
        RobotError: no joint is left, or one has more than one degree of freedom.
    """
    movable = [name for name in model.names[1:] if name != "root_joint"]
    names = movable if actuated is None else list(actuated)
    for name in names:
        if name not in movable:
            raise near(name, movable, what=f"joint of {path.name}")
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
