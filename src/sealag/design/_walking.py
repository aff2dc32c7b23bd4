"""The [walking] section of a project file."""

from dataclasses import fields
from typing import Any

from sealag.errors import near
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
    known = [field.name for field in fields(kind)]
    for key in values:
        if key not in known:
            raise near(key, known, what=f"key of {where}")
    return kind(**values)
