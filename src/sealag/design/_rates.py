"""What a sample rate costs: sampled and held loops of one design."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from sealag.design._along import Along
from sealag.design._criteria import bounds_along
from sealag.design._design import Design
from sealag.design._jitter import loops_at
from sealag.design._local import local_of
from sealag.design._margins import stated
from sealag.design._matrices import Matrices
from sealag.errors import ContractionError, InputError
from sealag.passivity import Criterion
from sealag.whole_body import FrozenLoop

RATES = (50.0, 100.0, 200.0, 400.0, 500.0, 1000.0)
"""Hz, of a sweep if nothing else is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """One sample rate of a design.

    Attributes:
        rate_hz: of the central controller.
        way_s: the design's delay at that rate, without the hold, s.
        largest_s: largest constant delay beside the hold that was found stable, s; None where more
            commands wait than can be lifted.
        proven_s: constant delays up to here are stable for sure, s.
        stable: whether the sampled loop is stable at that delay and all that were tried below; None
            if it is too large to be tried.
    """

    rate_hz: float
    way_s: float
    largest_s: float | None
    proven_s: float
    stable: bool | None

    def summary(self) -> dict[str, Any]:
        """Return everything as JSON says it."""
        return {
            "rate_hz": self.rate_hz,
            "way_s": self.way_s,
            "stable": self.stable,
            "largest_delay_s": stated(self.largest_s),
            "proven_s": stated(self.proven_s),
        }


def _loops(system: Design) -> list[FrozenLoop]:
    """In the posture and, where the law sags, where it rests."""
    if system.program is not None:
        return [system.frozen()]
    along = Along.of(system)
    bounds = bounds_along(along, Criterion.CERTIFIED, rest=along.rest).bound.delay
    local = local_of(along, bounds, along.rest)
    if local.loop is None:
        raise ContractionError(local.problem)
    return list(loops_at(along, 0, local))


def rate_sweep(system: Design, rates: Sequence[float]) -> tuple[Rate, ...]:
    """Return what `System.rate_sweep` does.

    Args:
        system: the design.
        rates: Hz.
    """
    loops = _loops(system)
    if any(loop.A_e.any() and loop.embedded_delay for loop in loops):
        raise InputError(
            "A rate sweep takes one delay, and torque feedback is late too: leave out "
            "delays.delayed_torque_feedback."
        )
    own = round(1.0 / system.delays.sample_time, 6)
    ticked = system.program is not None and bool(loops[0].memory_period)
    fixed = ticked and isinstance(system.program, Matrices)
    # matrices of a period answer for that one only, programs tick at any
    asked = {own} if fixed and rates is RATES else {own, *rates}
    found = []
    for rate in sorted(asked):
        period = 1.0 / rate
        way = replace(system.delays, sample_time=period).d_1 - period
        if ticked and not fixed:
            loops = [system.frozen(period=period)]
        margins = [loop.sampled_margin(period) for loop in loops]
        margin = min(margins, key=lambda one: one.proven if one.delay is None else one.delay)
        stable = True if way <= (margin.delay or margin.proven) else None
        if margin.delay is not None:
            stable = way <= margin.delay
        found.append(
            Rate(
                rate_hz=rate,
                way_s=way,
                largest_s=margin.delay,
                proven_s=margin.proven,
                stable=stable,
            )
        )
    return tuple(found)
