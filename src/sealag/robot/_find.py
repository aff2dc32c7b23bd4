"""Where a robot's file is: paths, bundled and example robots, packages of ROS."""

import glob
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from sealag.errors import FileError
from sealag.files import bundled, is_inside

_PACKAGE = "package://"


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
        folder = root / "example-robot-data" / "robots"
        path = folder / relative
        if is_inside(path, folder) and path.is_file():
            return path
    for folder in (root / "example-robot-data" / "robots" for root in roots):
        if folder.is_dir():
            raise FileError(
                f"example-robot-data has no file {relative}; its robots are files below {folder}."
            )
    raise FileError(
        f"The example robot {relative} is not installed; "
        "install the Python package example-robot-data or give the path of your URDF."
    )


def resolve_urdf(text: str, *, relative_to: Path = Path()) -> Path:
    """Turn the way a project file names a robot into a path.

    Args:
        text: a path, `bundled:hume.urdf`, `example-robot-data:<path below robots>` or
            `package://<ROS package>/<path in it>`.
        relative_to: folder from which a relative path starts, and around which packages are looked
            for.

    Raises:
        UnknownNameError: no bundled robot has this name.
        FileError: an example robot or a package is not there, or a home folder does not exist.
    """
    if text.startswith("bundled:"):
        return bundled(text.removeprefix("bundled:"), ending=".urdf", what="robot")
    if text.startswith("example-robot-data:"):
        return example_robot_path(text.removeprefix("example-robot-data:"))
    if text.startswith(_PACKAGE):
        name, _, rest = text.removeprefix(_PACKAGE).partition("/")
        return find_package(name, around=relative_to) / rest
    try:
        return relative_to / Path(text).expanduser()
    except RuntimeError as error:  # ~nobody
        raise FileError(f"{text!r} names the home folder of a user who does not exist.") from error


def find_package(name: str, *, around: Path) -> Path:
    """Return the folder of a ROS package.

    It is looked for in ROS_PACKAGE_PATH, two folders deep, in AMENT_PREFIX_PATH, and last in the
    folders that hold the file: one of them has the package's name, or a folder of this name in it.

    Args:
        name: of the package, which its folder has.
        around: folder of the file that asks.

    Raises:
        FileError: there is none.
    """
    if name == Path(name).name and name not in ("", ".."):
        for folder in (*_ros_folders(name), *_around(name, around)):
            if folder.is_dir():
                return folder
    raise FileError(
        f"The ROS package {name!r} is neither in ROS_PACKAGE_PATH or AMENT_PREFIX_PATH nor beside "
        "the file; add its parent folder to ROS_PACKAGE_PATH."
    )


def _ros_folders(name: str) -> Iterator[Path]:
    for root in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        if Path(root).name == name:
            yield Path(root)
        for depth in ("", "*/", "*/*/"):
            yield from sorted(Path(root).glob(f"{depth}{glob.escape(name)}"))
    for root in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(root) / "share" / name


def _around(name: str, folder: Path) -> Iterator[Path]:
    for parent in (folder.resolve(), *folder.resolve().parents):
        yield from (parent,) if parent.name == name else (parent / name,)
