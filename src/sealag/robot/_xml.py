"""XML without regard to namespaces."""

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from sealag.errors import RobotError

LARGEST_BYTES = 50_000_000
"""Of a robot's file."""


def parse_xml(content: bytes, path: Path) -> Element:
    """Parse XML without regard to namespaces: prefixes need not be declared, as in many URDFs.

    Blank lines before the XML declaration are passed over, too.

    Args:
        content: the file's bytes.
        path: what messages call it.

    Raises:
        RobotError: it is not well-formed.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    try:
        parser.Parse(content.lstrip(), True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the last two: odd encodings
        raise RobotError(f"{path} is not well-formed XML: {error}.") from error
    return builder.close()
