"""What the walking controller carries from tick to tick."""

from typing import Any, NamedTuple

from sealag.typing import Array


class Carried(NamedTuple):
    """Memory of one part of the controller; arrays are live.

    Attributes:
        owner: the part.
        numbers: its attributes that are plain numbers: flags, counters, instants.
        arrays: what it remembers of the robot, each with the flat indices at which a place's x
            stands, its y behind it.
        ring: attribute of the owner that says which row of the arrays is the newest; empty if they
            are no rings.
        units: what the arrays' entries are divided by to be compared with angles.
        clock: attribute of the owner that is an instant of the controller's clock.
    """

    owner: Any
    numbers: tuple[str, ...]
    arrays: tuple[tuple[Array, tuple[int, ...]], ...]
    ring: str = ""
    units: float = 1.0
    clock: str = ""
