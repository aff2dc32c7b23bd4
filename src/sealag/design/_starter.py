"""A commented project file for a robot, to be filled in."""

import json
from pathlib import Path

import numpy as np

from sealag.design._starter_text import OPTIONAL, REQUIRED
from sealag.errors import InputError
from sealag.robot import Robot, load_robot
from sealag.typing import Array


def starter_project(
    urdf: str | Path, *, floating_base: bool = False, named: str | None = None
) -> str:
    """Write a starter project file for a robot, with its own joints in it.

    The posture is one that an SRDF beside the URDF names. Without one the joints are at 0 or in
    the middle of their range, and those that carry feet are left to be filled in: on straight legs
    nothing is stable.

    Args:
        urdf: the robot, as `load_robot` takes it.
        floating_base: whether the root link moves freely.
        named: how the file names the URDF; as `urdf` if None.

    Returns:
        TOML text that certifies once each FILL is replaced.

    Raises:
        FileError: the URDF cannot be read.
        RobotError: it is not a usable robot.
        InputError: the path's bytes are no text.
    """
    robot = load_robot(urdf, floating_base=floating_base, skip_unusable=True)
    feet = _feet(robot) if floating_base else []
    rotor = robot.rotor_inertia
    known = bool((rotor > 0.0).all())
    required = REQUIRED.format(
        name=_text(robot.name),
        urdf=_text((str(urdf) if named is None else named).replace("\\", "/")),
        base="floating" if floating_base else "fixed",
        actuated=_actuated(robot),
        posture=_posture(robot, feet),
        rotor=f"{rotor.min():.6g}"
        if known
        else '"FILL: B reflected to the joint, kg m^2 (kg where the joint slides)"',
        joint=_key(robot.joints[0]),
        contacts=_contacts(robot, feet) if floating_base else "",
    )
    frame = (feet or list(robot.link_names()))[-1]
    pair = ", ".join(_text(name) for name in (feet[:2] if len(feet) > 1 else ("left", "right")))
    return required + OPTIONAL.format(frame=_text(frame), feet=pair)


def _text(name: str) -> str:
    """A name as a TOML string.

    Raises:
        InputError: its bytes are no text.
    """
    if name != name.encode("utf-8", "ignore").decode("utf-8"):
        raise InputError(
            f"The name {name!r} is no UTF-8, and TOML has no letters for it; rename it."
        )
    return json.dumps(name, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    plain = name.replace("_", "").replace("-", "")
    return name if plain.isascii() and plain.isalnum() else _text(name)


def _actuated(robot: Robot) -> str:
    """Names of the joints, and behind a # those that cannot be actuated and what was read anew."""
    lines = [f"  {_text(name)}," for name in robot.joints]
    lines += [f"  # {_text(name)}: {_line(why)}; locked" for name, why in robot.skipped.items()]
    lines += [f"  # {_line(remark)}" for remark in robot.remarks]
    return "\n".join(lines)


def _line(text: str) -> str:
    """A comment: on one line, and of letters that TOML has."""
    kept = text.encode("utf-8", "replace").decode("utf-8")
    return "".join(letter if letter.isprintable() else " " for letter in kept)


def _posture(robot: Robot, feet: list[str]) -> str:
    """The section's lines: base, and joints with where their values come from."""
    carrying, reference = np.zeros(robot.n, dtype=bool), robot.reference_posture()
    if reference is not None:
        origin = f"{_text(reference.name)} of {_text(reference.file.name)}; rad or m"
        positions = np.array([reference.joints[name] for name in robot.joints])
    else:
        origin = "rad or m; those left out are 0"
        positions = np.array([_middle(robot, k) for k in range(robot.n)])
        if feet:
            carrying = robot.carriers(feet)
            origin += "; on straight legs nothing is stable: bend the knees"
    values = [
        '"FILL: rad"' if fill else f"{value:.4g}"
        for value, fill in zip(positions, carrying, strict=True)
    ]
    outside = {} if reference is None else reference.outside
    notes = [
        f"  # {outside[name]:.4g} there, outside its limits" if name in outside else ""
        for name in robot.joints
    ]
    joints = [
        f"{_key(name)} = {value}{note}"
        for name, value, note in zip(robot.joints, values, notes, strict=True)
    ]
    height = None if carrying.any() else _height(robot, feet, positions)
    return "\n".join([*_base(robot, feet, height), f"[posture.joints]         # {origin}", *joints])


def _base(robot: Robot, feet: list[str], height: float | None) -> list[str]:
    if not robot.floating_base:
        return []
    comment = "m" if not feet else "m; `sealag simulate` moves it until the feet touch the ground"
    z = 1.0 if height is None else height
    return [
        f"base_position = [0.0, 0.0, {z:.4f}]  # {comment}",
        "base_quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]",
    ]


def _height(robot: Robot, feet: list[str], positions: Array) -> float | None:
    """Height of the base at which the lowest foot is on the ground, m; None without feet."""
    if not feet:
        return None
    q = robot.configuration(positions)
    return -float(robot.link_heights(feet, q).min())


def _middle(robot: Robot, index: int) -> float:
    """0 where the limits allow it, else the middle of the range."""
    low, high = float(robot.position_lower[index]), float(robot.position_upper[index])
    return 0.0 if low <= 0.0 <= high else (low + high) / 2.0


def _feet(robot: Robot) -> list[str]:
    """Links that are called feet, at most four; of those that move as one the lowest."""
    words = ("foot", "sole", "toe")
    names = [name for name in robot.link_names() if any(w in name.lower() for w in words)]
    lowest: dict[int, tuple[float, str]] = {}
    joints = robot.frame_mounts(names).joint.tolist()
    heights = robot.link_heights(names, robot.neutral()).tolist()
    for name, joint, height in zip(names, joints, heights, strict=True):
        lowest[joint] = min(lowest.get(joint, (np.inf, name)), (height, name))
    return [name for _, name in lowest.values()][:4]


def _contacts(robot: Robot, feet: list[str]) -> str:
    lines = ["", "# Frames that the ground holds: a point (3 forces) or a surface (6)."]
    for name in feet:
        lines += ["[[contacts]]", f"frame = {_text(name)}", 'kind = "point"']
    if not feet:
        frame = _text(robot.link_names()[-1])
        lines.append("# No link is called a foot: without contacts the robot flies.")
        lines += ["# [[contacts]]", f"# frame = {frame}", '# kind = "point"']
    return "\n".join([*lines, ""])
