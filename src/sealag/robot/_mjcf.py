"""MJCF, the format of MuJoCo, as a URDF of the same tree: bodies, joints and their inertia.

Pinocchio's own reader takes no <frame>, reads a second <worldbody> twice, and axisangle, eulerseq,
the range of slides and masses by class otherwise than MuJoCo. What would change the dynamics and is
not translated here is refused.
"""

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from sealag.constants import GRAVITY
from sealag.errors import RobotError
from sealag.files import read_whole
from sealag.robot._urdf import number
from sealag.robot._xml import LARGEST_BYTES, parse_xml
from sealag.typing import Array

WORLD = "world"
_JOINTS = ("joint", "freejoint")
_KINDS = {"hinge": "revolute", "slide": "prismatic", "free": "floating", "ball": "planar"}
"""Joints of MuJoCo as those of a URDF; a ball, like a planar joint, can only be locked."""
_MADE = ("attach", "composite", "flex", "flexcomp", "replicate")
"""Elements that make or bend bodies when MuJoCo compiles them."""
_COMPILED = {
    "settotalmass": "-1", "balanceinertia": "false", "boundmass": "0", "boundinertia": "0",
    "inertiafromgeom": "auto false", "coordinate": "local",
}  # fmt: skip
"""Settings of the compiler that change inertia, and the words that do not."""
_SAVE = "load it in MuJoCo, and write its bodies' inertia into <inertial>"


class _Pose(NamedTuple):
    """Where a body, frame or inertia is in its parent."""

    R: Array  # (3, 3)
    p: Array  # (3,) m

    def __matmul__(self, inner: "_Pose") -> "_Pose":  # type: ignore[override]
        return _Pose(self.R @ inner.R, self.R @ inner.p + self.p)


_HERE = _Pose(np.eye(3), np.zeros(3))


def urdf_of_mjcf(root: Element, path: Path) -> Element:
    """Return a URDF's root element with the tree of an MJCF file.

    Bodies and sites become links below a link world, several joints of a body a chain of them.
    Position limits, damping, friction, armature and the force range of joints are kept, geoms as
    shapes of links; actuators, sensors and key frames are not. A body's only colliding sphere is a
    link too, with its name or `<body>_sphere`: it is the foot of a leg that ends in no body.

    Args:
        root: the root element, files included.
        path: what messages call it.

    Raises:
        RobotError: something that changes the dynamics is not translated: the message names it.
    """
    return _Translation(root, path).urdf()


class _Translation:
    """One file on its way."""

    def __init__(self, root: Element, path: Path) -> None:
        self.root, self.path = root, path
        self.compiler: dict[str, str] = {}
        for one in root.iterfind("compiler"):
            self.compiler |= one.attrib
        self.defaults: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for one in root.iterfind("default"):
            self._read_default(one, self.defaults["main"], "main")
        self.robot = Element("robot", name=root.get("model") or path.stem)
        self.taken: dict[str, set[str]] = {"link": {WORLD}, "joint": set()}
        self.spheres: list[tuple[str, str, _Pose]] = []
        """Name, body's link and place of spheres, which take names that nothing else has."""
        self.meshes = {
            one.get("name") or Path(one.get("file", "")).stem: self._with_defaults(
                one, "mesh", "main"
            )
            for one in root.iterfind("asset/mesh")
            if one.get("file")
        }

    def urdf(self) -> Element:
        self._refuse_what_is_not_read()
        self._link(WORLD)
        for world in self.root.iterfind("worldbody"):
            self._children(world, WORLD, _HERE, "main")
        for name, body, at in self.spheres:
            found = self._new("link", name)
            self._link(found)
            self._fix(body, found, at)
        return self.robot

    def _refuse(self, what: str) -> RobotError:
        return RobotError(f"{self.path}: {what}.")

    def _refuse_what_is_not_read(self) -> None:
        for key, harmless in _COMPILED.items():
            if self.compiler.get(key, "").lower() not in ("", *harmless.split()):
                raise self._refuse(f"compiler {key} is not supported; {_SAVE}")
        for option in self.root.iterfind("option"):
            gravity = self._vector(option, "gravity", 3, f"0 0 -{GRAVITY}")
            if not np.allclose(gravity, [0.0, 0.0, -GRAVITY]):
                raise self._refuse(f"gravity is {_text(gravity)}; it must be 0 0 -{GRAVITY:g}")
            for key in ("density", "viscosity"):
                if self._number(option, key) != 0.0:
                    raise self._refuse(f"the {key} of a fluid is not supported; remove it")
        for constraint in self.root.iterfind("equality/*"):
            if constraint.get("active") != "false":
                raise self._refuse(
                    f"<equality> has a {constraint.tag}; constraints are not supported, the bodies "
                    "must be a tree: remove it"
                )
        for element in self.root.iter():
            if element.tag in _MADE:
                raise self._refuse(f"<{element.tag}> is not supported; save the file in MuJoCo")
            if self._number(element, "gravcomp") != 0.0:
                raise self._refuse("gravcomp is not supported; remove it")
        for tendon in self.root.iterfind("tendon/*"):
            for key in ("stiffness", "damping", "frictionloss", "armature"):
                if self._number(tendon, key) != 0.0:
                    raise self._refuse(f"the {key} of a tendon is not supported; remove it")

    def _read_default(self, one: Element, above: dict[str, dict[str, str]], name: str) -> None:
        own = {tag: dict(values) for tag, values in above.items()}
        for part in one:
            if part.tag != "default":
                own[part.tag] = {**own.get(part.tag, {}), **part.attrib}
        self.defaults[name] = self.defaults[one.get("class", name)] = own
        for inner in one.iterfind("default"):
            self._read_default(inner, own, inner.get("class", ""))

    def _with_defaults(self, element: Element, tag: str, childclass: str) -> Element:
        name = element.get("class", childclass)
        if name not in self.defaults:
            raise self._refuse(f"the default class {name!r} does not exist")
        return Element(tag, {**self.defaults[name].get(tag, {}), **element.attrib})

    def _children(self, holder: Element, link: str, at: _Pose, childclass: str) -> None:
        """Hang bodies and sites of a body, or of a frame in it, on the body's link."""
        for part in holder:
            if part.tag == "body":
                self._body(part, link, at @ self._pose(part), part.get("childclass", childclass))
            elif part.tag == "frame":
                inner = part.get("childclass", childclass)
                self._children(part, link, at @ self._pose(part), inner)
            elif part.tag == "site" and part.get("name"):
                site = self._with_defaults(part, "site", childclass)
                name = self._new("link", part.get("name", ""))
                self._link(name)
                self._fix(link, name, at @ self._pose(site))

    def _body(self, body: Element, parent: str, at: _Pose, childclass: str) -> None:
        name = self._new("link", body.get("name") or f"{parent}_body")
        link = self._link(name)
        self._inertial(body, link, childclass)
        self._shapes(body, link, childclass)
        joints = [one for one in body if one.tag in _JOINTS]
        if any(one.tag == "freejoint" or one.get("type") == "free" for one in joints):
            at = _HERE  # where a free body is drawn is its position, not its joint's place
        centre = np.zeros(3)
        for k, one in enumerate(joints):
            joint = self._with_defaults(one, "joint", childclass) if one.tag == "joint" else one
            pos = self._vector(joint, "pos", 3, "0 0 0")
            last = k == len(joints) - 1 and not pos.any()
            child = name
            if not last:
                child = self._new("link", f"{name}_joint_{k + 1}")
                self._link(child)
            self._joint(joint, one.tag, name, parent, child, at @ _Pose(np.eye(3), pos - centre))
            parent, at, centre = child, _HERE, pos
        if not joints or centre.any():
            self._fix(parent, name, at @ _Pose(np.eye(3), -centre))
        self._children(body, name, _HERE, childclass)

    def _joint(
        self, joint: Element, tag: str, body: str, parent: str, child: str, at: _Pose
    ) -> None:
        kind = "free" if tag == "freejoint" else joint.get("type", "hinge")
        name = self._new("joint", joint.get("name") or f"{body}_joint")
        if kind not in _KINDS:
            raise self._refuse(f"joint {name} has the type {kind!r}, which does not exist")
        for key in ("stiffness", "ref"):
            if self._number(joint, key) != 0.0:
                raise self._refuse(f"the {key} of joint {name} is not supported; remove it")
        if "springdamper" in joint.attrib:
            raise self._refuse(f"the springdamper of joint {name} is not supported; remove it")
        made = self._connect(name, _KINDS[kind], parent, child, at)
        if kind not in ("hinge", "slide"):
            return
        SubElement(made, "axis", xyz=_text(self._vector(joint, "axis", 3, "0 0 1")))
        limit = SubElement(made, "limit", effort="1e9", velocity="1e9")
        limited = joint.get("limited", "auto")
        if limited == "true" or (limited == "auto" and joint.get("range")):
            ends = self._vector(joint, "range", 2, "0 0")
            ends = np.array([self._angle(end) for end in ends]) if kind == "hinge" else ends
            limit.set("lower", repr(float(ends[0])))
            limit.set("upper", repr(float(ends[1])))
        elif kind == "hinge":
            made.set("type", "continuous")
        else:
            limit.set("lower", "-1e9")
            limit.set("upper", "1e9")
        if joint.get("actuatorfrcrange") and joint.get("actuatorfrclimited") != "false":
            limit.set("effort", repr(float(self._vector(joint, "actuatorfrcrange", 2, "0 0")[1])))
        said = {"damping": "damping", "friction": "frictionloss", "armature": "armature"}
        values = {key: repr(self._number(joint, name)) for key, name in said.items()}
        SubElement(made, "dynamics", values)

    def _inertial(self, body: Element, link: Element, childclass: str) -> None:
        given = body.find("inertial")
        if given is None:
            for geom in body.iterfind("geom"):
                if self._has_mass(geom, childclass):
                    raise self._refuse(
                        f"body {link.get('name')} has its mass from geoms, without <inertial>; "
                        f"{_SAVE}"
                    )
            return
        frame = self._pose(given)
        if given.get("fullinertia"):
            xx, yy, zz, xy, xz, yz = self._vector(given, "fullinertia", 6, "")
            own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            own = np.diag(self._vector(given, "diaginertia", 3, "0 0 0"))
        inertia = frame.R @ own @ frame.R.T
        made = SubElement(link, "inertial")
        SubElement(made, "origin", xyz=_text(frame.p))
        SubElement(made, "mass", value=given.get("mass", ""))
        entries = {f"i{'xyz'[i]}{'xyz'[j]}": inertia[i, j] for i in range(3) for j in range(i, 3)}
        SubElement(made, "inertia", {key: repr(float(value)) for key, value in entries.items()})

    def _shapes(self, body: Element, link: Element, childclass: str) -> None:
        """The geoms of a body as the shapes of its link; what has no shape in a URDF is left out.

        A geom that collides with nothing is what is seen of the link.
        """
        spheres: list[tuple[str, _Pose]] = []
        for one in body.iterfind("geom"):
            geom = self._with_defaults(one, "geom", childclass)
            found = self._shape(geom)
            if found is None:
                continue
            shape, at = found
            seen = geom.get("contype") == "0" and geom.get("conaffinity") == "0"
            made = SubElement(link, "visual" if seen else "collision")
            SubElement(made, "origin", xyz=_text(at.p), rpy=_text(pin.rpy.matrixToRpy(at.R)))
            SubElement(made, "geometry").append(shape)
            if shape.tag == "sphere" and not seen:
                spheres.append((geom.get("name") or f"{link.get('name')}_sphere", at))
        if len(spheres) == 1:
            (name, at), *_ = spheres
            self.spheres.append((name, link.get("name", ""), at))

    def _shape(self, geom: Element) -> tuple[Element, _Pose] | None:
        """A geom as an element of <geometry>, and its place; None if a URDF has none for it."""
        kind = geom.get("type", "sphere")
        if kind == "mesh":
            mesh = self.meshes.get(geom.get("mesh", ""))
            if mesh is None:
                return None
            folder = self.compiler.get("meshdir") or self.compiler.get("assetdir") or "."
            file, scale = str(Path(folder) / mesh.get("file", "")), mesh.get("scale", "1 1 1")
            return Element("mesh", filename=file, scale=scale), self._pose(geom)
        at, size = None, [number(word) for word in geom.get("size", "").split()]
        if "fromto" in geom.attrib:
            start, end = np.split(self._vector(geom, "fromto", 6, ""), 2)
            along = Element("frame", zaxis=_text(end - start))
            at = _Pose(self._rotation(along), (start + end) / 2.0)
            size[1:] = [float(np.linalg.norm(end - start)) / 2.0]
        needed = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}.get(kind, 0)
        size = size[:needed]
        if not needed or len(size) < needed or not np.isfinite(size).all():
            return None
        if kind == "box":
            shape = Element("box", size=_text(2.0 * np.array(size)))
        else:
            shape = Element(kind, radius=repr(size[0]))
            if needed == 2:
                shape.set("length", repr(2.0 * size[1]))
        return shape, self._pose(geom) if at is None else at

    def _has_mass(self, geom: Element, childclass: str) -> bool:
        whole = self._with_defaults(geom, "geom", childclass)
        return self._number(whole, "mass", self._number(whole, "density", 1000.0)) != 0.0

    def _link(self, name: str) -> Element:
        return SubElement(self.robot, "link", name=name)

    def _fix(self, parent: str, name: str, at: _Pose) -> None:
        self._connect(self._new("joint", f"{name}_fixed"), "fixed", parent, name, at)

    def _connect(self, name: str, kind: str, parent: str, child: str, at: _Pose) -> Element:
        made = SubElement(self.robot, "joint", name=name, type=kind)
        SubElement(made, "parent", link=parent)
        SubElement(made, "child", link=child)
        rpy = pin.rpy.matrixToRpy(at.R)
        SubElement(made, "origin", xyz=_text(at.p), rpy=_text(rpy))
        return made

    def _new(self, tag: str, name: str) -> str:
        """A name that no other link or joint has; where it is taken, with a number behind."""
        taken, found, k = self.taken[tag], name, 1
        while found in taken:
            k += 1
            found = f"{name}_{k}"
        taken.add(found)
        return found

    def _pose(self, element: Element) -> _Pose:
        return _Pose(self._rotation(element), self._vector(element, "pos", 3, "0 0 0"))

    def _rotation(self, element: Element) -> Array:
        """Orientation (3, 3) of a frame in its parent, however it is written."""
        if "euler" in element.attrib:
            return self._euler(self._vector(element, "euler", 3, ""))
        if "axisangle" in element.attrib:
            *axis, angle = self._vector(element, "axisangle", 4, "")
            return _turned(self._unit(np.array(axis)), self._angle(angle))
        if "xyaxes" in element.attrib:
            x, y = np.split(self._vector(element, "xyaxes", 6, ""), 2)
            x = self._unit(x)
            y = self._unit(y - (x @ y) * x)
            return np.column_stack([x, y, np.cross(x, y)])
        if "zaxis" in element.attrib:
            z = self._unit(self._vector(element, "zaxis", 3, ""))
            axis = np.cross([0.0, 0.0, 1.0], z)
            sine = float(np.linalg.norm(axis))
            axis = axis / sine if sine > 0.0 else np.array([1.0, 0.0, 0.0])
            return _turned(axis, math.atan2(sine, float(z[2])))
        w, x, y, z = self._unit(self._vector(element, "quat", 4, "1 0 0 0"))
        return pin.Quaternion(w, x, y, z).toRotationMatrix()

    def _euler(self, angles: Array) -> Array:
        """Small letters turn about the axes that have turned already, capitals about the fixed."""
        order = self.compiler.get("eulerseq", "xyz")
        if len(order) != 3 or not set(order.lower()) <= set("xyz"):
            raise self._refuse(f"compiler eulerseq is {order!r}; it must be three of x, y, z")
        R = np.eye(3)
        for letter, angle in zip(order, angles, strict=True):
            turn = _turned(np.eye(3)["xyz".index(letter.lower())], self._angle(angle))
            R = R @ turn if letter.islower() else turn @ R
        return R

    def _angle(self, value: float) -> float:
        """An angle of the file in rad."""
        return value if self.compiler.get("angle") == "radian" else math.radians(value)

    def _unit(self, vector: Array) -> Array:
        length = float(np.linalg.norm(vector))
        if not length > 0.0:
            raise self._refuse("an axis or quaternion is zero; it needs a direction")
        return vector / length

    def _number(self, element: Element, key: str, default: float = 0.0) -> float:
        return float(self._vector(element, key, 1, repr(default))[0])

    def _vector(self, element: Element, key: str, length: int, default: str) -> Array:
        """An attribute of so many numbers."""
        values = [number(word) for word in element.get(key, default).split()]
        if len(values) != length or not np.isfinite(values).all():
            name = element.get("name", "")
            raise self._refuse(
                f"{key} of <{element.tag}> {name!r} is {element.get(key)!r}; it must be "
                f"{'a number' if length == 1 else f'{length} numbers'}"
            )
        return np.array(values)


def _turned(axis: Array, angle: float) -> Array:
    return pin.AngleAxis(angle, axis).toRotationMatrix()


def _text(vector: Array) -> str:
    return " ".join(repr(float(value)) for value in vector)


def include_files(root: Element, path: Path) -> bool:
    """Put the content of included files in place of <include>; whether there was any.

    Args:
        root: the root element, which is changed.
        path: the main file, in whose folder the others are.

    Raises:
        FileError: an included file cannot be read.
        RobotError: one is not well-formed, or is included twice.
    """
    return _included(root, path, {path.resolve()})


def _included(holder: Element, path: Path, seen: set[Path]) -> bool:
    found = False
    for k, part in reversed(list(enumerate(holder))):
        if part.tag != "include":
            found |= _included(part, path, seen)
            continue
        file = path.parent / part.get("file", "")
        if file.resolve() in seen:
            raise RobotError(f"{path}: {file} is included twice; MJCF includes a file once.")
        seen.add(file.resolve())
        content = read_whole(file, what="The included file", largest=LARGEST_BYTES)
        inner = parse_xml(content, file)
        _included(inner, path, seen)
        holder[k : k + 1] = list(inner)
        found = True
    return found
