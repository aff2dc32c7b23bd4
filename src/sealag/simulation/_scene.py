"""What surrounds the robot in a run: feet and ground, pushes, and when it has fallen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

from sealag.errors import InputError
from sealag.robot import Contact, ContactKind, Robot
from sealag.simulation._ground import Foot
from sealag.simulation._hold import Hold, require_hold, touching_posture
from sealag.typing import Array
from sealag.walking import Ground, GroundProfile, Walking


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A constant force on the origin of a frame for some time.

    Attributes:
        frame: Where it acts.
        force: Force in the world frame (3,), N.
        start: When it begins, s.
        duration: How long it lasts, s; steps are split where it begins and ends.

    Raises:
        InputError: The force is not three finite numbers, or the times are negative.
    """

    frame: str
    force: tuple[float, float, float]
    start: float
    duration: float

    def __post_init__(self) -> None:
        if len(self.force) != 3 or not all(map(math.isfinite, self.force)):
            raise InputError(f"push on {self.frame}: force must be 3 finite numbers (N)")
        if not (self.start >= 0 and self.duration > 0 and math.isfinite(self.start)):
            raise InputError(
                f"push on {self.frame}: start must be >= 0 s and duration > 0 s, "
                f"got {self.start} and {self.duration}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class FallLimits:
    """When a floating-base robot counts as fallen.

    Attributes:
        height_fraction: Base height above the ground, as a fraction of its height at the start.
        tilt: Angle between the base's z axis and its direction at the start, rad.
    """

    height_fraction: float = 0.5
    tilt: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What surrounds the robot.

    Attributes:
        feet: What may touch the ground.
        ground: Where the ground is.
        pushes: Disturbing forces.
        fall: When the robot counts as fallen; None never.
        stabilisation: Rate at which contacts return to where they closed, 1/s.
    """

    feet: Sequence[Foot] = ()
    ground: Ground = field(default_factory=GroundProfile)
    pushes: Sequence[Push] = ()
    fall: FallLimits | None = field(default_factory=FallLimits)
    stabilisation: float = 50.0

    def touching_posture(self, robot: Robot, q: Array) -> Array:
        """Return the nearest posture in which every contact point touches the ground.

        Args:
            robot: The robot.
            q: Configuration (nq,).

        Raises:
            InputError: A point is more than 10 mm from the ground when another one touches, or no
                posture nearby lets all of them touch.
        """
        return touching_posture(robot, q, self.feet, ground=self.ground)

    def require_hold(self, robot: Robot, q: Array, *, torque_limit: Array) -> Hold:
        """Return the contact forces and torques that hold a posture against gravity.

        Args:
            robot: The robot.
            q: Configuration (nq,).
            torque_limit: Limits (n,), Nm; inf for none.

        Raises:
            InputError: No foot touches, or the torque limits cannot hold the robot.
        """
        return require_hold(robot, q, self.feet, ground=self.ground, torque_limit=torque_limit)

    @classmethod
    def of_walk(cls, walking: Walking, pushes: Sequence[Push] = ()) -> Self:
        """Return what surrounds a walk: its ground and two point feet.

        Args:
            walking: The walk.
            pushes: Disturbing forces.
        """
        feet = [
            Foot(
                contact=Contact(frame=frame, kind=ContactKind.POINT),
                friction=walking.friction,
                radius=walking.gait.foot_radius,
            )
            for frame in walking.feet
        ]
        return cls(feet=feet, ground=walking.ground, pushes=pushes)
