"""Foot placement by the predicted capture point at the end of the step."""

import math

import numpy as np

from sealag.typing import Array
from sealag.walking._carried import Carried
from sealag.walking._gait import WalkingGait
from sealag.walking._options import WalkingOptions
from sealag.walking._step import StepReferences

_FORWARD = (-0.15, 0.55)  # m from the stance foot: what the legs reach
_WIDEST = 0.5  # m
_FASTER = 0.3  # largest relative correction of the speed


class Placement:
    """Places the next foot so that the step after it ends at the plan's capture point.

    The present step is integrated to its end with the planned height; what it will end with is a
    constant of the undisturbed motion, so it is averaged over time. Errors of the capture point
    are then undone within one step, those of its stable counterpart decay by exp(−ωT) per step.

    Args:
        gait: The plan.
        options: Which means are used.
        mass: The robot's, kg.
    """

    def __init__(self, gait: WalkingGait, options: WalkingOptions, mass: float) -> None:
        from sealag.kernels import walking

        self._kernel, self._gait, self._options, self._mass = walking, gait, options, mass
        self.plan = gait.periodic()
        plan = self.plan
        nearest, farthest = _FORWARD
        wanted = walking.Gait(
            step_time=gait.step_time, transfer_time=gait.transfer_time, rate=plan.rate,
            growth=plan.growth, carried=plan.carried, end_outward=plan.end_outward,
            nearest=nearest, farthest=farthest, narrowest=gait.smallest_width, widest=_WIDEST,
        )  # fmt: skip
        self._wanted = tuple(wanted)
        self._end, self._momentum = np.zeros((2, 2)), np.zeros(2)
        self._fresh = True
        self._started, self._before, self._speed = False, 0.0, np.zeros(1)

    def memory(self) -> list[Carried]:
        """Return what is carried from tick to tick: average, and correction of the speed."""
        numbers = ("_fresh", "_started", "_before")
        return [Carried(self, numbers, ((self._end, (0,)), (self._speed, ())))]

    @property
    def _faster(self) -> float:
        """Relative correction of the speed."""
        return float(self._speed[0])

    @_faster.setter
    def _faster(self, value: float) -> None:
        self._speed[0] = value

    def restart(self) -> None:
        """Forget the average: a new step begins."""
        self._fresh, self._before = True, 0.0

    def update(
        self, phase: float, step: StepReferences, com: Array, com_rate: Array, *,
        angular: Array, period: float,
    ) -> None:  # fmt: skip
        """Re-plan the target of the swing foot.

        Args:
            phase: Time since the step's touchdown, s.
            step: The step's references; ``target`` is moved.
            com: (3,) m.
            com_rate: (3,) m/s.
            angular: Angular momentum about the CoM (3,), kg m²/s.
            period: Time since the last call, s.
        """
        gait, options, kernel = self._gait, self._options, self._kernel
        speed, momentum = float(com_rate[0]), self._momentum
        if options.momentum_placement:
            weight = self._mass * max(float(com[2] - step.new[2]), 0.4)
            momentum[0], momentum[1] = angular[1] / weight, -angular[0] / weight
        self._watch_apex(float(com[0] - step.new[0]), speed, speed + float(momentum[0]))
        share = 1.0
        if not self._fresh and options.placement_time > 0.0:
            share = 1.0 - math.exp(-period / options.placement_time)
        self._fresh = False
        faster = 1.0 + (self._faster if options.bias_gain > 0.0 else 0.0)
        now = kernel.StepNow(
            old=step.old, new=step.new, height=step.height, offset=step.offset, phase=phase,
            side=step.outward, end_forward=self.plan.end_forward * faster,
        )  # fmt: skip
        x, y = kernel.capture_end(
            com, com_rate, momentum, tuple(now), self._wanted, share, self._end
        )
        if gait.step_time - phase > options.placement_freeze:
            step.target[0], step.target[1], step.target[2] = x, y, step.foot_height(x, y)

    def _watch_apex(self, ahead: float, speed: float, pendulum: float) -> None:
        """Integrate the relative error of the apex speed; begin with what the legs' momentum adds.

        At the start, an apex, the CoM moves at the plan's speed and the pendulum more slowly.
        """
        planned = self._gait.apex_speed
        if not self._started:
            self._started, self._faster = True, (pendulum - speed) / planned
        elif self._before < 0.0 <= ahead:
            self._faster += self._options.bias_gain * (planned - speed) / planned
            self._faster = min(max(self._faster, -_FASTER), _FASTER)
        self._before = ahead
