"""Postures that a robot's maker names: the group states of an SRDF beside the URDF."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from sealag.typing import Array

_NAMES = ("standing", "half_sitting", "homing", "home", "default", "neutral")


class ReferencePosture(NamedTuple):
    """A posture that a file beside the URDF names.

    Attributes:
        name: what it is called there.
        file: the SRDF.
        joints: joint name to position, rad or m.
        outside: what the file gives for joints that it puts outside their limits, rad or m.
    """

    name: str
    file: Path
    joints: dict[str, float]
    outside: dict[str, float]

    def within(self, joints: Sequence[str], lower: Array, upper: Array) -> "ReferencePosture":
        """Return the posture with joints that are outside their limits at the nearer one.

        Args:
            joints: (n,) names.
            lower: (n,) limits, rad or m.
            upper: (n,) limits, rad or m.
        """
        asked = np.array([self.joints[name] for name in joints])
        inside = dict(zip(joints, np.clip(asked, lower, upper).tolist(), strict=True))
        moved = {name: value for name, value in self.joints.items() if value != inside[name]}
        return self._replace(joints=inside, outside=moved)


def posture_beside(
    urdf: Path | None, joints: Sequence[str], lower: Array, upper: Array
) -> ReferencePosture | None:
    """Find a posture in an SRDF in the URDF's folder, or in the folder `srdf` there or beside it.

    The file with the URDF's own name goes first, and a posture to stand in before others.

    Args:
        urdf: the robot's file; None if it is of none.
        joints: (n,) its joints; a posture that names fewer than half of them is another robot's.
        lower: (n,) limits, rad or m: joints that it puts outside are at the nearer one.
        upper: (n,) limits, rad or m.
    """
    if urdf is None:
        return None
    folder, stem = urdf.resolve().parent, urdf.stem
    places = (folder, folder / "srdf", folder.parent / "srdf")
    files = [path for place in places for path in sorted(place.glob("*.srdf"))]
    found = [
        state
        for path in sorted(files, key=lambda path: path.stem != stem)
        for state in _states(path)
        if 2 * len(state.joints.keys() & set(joints)) >= len(joints)
    ]
    for wanted in _NAMES:
        for state in found:
            if state.name.startswith(wanted):
                known = {name: state.joints.get(name, 0.0) for name in joints}
                return state._replace(joints=known).within(joints, lower, upper)
    return None


def relaxed_positions(
    reference: ReferencePosture | None, joints: Sequence[str], lower: Array, upper: Array
) -> Array:
    """Return joint positions (n,) of a named posture; without one 0 within the limits, else the
    middle of the range, rad or m.

    Args:
        reference: the named posture, if there is one.
        joints: (n,) names.
        lower: (n,) limits, -inf where there is none.
        upper: (n,) limits, inf where there is none.
    """
    if reference is not None:
        return np.array([reference.joints[name] for name in joints])
    inside = (lower <= 0.0) & (upper >= 0.0)
    return (np.where(inside, 0.0, lower) + np.where(inside, 0.0, upper)) / 2.0


def _states(path: Path) -> Iterator[ReferencePosture]:
    """Postures of one file; what is no number, as the pose of the base, is left out."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):
        return
    for state in root.iterfind("group_state"):
        joints = {}
        for joint in state.iterfind("joint"):
            try:
                joints[joint.get("name", "")] = float(joint.get("value", ""))
            except ValueError:
                continue
        yield ReferencePosture(state.get("name", ""), path, joints, {})
