"""Checks of a URDF as it is written, before the parser merges links that are fixed together."""

import math
from collections import Counter
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from sealag.errors import RobotError, near
from sealag.typing import Array

ROOT_JOINT = "root_joint"
"""Pinocchio's name for the joint of a floating base."""

LEAST_INERTIA = 1e-9  # kg m², kg: of what an actuated joint moves
_RESERVED = ("", ROOT_JOINT, "universe")
_ENDS = ("lower", "upper")
_LINK = ("inertial",)
_JOINT = ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic")
_ENTRIES = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")
_INDEFINITE = 1e-6  # of a body's inertia: what rounding in a URDF does to a principal moment
_PLACEHOLDER = 0.2  # of a body's inertia: sensors and covers fixed to public robots reach 0.15
_MOST_MASS, _MOST_INERTIA, _MOST_LENGTH = 1e15, 1e15, 1e4  # kg, kg m², m: beyond, squares overflow
_MOST_DAMPING = 1e6  # Nms/rad, Nm: as in a project file; more is a slip of the unit


def check_urdf(root: Element, path: Path) -> None:
    """Refuse what the parser would accept, or refuse without saying why.

    Args:
        root: the URDF's root element.
        path: what messages call it.

    Raises:
        RobotError: it is no URDF, its links are no tree, or a link or joint cannot be; the message
            names it, its numbers and a remedy.
        UnknownNameError: a joint names a link that does not exist.
    """
    if root.tag != "robot" or root.find("link") is None:
        raise RobotError(f"{path} is not a URDF: it needs a <robot> with at least one <link>.")
    if root.find("joint") is None:
        raise RobotError(f"{path} has no joints, so there is nothing to actuate.")
    _check_names(root, path)
    _check_tree(root, path)
    for joint in root.iterfind("joint"):
        _check_joint(joint, path)
        _check_origin(joint, f"joint {joint.get('name')}", path)
    for link in root.iterfind("link"):
        for inertial in link.iterfind("inertial"):
            _check_origin(inertial, f"<inertial> of link {link.get('name')}", path)
    _check_inertias(root, path)


def swap_limits(root: Element) -> tuple[str, ...]:
    """Exchange position limits whose lower one is the larger: they can only mean the same range.

    Args:
        root: the URDF's root element, which is changed.

    Returns:
        A sentence for each joint.
    """
    said = []
    for joint in root.iterfind("joint"):
        limit = joint.find("limit")
        if limit is None:
            continue
        lower, upper = (limit.get(key, "0") for key in _ENDS)
        if number(lower) > number(upper):
            limit.set("lower", upper)
            limit.set("upper", lower)
            said.append(
                f"The limits of joint {joint.get('name', '')} are {lower} … {upper} in the file "
                f"and are read as {upper} … {lower}."
            )
    return tuple(said)


def kinematics(root: Element, name: str) -> Element:
    """Return a URDF with what a model of the dynamics needs and nothing else.

    Visuals, collisions, materials, transmissions and what other tools write into the file may be of
    any form.

    Args:
        root: the URDF's root element.
        name: of the robot if the file gives none.
    """
    plain = Element("robot", name=root.get("name") or name)
    for tag, kept in (("link", _LINK), ("joint", _JOINT)):
        for element in root.iterfind(tag):
            own = {key: element.attrib[key] for key in ("name", "type") if key in element.attrib}
            copy = SubElement(plain, tag, own)
            copy.extend(part for part in element if part.tag in kept)
    return plain


def number(text: str) -> float:
    """Return a number of the URDF; NaN if the text is none.

    Args:
        text: an attribute's value.
    """
    try:
        return float(text)
    except ValueError:
        return math.nan


class JointDynamics(NamedTuple):
    """What <dynamics> of a joint says, 0 where it says nothing.

    Attributes:
        damping: viscous, Nms/rad or Ns/m.
        friction: Coulomb, Nm or N.
        armature: reflected rotor inertia, kg m² or kg; MJCF has it, and some URDFs.
    """

    damping: float
    friction: float
    armature: float


def joint_dynamics(joint: Element) -> JointDynamics:
    """Return what <dynamics> of a joint says.

    Args:
        joint: the joint's element.
    """
    given = joint.find("dynamics")
    said = {} if given is None else given.attrib
    return JointDynamics(*(number(said.get(key, "0")) for key in JointDynamics._fields))


def _check_names(root: Element, path: Path) -> None:
    for tag, reserved in (("link", ("",)), ("joint", _RESERVED)):
        names = Counter(element.get("name", "") for element in root.iterfind(tag))
        for name, count in names.items():
            if name in reserved:
                raise RobotError(f"{path}: a {tag} is called {name!r}; give it another name.")
            if count > 1:
                raise RobotError(
                    f"{path}: {count} {tag}s are called {name}; every {tag} needs a name of its "
                    "own."
                )


def _check_tree(root: Element, path: Path) -> None:
    """Refuse links that do not hang together as one tree."""
    links = [link.get("name", "") for link in root.iterfind("link")]
    above: dict[str, tuple[str, str]] = {}  # joint that moves a link, and that joint's parent link
    for joint in root.iterfind("joint"):
        name, ends = joint.get("name", ""), []
        for tag in ("parent", "child"):
            end = joint.find(tag)
            ends.append("" if end is None else end.get("link", ""))
            if not ends[-1]:
                raise RobotError(f'{path}: joint {name} needs <{tag} link="…"/>.')
            if ends[-1] not in links:
                raise near(ends[-1], links, what=f"link ({tag} of joint {name}) of {path.name}")
        parent, child = ends
        if child in above:
            raise RobotError(
                f"{path}: link {child} has two parents, {above[child][1]} (joint "
                f"{above[child][0]}) and {parent} (joint {name}); remove one of the joints: closed "
                "loops are not supported."
            )
        above[child] = name, parent
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise RobotError(
            f"{path}: links {', '.join(roots[:4])}{', …' if len(roots) > 4 else ''} have no "
            "parent; a robot has one root: join the others to it, if need be by fixed joints."
        )
    for link in links:
        way: list[str] = []
        while link in above and link not in way:
            way.append(link)
            link = above[link][1]
        if link in way:
            loop = way[way.index(link) :]
            raise RobotError(
                f"{path}: joints {', '.join(above[one][0] for one in loop)} form a loop through "
                f"links {', '.join(loop)}; the links must be a tree: let one of the joints hang "
                "on a link outside the loop."
            )


def _check_joint(joint: Element, path: Path) -> None:
    name, axis = joint.get("name", ""), joint.find("axis")
    ways = axis.get("xyz", "1 0 0") if axis is not None else "1 0 0"
    if joint.get("type") != "fixed" and not any(map(number, ways.split())):
        raise RobotError(f"{path}: the axis of joint {name} is zero; it needs a direction.")
    for what, value in joint_dynamics(joint)._asdict().items():
        if not 0.0 <= value <= _MOST_DAMPING:
            raise RobotError(
                f"{path}: the {what} of joint {name} is {value:g}; <dynamics> needs a number in "
                f"0 … {_MOST_DAMPING:g}."
            )


def _check_origin(element: Element, owner: str, path: Path) -> None:
    """Refuse places and turns that are no three numbers, or too far away to compute with."""
    origin = element.find("origin")
    for key, unit in (("xyz", "m"), ("rpy", "rad")):
        text = "0 0 0" if origin is None else origin.get(key, "0 0 0")
        values = [number(word) for word in text.split()]
        if len(values) != 3 or not all(abs(value) <= _MOST_LENGTH for value in values):
            raise RobotError(
                f"{path}: {key} of {owner} is {text!r}; it must be three numbers in "
                f"{-_MOST_LENGTH:g} … {_MOST_LENGTH:g} {unit}."
            )


def _check_inertias(root: Element, path: Path) -> None:
    """Refuse links that are no rigid bodies: I ≽ 0 and its largest moment ≤ the other two's sum.

    Deviations are measured against the largest moments of the link and of all that is fixed to it:
    what small parts get wrong is not what moves, which `check_bodies` looks at.
    """
    moments = {
        link.get("name", ""): _principal_moments(link, path) for link in root.iterfind("link")
    }
    body = {name: name for name in moments}

    def rigid(name: str) -> str:
        while body[name] != name:
            name = body[name]
        return name

    for joint in root.iterfind("joint[@type='fixed']"):
        ends = [joint.find(tag) for tag in ("parent", "child")]
        parent, child = (rigid(end.get("link", "")) for end in ends if end is not None)
        body[child] = parent
    size: Counter[str] = Counter()
    for name, values in moments.items():
        size[rigid(name)] += max(float(values[2]), 0.0)  # pyright: ignore[reportArgumentType]
    for name, (least, middle, largest) in moments.items():
        whole = max(size[rigid(name)], LEAST_INERTIA)
        have = f"link {name} has principal moments of inertia {least:.3g}, {middle:.3g} and "
        if least < -_INDEFINITE * whole:
            raise RobotError(
                f"{path}: {have}{largest:.3g} kg m²; none can be negative: correct <inertia> there."
            )
        if largest - middle - least > _PLACEHOLDER * whole:
            raise RobotError(
                f"{path}: {have}{largest:.3g} kg m²; no body's largest one exceeds the sum of the "
                "others (triangle inequality): correct <inertia> there."
            )


def _principal_moments(link: Element, path: Path) -> Array:
    """Principal moments (3,) of a link in rising order, kg m²; 0 without <inertial>."""
    inertial, name = link.find("inertial"), link.get("name", "")
    if inertial is None:
        return np.zeros(3)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise RobotError(f"{path}: <inertial> of link {name} needs both <mass> and <inertia>.")
    weight = mass.get("value", "")
    if not 0.0 <= number(weight) <= _MOST_MASS:
        raise RobotError(
            f"{path}: the mass of link {name} is {weight!r}; it must be a number of kg in "
            f"0 … {_MOST_MASS:g}."
        )
    for key in _ENTRIES:
        if not abs(number(inertia.get(key, ""))) <= _MOST_INERTIA:
            raise RobotError(
                f"{path}: {key} of link {name} is {inertia.get(key, '')!r}; it must be a number "
                f"of kg m² of at most {_MOST_INERTIA:g}."
            )
    return np.linalg.eigvalsh(
        np.array([number(inertia.get(key, "")) for key in _ENTRIES]).reshape(3, 3)
    )
