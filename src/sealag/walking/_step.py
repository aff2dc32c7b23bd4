"""References within a step: CoM height and swing foot, continuous while the foothold moves."""

import numpy as np

from sealag.typing import Array
from sealag.walking._carried import Carried
from sealag.walking._feet import Side
from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground

_STILL = 0.93  # share of the swing after which the foot no longer moves horizontally
_SEARCH = 0.3  # m/s at which a foot that has not met the ground is lowered


class StepReferences:
    """The references of the step under way.

    Args:
        gait: The plan.
        ground: The ground as the controller believes it to be.
        step_length: Length of the plan's steps, m.

    Attributes:
        begin: Instant of the step's touchdown on the controller's clock, s.
        stance: Number of the foot stood on, a `Side`.
        swing_foot: Number of the other one.
        outward: Sign of y from the stance foot to the swing foot.
        old: Where the foot to be lifted stands (3,), m.
        new: Where the foot stood on stands (3,), m.
        target: Where the swing foot shall land (3,), m.
        height: Quintic of the CoM height (6,), time from phase ``offset``.
        offset: Phase at which that quintic begins, s.
        swing: Position, velocity, acceleration of the swing foot (3, 3).
        swinging: Whether the foot has left the ground.
        transfer_time: Duration of the double support, s.
    """

    def __init__(self, gait: WalkingGait, ground: Ground, *, step_length: float) -> None:
        from sealag.kernels import walking

        self._kernel, self._gait, self._ground = walking, gait, ground
        self._length = step_length
        self.begin, self.offset = 0.0, 0.0
        self._stand(Side.RIGHT)
        self.transfer_time = gait.transfer_time
        self.old, self.new, self.target = np.zeros(3), np.zeros(3), np.zeros(3)
        self.height = np.zeros(6)
        self.swing = np.zeros((3, 3))
        self.swinging = False
        self._now, self._end = np.zeros(3), np.zeros(3)
        self._plan = walking.SwingPlan(
            step_time=gait.step_time, transfer_time=gait.transfer_time, still=_STILL,
            search=_SEARCH,
        )  # fmt: skip
        self._path = np.array([0.0, gait.clearance])  # m: begin of the swing, middle above the line

    def _stand(self, stance: Side) -> None:
        """Stand on a foot; the numbers are plain integers, as kernels take them."""
        self.stance, self.swing_foot = int(stance), int(stance.other)
        self.outward = stance.other.lateral

    def memory(self) -> list[Carried]:
        """Return what is carried from tick to tick."""
        places = ((self.new, (0,)), (self.old, (0,)), (self.target, (0,)), (self.swing, (0,)))
        numbers = ("stance", "swing_foot", "outward", "swinging", "offset")
        return [
            Carried(self, numbers, (*places, (self.height, ()), (self._path, ())), clock="begin")
        ]

    def foot_height(self, x: float, y: float) -> float:
        """Return the height (m) of a foot's frame that stands at ``x``, ``y``."""
        return self._ground.height(x, y) + self._gait.foot_radius

    def phase(self, t: float) -> float:
        """Return the time since the step's touchdown, s.

        Instants closer than a nanosecond are one: else rounding would decide in which tick the
        weight transfer ends.
        """
        return round(t - self.begin, 9)

    def start(
        self, t: float, stance: Side, *, phase: float, com: Array, feet: Array, swing: Array
    ) -> None:
        """Begin in the middle of a step.

        Args:
            t: Now, s.
            stance: Foot stood on.
            phase: Phase of the step now, s.
            com: CoM height and its rate (2,), m, m/s.
            feet: Positions (2, 3), m.
            swing: Velocity of the swing foot (3,), m/s.
        """
        self._stand(stance)
        self.begin, self.offset = t - phase, phase
        self.new[:] = feet[self.stance]
        self.old[:] = self.new
        self.old[0] -= self._length
        self.old[1] += self.outward * self._gait.step_width
        self._path[0] = self.foot_height(self.old[0], self.old[1])
        self._now[:] = com[0], com[1], 0.0
        self._aim()
        self.swing[0], self.swing[1], self.swing[2] = feet[self.swing_foot], swing, 0.0
        self.swinging = True
        self._clear()

    def change(self, t: float, feet: Array) -> None:
        """Stand on the foot that has swung.

        Args:
            t: Now, s.
            feet: Positions (2, 3), m.
        """
        self._kernel.quintic_at(self.height, self.height_time(t), self._now)
        self.begin, self.offset = t, 0.0
        self._stand(Side(self.swing_foot))
        self.old[:], self.new[:] = feet[self.swing_foot], feet[self.stance]
        self.swinging = False
        self._aim()

    def _aim(self) -> None:
        """Set a first target and plan the CoM height to the mean of the footholds ahead."""
        gait = self._gait
        self.target[0] = self.new[0] + self._length
        self.target[1] = self.new[1] + self.outward * gait.step_width
        self.target[2] = self.foot_height(self.target[0], self.target[1])
        ahead = self.foot_height(self.target[0] + self._length, self.new[1])
        self._end[0] = gait.com_height + 0.5 * (self.new[2] + self.target[2]) - gait.foot_radius
        self._end[1] = 0.25 * (ahead - self.new[2]) / gait.step_time
        self._end[2] = 0.0
        self._kernel.quintic(self._now, self._end, self._gait.step_time - self.offset, self.height)

    def height_time(self, t: float) -> float:
        """Return the time (s) of the height's quintic at ``t`` (s)."""
        return min(self.phase(t), self._gait.step_time) - self.offset

    def lift(self, foot: Array) -> None:
        """Begin the swing at the foot's position (3,), m."""
        self.swing[0], self.swing[1:] = foot, 0.0
        self._path[0] = foot[2]
        self.swinging = True
        self._clear()

    def _clear(self) -> None:
        """Raise the swing so that it clears the ground between the footholds."""
        start, end = self.old, self.target
        excess = 0.0
        for u in (0.2, 0.35, 0.5, 0.65, 0.8):
            x, y = start[:2] + u * (end[:2] - start[:2])
            line = self._path[0] + u * (end[2] - self._path[0])
            excess = max(excess, self.foot_height(float(x), float(y)) - line)
        self._path[1] = self._gait.clearance + excess

    def move(self, t: float, period: float) -> None:
        """Move the swing reference to ``t`` (s), one ``period`` (s) after the last."""
        lift, bump = self._path.tolist()
        self._kernel.swing(
            self.swing, self.target, self.phase(t), period, tuple(self._plan), lift, bump
        )
