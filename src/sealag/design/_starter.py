"""A commented project file for a robot, to be filled in."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from sealag.design._drives import PublishedDrives, published_drives
from sealag.design._starter_text import DIFFERING, OPTIONAL, REQUIRED, SOLES
from sealag.errors import InputError
from sealag.robot import Contact, Robot, load_robot
from sealag.typing import Array


class _Ground(NamedTuple):
    """How a robot stands.

    Attributes:
        floating: whether the base moves freely.
        why: a clause.
        legs: how many it has.
        contacts: what touches the ground.
        upright: (4,) quaternion of the base.
        sole: half length and width of soles, m; None if no shape tells them.
    """

    floating: bool
    why: str
    legs: int = 0
    contacts: tuple[Contact, ...] = ()
    upright: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    sole: tuple[float, float] | None = None

    @property
    def frames(self) -> list[str]:
        """Names of the contacts' frames."""
        return [contact.frame for contact in self.contacts]


class _Posture(NamedTuple):
    """Where the joints are.

    Attributes:
        origin: where the positions come from.
        joints: (n,) rad or m; NaN where they are left to be filled in.
        outside: what a named posture has for joints outside their limits, rad or m.
    """

    origin: str
    joints: Array
    outside: Mapping[str, float] = MappingProxyType({})


def starter_project(
    urdf: str | Path,
    *,
    floating_base: bool | None = None,
    named: str | None = None,
    tell: Callable[[str], None] | None = None,
) -> str:
    """Write a starter project file for a robot, with its own joints, feet and a posture in it.

    A robot with legs has a floating base and stands on its feet: in the posture that an SRDF beside
    the URDF names; without one with knees bent, feet level and the centre of mass between them. All
    other joints are at 0 or in the middle of their range.

    Args:
        urdf: the robot, as `load_robot` takes it.
        floating_base: whether the root link moves freely; as its legs say if None.
        named: how the file names the URDF; as `urdf` if None.
        tell: called with a sentence for each thing that was decided, and why.

    Returns:
        TOML text that certifies once each FILL is replaced.

    Raises:
        FileError: the URDF cannot be read.
        RobotError: it is not a usable robot.
        InputError: the path's bytes are no text.
    """
    say = tell or (lambda _: None)
    robot = load_robot(urdf, floating_base=floating_base is True, skip_unusable=True)
    ground = _ground(robot, floating_base)
    if ground.floating is not robot.floating_base:
        robot = load_robot(urdf, floating_base=ground.floating, skip_unusable=True)
    posture = _posture(robot, ground)
    say(f"base: {'floating' if ground.floating else 'fixed'}, because {ground.why}")
    say(f"posture: {posture.origin}{_moved(posture.outside)}")
    drives = published_drives(robot)
    if drives is not None:
        say(f"drives: {', '.join(_known(drives))} of {len(drives.joints)} joints, {drives.source}")
    required = REQUIRED.format(
        name=_text(robot.name),
        urdf=_text((str(urdf) if named is None else named).replace("\\", "/")),
        base="floating" if ground.floating else "fixed",
        why=_line(ground.why),
        actuated=_actuated(robot),
        posture=_posture_lines(robot, ground, posture),
        rotor=_rotor(robot, drives),
        differing=_differing(robot, drives),
        contacts=_contacts(robot, ground) if ground.floating else "",
    )
    feet = ground.frames
    frame = (feet or list(robot.link_names()))[-1]
    pair = ", ".join(_text(name) for name in (feet[:2] if len(feet) > 1 else ("left", "right")))
    return required + OPTIONAL.format(
        frame=_text(frame),
        feet=pair,
        simulation="# [simulation]" if ground.sole is None else "[simulation]",
        soles=_soles(ground.sole),
    )


def _ground(robot: Robot, floating: bool | None) -> _Ground:
    """What a robot stands on, and whether its base is free, if that is not said."""
    if floating is False:
        return _Ground(False, "it was asked for")
    feet = robot.feet()
    if floating is None and not feet.legs:
        return _Ground(False, f"{feet.reason} (--base floating if it stands or flies freely)")
    sole = None
    if feet.half_length is not None and feet.half_width is not None:
        sole = feet.half_length, feet.half_width
    why = feet.reason if floating is None else f"it was asked for; {feet.reason}"
    return _Ground(True, why, feet.legs, feet.contacts, feet.upright, sole)


def _moved(outside: Mapping[str, float]) -> str:
    """A clause on joints that a named posture has outside their limits; empty if none."""
    if not outside:
        return ""
    return f"; {', '.join(outside)} moved to the nearest limit"


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


def _posture(robot: Robot, ground: _Ground) -> _Posture:
    """The posture of an SRDF, one to stand in, or joints that need no choice."""
    joints, reference = robot.relaxed_posture(), robot.reference_posture()
    if reference is not None:
        origin = f"{_text(reference.name)} of {_text(reference.file.name)}"
        return _Posture(origin, joints, reference.outside)
    if not ground.legs or not ground.floating:
        return _Posture("0, or the middle of the range where it leaves 0 out", joints)
    stance = robot.stance(ground.contacts, ground.upright) if len(ground.contacts) > 1 else None
    if stance is not None:
        origin = "knees bent, feet level, the centre of mass between them (inverse kinematics)"
        return _Posture(origin, stance.joints)
    free = robot.carriers(ground.frames) if ground.contacts else np.ones(robot.n, dtype=bool)
    origin = "on straight legs nothing is stable: bend the knees"
    return _Posture(origin, np.where(free, np.nan, joints))


def _posture_lines(robot: Robot, ground: _Ground, posture: _Posture) -> str:
    """The section's lines: base, and joints with where their values come from."""
    # Rounding leaves -0 where there is a 0, and 1e-17 of noise.
    rounded = np.round(posture.joints, 6) + 0.0
    values = ['"FILL: rad"' if np.isnan(value) else f"{value:.4g}" for value in rounded]
    notes = [
        f"  # {posture.outside[name]:.4g} there, outside its limits"
        if name in posture.outside
        else ""
        for name in robot.joints
    ]
    joints = [
        f"{_key(name)} = {value}{note}"
        for name, value, note in zip(robot.joints, values, notes, strict=True)
    ]
    origin = f"rad or m; {_line(posture.origin)}"
    return "\n".join([*_base(robot, ground, rounded), f"[posture.joints]  # {origin}", *joints])


def _base(robot: Robot, ground: _Ground, joints: Array) -> list[str]:
    if not robot.floating_base:
        return []
    feet, height = ground.frames, 1.0
    if feet and not np.isnan(joints).any():
        q = robot.configuration(joints, base_quaternion=ground.upright)
        height = -float(robot.link_heights(feet, q).min())
    comment = "m; `sealag simulate` moves it until the feet touch the ground" if feet else "m"
    turn = ", ".join(f"{part:.6g}" if part % 1.0 else f"{part:.1f}" for part in ground.upright)
    return [
        f"base_position = [0.0, 0.0, {height:.4f}]  # {comment}",
        f"base_quaternion_xyzw = [{turn}]",
    ]


def _contacts(robot: Robot, ground: _Ground) -> str:
    lines = ["", "# Frames that the ground holds: a point (3 forces) or a surface (6)."]
    for contact in ground.contacts:
        lines += ["[[contacts]]", f"frame = {_text(contact.frame)}", f'kind = "{contact.kind}"']
    if ground.legs and not ground.contacts:
        lines += [f"# {_line(ground.why)}.", "[[contacts]]"]
        lines += ['frame = "FILL: the link of a foot; one [[contacts]] for each"', 'kind = "point"']
    elif not ground.contacts:
        frame = _text(robot.link_names()[-1])
        lines.append("# No feet were found: without contacts the robot flies.")
        lines += ["# [[contacts]]", f"# frame = {frame}", '# kind = "point"']
    return "\n".join([*lines, ""])


def _rotor(robot: Robot, drives: PublishedDrives | None) -> str:
    """The rotor inertia of joints that have none of their own in the file."""
    rotor = robot.rotor_inertia
    if (rotor > 0.0).all():
        return f"{rotor.min():.6g}"
    if drives is not None and set(drives.joints) == set(robot.joints):
        return f"{min(keys['rotor_inertia'] for keys in drives.joints.values()):.6g}"
    return '"FILL: B reflected to the joint, kg m^2 (kg where the joint slides)"'


def _differing(robot: Robot, drives: PublishedDrives | None) -> str:
    """The sections of joints whose drives are published, or one as a comment."""
    if drives is None:
        return DIFFERING.format(joint=_key(robot.joints[0]))
    lines = [f"# Published: {drives.source}."]
    for name, keys in drives.joints.items():
        lines.append(f"[actuators.joint.{_key(name)}]")
        lines += [f"{key} = {value:.6g}" for key, value in keys.items()]
    return "\n".join(lines)


def _known(drives: PublishedDrives) -> list[str]:
    return sorted({key for keys in drives.joints.values() for key in keys})


def _soles(half: tuple[float, float] | None) -> str:
    if half is None:
        return SOLES
    length, width = half
    return (
        f"foot_half_length = {length:.4g}  # m along x of a sole's frame: half of its shape\n"
        f"foot_half_width = {width:.4g}  # m along y"
    )
