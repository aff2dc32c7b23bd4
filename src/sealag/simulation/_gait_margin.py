"""The gait's own margin: Floquet multipliers against delay, and where the simulation falls."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sealag.actuation import Actuators
from sealag.delay import Delays, Link, Table
from sealag.errors import InputError
from sealag.robot import Robot
from sealag.simulation._network import Clock, Network
from sealag.simulation._orbit import find_orbit
from sealag.simulation._stride import Changed, Fallen, Strides
from sealag.typing import Array
from sealag.walking import Walking
from sealag.workers import in_parallel

_FIRST = 4  # strides at the design's own delay, or the asked one if that is shorter
_RAMP = 16  # strides in which the delay grows from there
_HELD = 10  # strides at the asked delay before Newton's method
_WALKED = 40  # strides at the asked delay that a walk takes without a fall
_GROWTH = 1.5  # of the delay from one of the first ones to the next
_MOST = 8  # of those
_RESOLVED = 0.02  # of the delay, between the last one that is stable and the first one that is not


@dataclass(frozen=True, slots=True, kw_only=True)
class GaitAtDelay:
    """What becomes of a gait at one constant delay.

    Attributes:
        delay_s: d_1 = T_H + T_L/2 at which the walk was simulated, s.
        residual: by how much it does not repeat itself, rad, rad/s, m or m/s; 0.01 and more where
            a touchdown falls on the instant of a sample.
        multipliers: Floquet multipliers of a stride of two steps, largest first; empty if no
            periodic gait was found.
        error: how far the largest of them may be off.
        walks: whether the walk takes 40 strides there, after its delay has grown from the design's.
        reason: what became of the gait, if it has no multipliers.
    """

    delay_s: float
    residual: float
    multipliers: Array
    error: float
    walks: bool
    reason: str

    @property
    def radius(self) -> float:
        """Modulus of the largest multiplier; inf where there is no periodic gait."""
        return float(abs(self.multipliers[0])) if len(self.multipliers) else math.inf

    @property
    def stable(self) -> bool:
        """Whether the gait returns after every small push, the error counted against it."""
        return self.radius + self.error < 1.0

    def summary(self) -> dict[str, Any]:
        """Return everything as JSON says it."""
        return {
            "delay_s": self.delay_s,
            "stable": self.stable,
            "radius": self.radius if len(self.multipliers) else None,
            "radius_error": self.error if len(self.multipliers) else None,
            "multipliers": [[one.real, one.imag] for one in self.multipliers[:6]],
            "residual": self.residual if len(self.multipliers) else None,
            "walks": self.walks,
            "reason": self.reason,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class GaitMargin:
    """Up to which constant delay a gait is orbitally stable, and its simulated walk does not fall.

    Attributes:
        points: what was computed, in the order of the delay.
        design_s: mean d_1 of the design, s.
        neutral: translations along level ground, whose multipliers are 1, that were taken out.
    """

    points: tuple[GaitAtDelay, ...]
    design_s: float
    neutral: int

    @property
    def delay_s(self) -> float:
        """Largest delay at which the gait was found stable, below the first at which it was not, s;
        0 if it never was."""
        return _last(self.points, lambda point: point.stable)

    @property
    def falls_s(self) -> float:
        """Smallest delay at which the simulated walk falls, s; inf if it never did."""
        return min((point.delay_s for point in self.points if not point.walks), default=math.inf)

    @property
    def walks_s(self) -> float:
        """Largest delay at which the simulated walk does not fall, below the first one at which it
        does, s; 0 if it always falls."""
        return _last(self.points, lambda point: point.walks)

    def summary(self) -> dict[str, Any]:
        """Return everything as JSON says it."""
        return {
            "gait_margin_s": self.delay_s,
            "walks_s": self.walks_s,
            "falls_s": self.falls_s if math.isfinite(self.falls_s) else None,
            "design_s": self.design_s,
            "neutral": self.neutral,
            "points": [point.summary() for point in self.points],
        }


def _last(points: tuple[GaitAtDelay, ...], good: Callable[[GaitAtDelay], bool]) -> float:
    last = 0.0
    for point in points:
        if not good(point):
            break
        last = point.delay_s
    return last


@dataclass(frozen=True, slots=True, kw_only=True)
class GaitCase:
    """What walks: pickled to workers.

    Attributes:
        robot: robot, as the controller knows it.
        actuators: springs and motors likewise.
        walking: the walk.
        delays: the design's; each way's mean counts.
        clock: periods.
    """

    robot: Robot
    actuators: Actuators
    walking: Walking
    delays: Delays
    clock: Clock

    @property
    def mean(self) -> float:
        """Mean d_1 = T_H + T_L/2 of the design, without holds, s."""
        return self.delays.central.mean + self.delays.embedded.down.delay.mean

    def strides(self, ratio: float, *, held: int) -> Strides:
        """Return the walk at the start, with delays that grow to a multiple of the design's mean.

        Args:
            ratio: the multiple.
            held: strides for which it can walk on then.
        """
        first = min(1.0, ratio)
        stride = 2.0 * self.walking.gait.step_time
        times = stride * np.array([_FIRST, _FIRST + _RAMP])

        def link(given: Link) -> Link:
            mean = given.delay.mean
            return Link(delay=Table(time=times, delay=mean * np.array([first, ratio])))

        network = Network.from_delays(self.delays)
        back = network.embedded_up
        return Strides(
            self.robot,
            self.actuators,
            replace(self.walking, steps=2 * (_FIRST + _RAMP + held)),
            network=Network(
                central_up=link(network.central_up),
                central_down=link(network.central_down),
                embedded_down=link(network.embedded_down),
                embedded_up=None if back is None else link(back),
            ),
            clock=self.clock,
        )

    def at(self, ratio: float) -> GaitAtDelay:
        """Return what becomes of the gait at a multiple of the design's mean delay.

        Args:
            ratio: the multiple.
        """
        strides, orbit, reason = self.strides(ratio, held=_WALKED + 1), None, ""
        try:
            strides.run(_FIRST + _RAMP)
            there = strides.save()
            orbit = find_orbit(strides, warm=_HELD)
            reason = "" if orbit else "the walk does not repeat itself"
            strides.load(there)
            strides.run(_WALKED)
            walks = True
        except Changed as change:
            walks, reason = True, str(change)
        except Fallen as stop:
            walks, reason = False, reason or ("" if orbit else str(stop))
        return GaitAtDelay(
            delay_s=ratio * self.mean,
            residual=orbit.residual if orbit else math.nan,
            multipliers=orbit.multipliers if orbit else np.zeros(0),
            error=orbit.error if orbit else 0.0,
            walks=walks,
            reason=reason,
        )

    def margin(self, *, jobs: int = 2) -> GaitMargin:
        """Find up to which constant delay a clocked gait on level ground is orbitally stable.

        The delay of all ways is a multiple of the design's mean. From the design's own on it grows
        by half until the gait is not stable, or falls by half until it is; both ends, that of the
        multipliers and that of the simulated walk, are then bisected to 2 %. Stable again at
        longer delays is not looked for. Docs/theory section 12.1.

        Args:
            jobs: number of processes.

        Raises:
            InputError: the design has no delay to scale, or cannot walk.
        """
        if not self.mean > 0.0:
            raise InputError(
                "The gait's margin scales the design's delays, and all are 0: give [delays] "
                "central_round_trip and embedded_round_trip a proportion, 20 to 3 ms as an example."
            )
        found: dict[float, GaitAtDelay] = {}

        def look(ratios: list[float]) -> None:
            new = [ratio for ratio in dict.fromkeys(ratios) if ratio not in found]
            answers = in_parallel(GaitCase.at, [(self, ratio) for ratio in new], jobs=jobs)
            found.update(zip(new, answers, strict=True))

        look([1.0, _GROWTH])
        if not (found[1.0].stable and found[1.0].walks):
            look([0.5, 0.25])
        for k in range(2, _MOST, 2):
            last = found[max(found)]
            if not (last.stable or last.walks):
                break
            look([_GROWTH**k, _GROWTH ** (k + 1)])
        for _ in range(12):
            wanted = [_between(found, good) for good in (lambda p: p.stable, lambda p: p.walks)]
            wanted = [ratio for ratio in wanted if ratio is not None]
            if not wanted:
                break
            look(wanted)
        points = tuple(found[ratio] for ratio in sorted(found))
        neutral = self.strides(1.0, held=1).neutral
        return GaitMargin(points=points, design_s=self.mean, neutral=neutral)


def _between(found: dict[float, GaitAtDelay], good: Callable[[GaitAtDelay], bool]) -> float | None:
    """The middle of the last multiple that is good and the first that is not; None if near."""
    low, high = 0.0, math.inf
    for ratio in sorted(found):
        if not good(found[ratio]):
            high = ratio
            break
        low = ratio
    if not math.isfinite(high) or high - low <= _RESOLVED * high or low == 0.0:
        return None
    return 0.5 * (low + high)
