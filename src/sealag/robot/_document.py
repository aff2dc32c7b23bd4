"""A robot's file as XML, and what kind of file it is: told by its content, not its name."""

from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from sealag.errors import RobotError
from sealag.files import read_whole
from sealag.robot._xacro import expand_xacro

LARGEST_URDF_BYTES = 50_000_000
_SDF = ("sdf", "gazebo", "world", "model")
"""Root elements of SDF and of the files beside it."""


class Document(NamedTuple):
    """A robot's file.

    Attributes:
        root: its root element; names keep their prefixes (`drake:acceleration`).
        content: its bytes, macros expanded.
    """

    root: Element
    content: bytes


def read_document(path: Path) -> Document:
    """Read a URDF, or a xacro file as the URDF that it expands to.

    Args:
        path: the file.

    Raises:
        FileError: it is missing, unreadable or too large.
        RobotError: it is empty, no XML, or of a kind that is not read; its macros cannot be
            expanded.
    """
    content = read_whole(path, what="The URDF", largest=LARGEST_URDF_BYTES)
    if not content.strip():
        raise RobotError(f"{path} is empty; a URDF is needed.")
    root = parse_xml(content, path)
    if _has_macros(root):
        content = expand_xacro(path)
        root = parse_xml(content, path)
    if root.tag in _SDF:
        raise RobotError(
            f"{path} is SDF, which is not read; convert it to a URDF, for instance with sdf2urdf "
            "or by exporting it from its CAD program again."
        )
    return Document(root, content)


def parse_xml(content: bytes, path: Path) -> Element:
    """Parse XML without regard to namespaces: prefixes need not be declared, as in many URDFs.

    Args:
        content: the file's bytes.
        path: what messages call it.

    Raises:
        RobotError: it is not well-formed.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the last two: odd encodings
        raise RobotError(f"{path} is not well-formed XML: {error}.") from error
    return builder.close()


def _has_macros(root: Element) -> bool:
    """Whether a file has macros of xacro left to expand."""
    return any(
        element.tag.startswith("xacro:") or any("${" in value for value in element.attrib.values())
        for element in root.iter()
    )
