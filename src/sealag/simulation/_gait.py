"""Footholds, apexes and step widths of a simulated walk, against its plan."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from sealag.actuation import Actuators
from sealag.delay import Delays
from sealag.robot import Robot, Workspace
from sealag.simulation._gait_margin import GaitCase, GaitMargin
from sealag.simulation._network import Clock
from sealag.simulation._outcome import EventKind, Outcome
from sealag.simulation._run import Run
from sealag.typing import Array, IntArray
from sealag.walking import Walking

SPEED_TOLERANCE = 0.20
"""Relative. Ten times less calls every answer to a push a failed gait; ten times more calls a robot
that stumbles forward or stands still one."""
WIDTH_TOLERANCE = 0.25
"""Relative. Ten times less forbids the steps aside that placement takes for balance; ten times more
allows crossed legs."""
SETTLING = 2
"""Steps before the gait counts. Without them the start counts; 20 are longer than most walks."""
GRAZE = 0.3
"""Share of a step time that lies between touchdowns at least. At 0.03 a foot that grazes the ground
counts as a step; a share of 3 hides every second step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredGait:
    """The gait of a simulated walk: S steps, A apexes, N logged instants.

    Attributes:
        walking: what was asked for.
        outcome: how the run ended.
        message: one sentence about the end; empty when completed.
        touchdown: (S + 1,) instants of the footholds, the first is the start, s.
        foot: (S + 1,) the side of each foothold, 0 left and 1 right.
        place: (S + 1, 3) footholds, m.
        apex_time: (A,) instants at which the CoM passes over the stance foot, s.
        apex_speed: (A,) forward speed of the CoM then, m/s.
        apex_step: (A,) which foothold was stood on.
        step_width: (S,) lateral distance of successive footholds, positive when not crossed, m.
        com: (N, 3) CoM at the logged instants, m.
    """

    walking: Walking
    outcome: Outcome
    message: str
    touchdown: Array
    foot: IntArray
    place: Array
    apex_time: Array
    apex_speed: Array
    apex_step: IntArray
    step_width: Array
    com: Array

    @classmethod
    def of(cls, robot: Robot, run: Run, walking: Walking) -> Self:
        """Find footholds, apexes and step widths in a run.

        A foothold is where the foot that was in the air touches down. An apex is where the CoM
        passes over the foot that touched down last.

        Args:
            robot: The robot that walked.
            run: The simulation.
            walking: What was asked for.
        """
        at = robot.workspace()
        com = np.empty((len(run.time), 3))
        for row, q in enumerate(run.q):
            com[row] = at.center_of_mass(q)
        times, sides = _footholds(run, walking)
        index = np.minimum(np.searchsorted(run.time, times), len(run.time) - 1)
        place = np.array(
            [robot.frame_placement(walking.feet[f], run.q[i])[1] for i, f in zip(index, sides)]
        )
        lateral = 1.0 - 2.0 * np.array(sides[1:])  # +1 left, -1 right: y points to the left
        stood = np.searchsorted(np.array(times), run.time, side="right") - 1
        ahead = com[:, 0] - place[stood, 0]
        same = stood[1:] == stood[:-1]
        apex = np.flatnonzero(same & (ahead[:-1] <= 0.0) & (ahead[1:] > 0.0))
        return cls(
            walking=walking,
            outcome=run.outcome,
            message=run.message,
            touchdown=np.array(times),
            foot=np.array(sides, dtype=np.int64),
            place=place,
            apex_time=run.time[apex],
            apex_speed=np.array([_forward_speed(at, run.q[i], run.v[i]) for i in apex]),
            apex_step=stood[apex],
            step_width=lateral * np.diff(place[:, 1]),
            com=com,
        )

    @staticmethod
    def margin(
        robot: Robot,
        actuators: Actuators,
        walking: Walking,
        *,
        delays: Delays,
        clock: Clock,
        jobs: int = 2,
    ) -> GaitMargin:
        """Find up to which constant delay a gait on level ground is stable, see `GaitCase.margin`.

        Args:
            robot: Robot, as the controller knows it.
            actuators: Springs and motors likewise.
            walking: The walk; its ground is taken as level.
            delays: The design's; all ways are late in the proportion of their means.
            clock: Periods.
            jobs: Number of processes.

        Raises:
            InputError: The delays are 0, or the robot cannot walk so.
        """
        case = GaitCase(
            robot=robot, actuators=actuators, walking=walking, delays=delays, clock=clock
        )
        return case.margin(jobs=jobs)

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return len(self.step_width)

    @property
    def walked(self) -> bool:
        """Whether all steps were taken without a fall."""
        return self.outcome is Outcome.COMPLETED and self.steps >= self.walking.steps

    @property
    def settled_speed(self) -> Array:
        """Apex speeds after the second step, m/s."""
        return self.apex_speed[self.apex_step >= SETTLING]

    @property
    def settled_width(self) -> Array:
        """Step widths after the second step, m."""
        return self.step_width[SETTLING:]

    @property
    def speed_deviation(self) -> float:
        """Largest relative deviation of the settled apex speeds from the plan; NaN if none."""
        return _deviation(self.settled_speed, self.walking.gait.apex_speed)

    @property
    def width_deviation(self) -> float:
        """Largest relative deviation of the settled step widths from the plan; NaN if none."""
        return _deviation(self.settled_width, self.walking.gait.step_width)

    @property
    def is_gait(self) -> bool:
        """Whether it walked, with apex speeds within 20 % and step widths within 25 %."""
        good = self.speed_deviation <= SPEED_TOLERANCE and self.width_deviation <= WIDTH_TOLERANCE
        return self.walked and good

    @property
    def cause(self) -> str:
        """How it ended, in words."""
        if self.walked:
            return "walked"
        if self.outcome is Outcome.COMPLETED:
            return f"only {self.steps} steps in time"
        return f"{self.outcome.value} after {self.steps} steps: {self.message}"


def _footholds(run: Run, walking: Walking) -> tuple[list[float], list[int]]:
    """Instants of the touchdowns and which foot touched down, from the start on."""
    times, sides = [0.0], [int(run.contact_mode[0].argmax())]
    for event in run.events:
        side = walking.feet.index(event.foot)
        late = event.time - times[-1] > GRAZE * walking.gait.step_time
        if event.kind is EventKind.TOUCHDOWN and side != sides[-1] and late:
            times.append(event.time)
            sides.append(side)
    return times, sides


def _deviation(values: Array, planned: float) -> float:
    return float(np.abs(values / planned - 1.0).max()) if len(values) else float("nan")


def _forward_speed(at: Workspace, q: Array, v: Array) -> float:
    at.update(q, v)
    return float(at.com_velocity[0])
