"""Robots below a folder: which of its files describe one."""

from collections.abc import Iterator
from pathlib import Path

_ENDINGS = (".urdf", ".urdf.xacro", ".sdf", ".mjcf")


def robots(folder: Path) -> list[Path]:
    """Return the files below a folder that say they are a robot: by their names, and MJCF by its
    root element.

    Args:
        folder: where to look.
    """
    return sorted(_robots(folder))


def _robots(folder: Path) -> Iterator[Path]:
    for path in folder.rglob("*"):
        if path.is_file() and (path.name.endswith(_ENDINGS) or _is_mjcf(path)):
            yield path


def _is_mjcf(path: Path) -> bool:
    """Whether it is MJCF with a tree of its own; scenes include a robot that is listed itself."""
    if path.suffix != ".xml":
        return False
    text = path.read_text(encoding="utf-8", errors="replace")
    return "<mujoco" in text and "<joint" in text and "<include" not in text
