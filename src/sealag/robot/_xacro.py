"""Macros of a URDF, expanded by the package xacro in a process of its own.

xacro keeps its state in its modules, evaluates Python expressions, and prints what it thinks; a
process of its own can be stopped. There, `$(find package)` asks this module.
"""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from sealag.errors import RobotError
from sealag.robot._find import find_package

_LONGEST = 60.0  # s: robots take less than one
_PROGRAM = f"import sys, {__name__} as expander; expander.print_expanded(sys.argv[1])"
_ROS_INDEX = "ament_index_python"
"""The package that xacro asks where a ROS package is; ROS has it, PyPI has not."""


def expand_xacro(path: Path) -> bytes:
    """Return the URDF that a xacro file makes with its arguments' defaults.

    Args:
        path: the file.

    Raises:
        RobotError: the package xacro is not installed, or refuses the file.
    """
    by_hand = f"or expand it yourself: xacro {path.name} argument:=value > robot.urdf."
    if find_spec("xacro") is None:
        raise RobotError(
            f"{path} is a xacro file; install the Python package xacro (sealag[xacro]), {by_hand}"
        )
    command = [sys.executable, "-c", _PROGRAM, str(path.resolve())]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_LONGEST, check=False)
    except subprocess.TimeoutExpired as error:
        raise RobotError(
            f"{path}: xacro has not expanded it after {_LONGEST:g} s; expand it yourself."
        ) from error
    if done.returncode:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines() or ["it ended"]
        said = lines[-1][:400].rstrip(".")
        raise RobotError(f"{path} cannot be expanded by xacro: {said}; correct it, {by_hand}")
    return done.stdout


def print_expanded(name: str) -> None:
    """Print an expanded file; what goes wrong is the last line of standard error.

    Args:
        name: the file.
    """
    import xacro

    if find_spec(_ROS_INDEX) is None:
        index, packages = ModuleType(_ROS_INDEX), ModuleType(f"{_ROS_INDEX}.packages")
        folder = Path(name).parent
        vars(packages)["get_package_share_directory"] = lambda package: str(
            find_package(package, around=folder)
        )
        sys.modules |= {index.__name__: index, packages.__name__: packages}
    try:
        document: Any = xacro.process_file(name)
    except Exception as error:
        sys.exit(" ".join(str(error).split()) or type(error).__name__)
    sys.stdout.buffer.write(document.documentElement.toxml("utf-8"))
