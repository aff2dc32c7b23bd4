"""Shapes of a URDF's links, as balls that have the same lowest and outermost points."""

import stat
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from sealag.errors import SealagError
from sealag.robot._document import read_document
from sealag.robot._find import resolve_urdf
from sealag.robot._urdf import number
from sealag.typing import Array

_RIM = 24  # corners of a cylinder's rim: its radius is right to 1 %
_LARGEST_MESH = 20_000_000  # bytes; soles are small, and larger files take seconds to read
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


class Balls(NamedTuple):
    """The hull of a shape's points, each with a ball around it.

    Attributes:
        center: (k, 3) m.
        radius: (k,) m.
    """

    center: Array
    radius: Array

    def moved(self, placement: pin.SE3) -> "Balls":
        """Return them in the frame that a placement is given in.

        Args:
            placement: of the balls' own frame.
        """
        return Balls(self.center @ placement.rotation.T + placement.translation, self.radius)

    @property
    def lowest(self) -> float:
        """Height of the lowest point, m."""
        return float((self.center[:, 2] - self.radius).min())


class Shapes:
    """The collision shapes of links; where a link has none, what is seen of it.

    Args:
        path: the robot's file; None if it is of none, and no link has a shape.
    """

    def __init__(self, path: Path | None) -> None:
        links = () if path is None else read_document(path).root.iterfind("link")
        self._folder = Path() if path is None else path.resolve().parent
        self._links = {link.get("name", ""): link for link in links}
        self.of_link = cache(self._of_link)

    def _of_link(self, name: str) -> Balls | None:
        """Return a link's balls in its own frame; None if it has no shape that can be read."""
        link = self._links.get(name)
        if link is None:
            return None
        for tag in ("collision", "visual"):
            found = [balls for shape in link.iterfind(tag) for balls in self._read(shape)]
            if found:
                return Balls(*(np.concatenate(part) for part in zip(*found, strict=True)))
        return None

    def _read(self, shape: ElementTree.Element) -> Iterator[Balls]:
        geometry = shape.find("geometry")
        placement = _placement(shape.find("origin"))
        for element in () if geometry is None else geometry:
            balls = self._mesh(element) if element.tag == "mesh" else _primitive(element)
            if balls is not None and len(balls.center):
                moved = balls.moved(placement)
                if np.isfinite(moved.center).all() and (moved.radius >= 0.0).all():
                    yield moved

    def _mesh(self, element: ElementTree.Element) -> Balls | None:
        path = self._file(element.get("filename", ""))
        scale = _numbers(element, "scale", "1 1 1")
        if path is None or scale.shape != (3,):
            return None
        try:
            mesh = pin.hppfcl.MeshLoader().load(str(path), scale)
            return _points(np.array(mesh.vertices()))
        except Exception:  # the reader of meshes raises what it likes; a shape may be missing
            return None

    def _file(self, name: str) -> Path | None:
        """A mesh's file, as a URDF names it; None if it is not there, or too large to read."""
        try:
            path = resolve_urdf(name.removeprefix("file://"), relative_to=self._folder)
            status = path.stat()
        except (SealagError, OSError, ValueError):
            return None
        regular = stat.S_ISREG(status.st_mode) and 0 < status.st_size <= _LARGEST_MESH
        return path if regular else None


def _primitive(element: ElementTree.Element) -> Balls | None:
    radius, length = number(element.get("radius", "")), number(element.get("length", ""))
    match element.tag:
        case "box":
            size = _numbers(element, "size", "")
            return _points(_CORNERS * size / 2.0) if size.shape == (3,) else None
        case "sphere":
            return Balls(np.zeros((1, 3)), np.array([radius]))
        case "cylinder":
            angle = 2.0 * np.pi * np.arange(_RIM) / _RIM
            x, y = radius * np.cos(angle), radius * np.sin(angle)
            ends = [np.stack([x, y, np.full(_RIM, z)], axis=1) for z in (-length / 2, length / 2)]
            return _points(np.concatenate(ends))
        case "capsule":
            ends = np.array([[0.0, 0.0, -length / 2.0], [0.0, 0.0, length / 2.0]])
            return Balls(ends, np.full(2, radius))
        case _:
            return None


def _points(points: Array) -> Balls:
    return Balls(points, np.zeros(len(points)))


def _numbers(element: ElementTree.Element, key: str, default: str) -> Array:
    return np.array([number(word) for word in element.get(key, default).split()])


def _placement(origin: ElementTree.Element | None) -> pin.SE3:
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = _numbers(origin, "xyz", "0 0 0"), _numbers(origin, "rpy", "0 0 0")
    if len(xyz) != 3 or len(rpy) != 3:
        return pin.SE3(np.eye(3), np.full(3, np.nan))  # no shape: it is nowhere
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)
