"""A design's delays as whole steps of MuJoCo, and what MuJoCo cannot represent of them."""

import math
from dataclasses import dataclass
from typing import Self

from sealag.delay import Delays, Link
from sealag.errors import InputError
from sealag.units import in_ms

_TICKS = 10**12
"""Ticks a second, in which steps and delays are compared: picoseconds. A thousand times coarser
takes 1/3 ms, written with nine digits, for a multiple of 1 ns; a hundred times finer is beyond the
rounding of 5 s."""

LEAST_STEP = 1e-6
"""s; as short as simulation.physics_step_ms may be. Delays that share no longer one are a slip."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCounts:
    """Delays and control period in steps of the simulation.

    Attributes:
        step: the time step, s.
        measurement: steps by which sensors are late, the way up.
        command: steps by which actuators are late, both ways down.
        tick: steps between two commands of the central controller, which holds each.
    """

    step: float
    measurement: int
    command: int
    tick: int

    @classmethod
    def of(cls, delays: Delays, *, longest: float, step: float | None = None) -> Self:
        """Count the steps of constant delays.

        Without an embedded period a packet is taken on when it arrives. With one, each hop ends
        at the receiver's next look: its delay is rounded up to a multiple of the period.

        Args:
            delays: of the design, with the period of a controller that runs.
            longest: step that springs and motors allow, s.
            step: the step asked for, s; the longest that divides all if None.

        Raises:
            InputError: a delay varies or packets are lost, the step does not divide a delay or the
                period, or a step would have to be shorter than LEAST_STEP.
        """
        if longest < LEAST_STEP:
            raise InputError(
                f"The springs allow steps of {in_ms(longest)}, shorter than {in_ms(LEAST_STEP)}; "
                "give softer springs, or heavier rotors or links."
            )
        up, down, drive = (
            _constant(name, link)
            for name, link in (
                ("way up of the central connection", delays.central.up),
                ("way down of the central connection", delays.central.down),
                ("way down of the embedded connection", delays.embedded.down),
            )
        )
        tick, look = _ticks(delays.sample_time), _ticks(delays.embedded_period)
        if look:
            up, down, drive = (math.ceil(hop / look) * look for hop in (up, down, drive))
        parts = {
            "delay of measurements": up,
            "delay of commands": down + drive,
            "controller's period": tick,
        }
        common = math.gcd(*parts.values())
        most = min(longest, step) if step is not None and step >= LEAST_STEP else longest
        fits = _longest_step(common, most)
        if step is not None:
            _require_multiples(parts, step, fits, longest)
            fits = step
        elif fits < LEAST_STEP:
            said = ", ".join(f"{name} {in_ms(part / _TICKS)}" for name, part in parts.items())
            raise InputError(
                f"No step of {in_ms(LEAST_STEP)} or more divides all of {said}; round them."
            )
        measurement, command, period = (round(part / _TICKS / fits) for part in parts.values())
        return cls(step=fits, measurement=measurement, command=command, tick=period)

    @property
    def measurement_delay(self) -> float:
        """Delay of the sensors, s."""
        return round(self.measurement * self.step, 12)

    @property
    def command_delay(self) -> float:
        """Delay of the actuators, s."""
        return round(self.command * self.step, 12)

    @property
    def hold(self) -> float:
        """How long a command is held, s."""
        return round(self.tick * self.step, 12)

    @property
    def total(self) -> float:
        """Largest age of the measurement behind a command at work, s."""
        return round((self.measurement + self.command + self.tick) * self.step, 12)


def _ticks(time: float) -> int:
    return round(time * _TICKS)


def _constant(name: str, link: Link) -> int:
    """A link's delay in ticks, if every packet is equally late and none is lost."""
    if link.constant:
        return _ticks(link.delay.upper_bound)
    late = link.delay.upper_bound + link.jitter
    what = f"varies between {in_ms(link.delay.lower_bound)} and {in_ms(late)}"
    if link.spread == 0.0:
        what = f"loses packets, {link.loss:g} of all"
    raise InputError(
        f"In [delays] the {name} {what}; a delay in a MuJoCo file is one constant number: give "
        f'the worst case of each way, here {{ kind = "constant", value_ms = {late * 1e3:.9g} }}.'
    )


def _require_multiples(parts: dict[str, int], step: float, fits: float, longest: float) -> None:
    """Refuse a step that springs do not allow, or that does not divide a delay or period."""
    remedy = f"{in_ms(fits)} would do"
    if fits < LEAST_STEP:
        remedy = f"no step of {in_ms(LEAST_STEP)} or more would do: round the delays"
    if not LEAST_STEP <= step < math.inf:
        raise InputError(
            f"The step is {in_ms(step)}; at least {in_ms(LEAST_STEP)} is needed, and {remedy}."
        )
    if step > longest * (1.0 + 1e-9):
        raise InputError(
            f"The step of {in_ms(step)} is too long for the design's springs, which allow "
            f"{in_ms(longest)}; {remedy}."
        )
    whole = _ticks(step)
    for name, part in parts.items():
        if part % whole:
            rounded = in_ms(math.ceil(part / whole) * whole / _TICKS)
            raise InputError(
                f"The {name}, {in_ms(part / _TICKS)}, is no multiple of the step {in_ms(step)}, "
                f"and would become {rounded} in MuJoCo; {remedy}."
            )


def _longest_step(common: int, most: float) -> float:
    """The longest step, s, up to one, that is a whole part of ticks; else one below LEAST_STEP."""
    count = max(1, math.ceil(common / _TICKS / most - 1e-9))
    while common % count and common >= count * LEAST_STEP * _TICKS:
        count += 1
    return common / _TICKS / count
