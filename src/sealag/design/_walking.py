"""The [walking] section of a project file."""

from dataclasses import fields
from enum import StrEnum
from typing import Any

from sealag.errors import InputError, either, near
from sealag.robot import Robot
from sealag.walking import Ground, GroundProfile, Walking, WalkingGait, WalkingOptions


def walking_of(section: Any, robot: Robot) -> Walking | None:
    """Turn a [walking] section into the walk that it describes.

    Args:
        section: the parsed section; None if the project has none.
        robot: the robot that shall walk.

    Raises:
        UnknownNameError: a foot, or a key of gait or options, does not exist.
        InputError: a value cannot be.
    """
    if section is None:
        return None
    left, right = (robot.check_frame(frame) for frame in section.feet)
    return Walking(
        feet=(left, right),
        steps=section.steps,
        friction=section.friction,
        ground=_ground(section.terrain),
        gait=_filled(WalkingGait, section.gait, "walking.gait"),
        options=_filled(WalkingOptions, section.options, "walking.options"),
    )


def _ground(keys: Any) -> Ground:
    match keys.kind:
        case "flat":
            return GroundProfile.flat()
        case "rough":
            return GroundProfile.rough(keys.seed, amplitude=keys.amplitude_m)
        case "stairs":
            return GroundProfile.stairs(keys.rises_m, run=keys.run_m)
        case _:
            return GroundProfile.paper()


def _filled(kind: type, values: dict[str, Any], where: str) -> Any:
    defaults = {field.name: field.default for field in fields(kind)}
    for key, value in values.items():
        if key not in defaults:
            raise near(key, defaults, what=f"key of {where}")
        need = _unlike(value, defaults[key])
        if need:
            raise InputError(f"{where}.{key} is {value!r}; it must be {need}.")
    return kind(**values)


def _unlike(value: Any, default: Any) -> str:
    """What a value must be if it is not of its default's kind; else an empty text."""
    if isinstance(default, StrEnum):
        choices = [str(member) for member in type(default)]
        return "" if value in choices else either(choices)
    if isinstance(default, bool):
        return "" if isinstance(value, bool) else "true or false"
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return "" if number else "a number"
