"""Published data of robots' drives, each with its source."""

import json
import re
from collections.abc import Iterator
from importlib import resources
from typing import Any, NamedTuple

from sealag.robot import Robot


class PublishedDrives(NamedTuple):
    """What is published of a robot's drives.

    Attributes:
        source: where it stands.
        joints: keys of [actuators.joint.<name>] by joint, SI units.
    """

    source: str
    joints: dict[str, dict[str, float]]


def published_drives(robot: Robot) -> PublishedDrives | None:
    """Return what is published of a robot's drives; None if nothing is known of it.

    A robot is known by the URDF's name, and a joint by its own.

    Args:
        robot: the robot.
    """
    for entry in _entries():
        if re.fullmatch(entry["robot"], robot.name):
            joints = {
                name: keys
                for name in robot.joints
                for pattern, keys in entry["joints"].items()
                if re.fullmatch(pattern, name)
            }
            return PublishedDrives(entry["source"], joints) if joints else None
    return None


def _entries() -> Iterator[dict[str, Any]]:
    text = (resources.files("sealag.data") / "drives.json").read_text(encoding="utf-8")
    yield from json.loads(text)
