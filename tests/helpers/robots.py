"""Where the files of bundled and example robots are."""

from pathlib import Path

from sealag.robot import load_robot


def urdf_path(name: str) -> Path:
    """The file of a robot by the name that `load_robot` takes."""
    return load_robot(name, floating_base=False).urdf_path
