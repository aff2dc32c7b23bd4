"""The one order of two feet."""

from enum import IntEnum


class Side(IntEnum):
    """A leg of a biped; its number is the leg's place in every pair of feet.

    Pairs of frames, Jacobians, placements and measured contacts hold the left foot first.
    """

    LEFT = 0
    RIGHT = 1

    @property
    def other(self) -> "Side":
        """The other leg."""
        return Side.LEFT if self is Side.RIGHT else Side.RIGHT

    @property
    def lateral(self) -> float:
        """Sign of y on this side of the robot: y points to the left."""
        return 1.0 if self is Side.LEFT else -1.0
