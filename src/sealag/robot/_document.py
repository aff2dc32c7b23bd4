"""A robot's file as XML, and what kind of file it is: told by its content, not its name."""

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from sealag.errors import RobotError
from sealag.files import read_whole
from sealag.robot._mjcf import include_files, urdf_of_mjcf
from sealag.robot._xacro import expand_xacro
from sealag.robot._xml import LARGEST_BYTES, parse_xml

_SDF = ("sdf", "gazebo", "world", "model")
"""Root elements of SDF and of the files beside it."""


class Document(NamedTuple):
    """A robot's file.

    Attributes:
        root: root element of the URDF that it is or is translated to; names keep their prefixes
            (`drake:acceleration`).
        content: its bytes, with macros expanded and included files in their places.
    """

    root: Element
    content: bytes


def read_document(path: Path) -> Document:
    """Read a URDF, or a xacro or MJCF file as the URDF that it is translated to.

    Args:
        path: the file.

    Raises:
        FileError: it is missing, unreadable or too large.
        RobotError: it is empty, no XML, or of a kind that is not read; its macros cannot be
            expanded.
    """
    content = read_whole(path, what="The URDF", largest=LARGEST_BYTES)
    if not content.strip():
        raise RobotError(f"{path} is empty; a URDF is needed.")
    root = parse_xml(content, path)
    if _has_macros(root):
        content = expand_xacro(path)
        root = parse_xml(content, path)
    if root.tag == "mujoco":
        if include_files(root, path):
            content = ElementTree.tostring(root)
        root = urdf_of_mjcf(root, path)
    if root.tag in _SDF:
        raise RobotError(
            f"{path} is SDF, which is not read; convert it to a URDF, for instance with sdf2urdf, "
            "or export one from where it comes from."
        )
    return Document(root, content)


def _has_macros(root: Element) -> bool:
    """Whether a file has macros of xacro left to expand; $(find) alone is in names of meshes."""
    values = [value for element in root.iter() for value in element.attrib.values()]
    return any(element.tag.startswith("xacro:") for element in root.iter()) or any(
        "${" in value or "$(" in value.replace("$(find", "") for value in values
    )
