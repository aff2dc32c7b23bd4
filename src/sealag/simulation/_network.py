"""The network between robot and controllers, and how often each of them looks."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from sealag.delay import Constant, Delays, Link, RoundTrip
from sealag.errors import InputError
from sealag.simulation._exchange import Exchanges
from sealag.typing import Array
from sealag.units import in_ms

MOST_PACKETS = 2e7  # each takes about 130 bytes while their ways are planned


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """Both directions of the central and of the embedded connection.

    A measurement reaches the central controller over ``central_up``; a command travels over
    ``central_down`` and then ``embedded_down``. The embedded damping acts without delay.

    Attributes:
        central_up: Robot to central controller.
        central_down: Central controller to embedded master.
        embedded_down: Embedded master to motor drives.
        embedded_up: Spring torque to the drives' torque feedback; None is without delay, as the
            analysis assumes.
    """

    central_up: Link
    central_down: Link
    embedded_down: Link
    embedded_up: Link | None = None

    @classmethod
    def ideal(cls) -> Self:
        """Return a network without delay."""
        link = Link(delay=Constant(value=0.0))
        return cls(central_up=link, central_down=link, embedded_down=link)

    @classmethod
    def from_delays(cls, delays: Delays) -> Self:
        """Return the links of a design's delays.

        Args:
            delays: Both connections.
        """
        late = delays.delayed_torque_feedback
        return cls(
            central_up=delays.central.up,
            central_down=delays.central.down,
            embedded_down=delays.embedded.down,
            embedded_up=delays.embedded.up if late else None,
        )

    def delay_bound(self, clock: "Clock") -> float:
        """Return an upper bound of the total delay d_1 of the position feedback, s.

        Args:
            clock: How often packets are sent and looked for.
        """
        return Delays(
            central=RoundTrip(up=self.central_up, down=self.central_down),
            embedded=RoundTrip(up=self.embedded_down, down=self.embedded_down),
            sample_time=clock.central,
            embedded_period=clock.embedded,
        ).d_1

    def plan(self, clock: "Clock", *, duration: float, seed: int) -> Exchanges:
        """Draw every packet's way: what the controller knows when, and what the drives obey.

        Args:
            clock: The periods.
            duration: Of the run, s.
            seed: Of jitter and losses; a longer run begins like a shorter one.

        Raises:
            InputError: There are too many packets.
        """
        packets = duration / min(clock.central, clock.embedded or clock.central)
        if packets > MOST_PACKETS:
            raise InputError(
                f"The run would plan the ways of {packets:.3g} packets, of {MOST_PACKETS:.3g} at "
                f"most; simulate for at most {duration * MOST_PACKETS / packets:.0f} s."
            )
        up, down, drive, torque = (
            np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4)
        )
        tick = _multiples(clock.central, duration)
        looks = _multiples(clock.embedded, duration) if clock.embedded else None
        if looks is None:
            seen = self.central_up.sent(tick, up)
        else:
            arrival = self.central_up.arrivals(looks, up)
            seen = looks[np.maximum(self.central_up.held(arrival, tick), 0)]
        arrival = self.central_down.arrivals(tick, down)
        passed = np.sort(self.central_down.due(tick, arrival)) if looks is None else looks
        master = self.central_down.held(arrival, passed)
        late = self.embedded_down.arrivals(passed, drive)
        if looks is None:
            taken, number = self.embedded_down.takings(late)
        else:
            taken, number = looks, self.embedded_down.held(late, looks)
        command = np.where(number >= 0, master[number], -1)
        fresh = np.flatnonzero(np.diff(command, prepend=-1))
        known = None
        if self.embedded_up is not None:
            known = _torque(self.embedded_up, clock, duration, torque)
        return Exchanges(
            tick=tick,
            seen=np.maximum(seen, 0.0),
            taken=taken[fresh],
            command=command[fresh],
            torque=known,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """Periods of the physics and of both control loops; each a whole multiple of the one before.

    Attributes:
        physics: Step of the plant, s.
        embedded: Period at which measurements are sent and the drives look for commands, s;
            0 for at once, whatever the physics step.
        central: Period of the central controller, s.
        log: Period between logged instants, s; the central one if None.

    Raises:
        InputError: A period is not positive or not a whole multiple.
    """

    physics: float = 1e-3
    embedded: float = 0.0
    central: float = 1e-3
    log: float | None = None

    def __post_init__(self) -> None:
        for name in ("physics", "embedded", "central"):
            value = getattr(self, name)
            if not (math.isfinite(value) and (value > 0 or (name == "embedded" and value == 0))):
                raise InputError(f"the {name} period must be a time > 0 s, got {value}")
        central = self.steps_of("central", self.central)
        if self.embedded and central % self.steps_of("embedded", self.embedded):
            raise InputError(
                f"the central period of {in_ms(self.central)} must be a whole multiple of the "
                f"embedded period of {in_ms(self.embedded)}"
            )

    def steps_of(self, name: str, period: float) -> int:
        """Return how many physics steps a period has.

        Args:
            name: What to call it in the message.
            period: The period, s.

        Raises:
            InputError: It is not a whole number of at least one.
        """
        steps = round(period / self.physics)
        if steps < 1 or abs(period - steps * self.physics) > 1e-9 * period:
            raise InputError(
                f"the {name} period of {in_ms(period)} must be a whole multiple of the physics "
                f"step of {in_ms(self.physics)} (simulation.physics_step_ms)"
            )
        return steps


def _torque(link: Link, clock: Clock, duration: float, rng: np.random.Generator) -> Array:
    """Instants of the spring torques that the drives know.

    Torque that arrives at once and without end is held over a physics step: that of its middle is
    late by as much as the link in the mean.
    """
    if clock.embedded:
        looks = _multiples(clock.embedded, duration)
        known = looks[np.maximum(link.held(link.arrivals(looks, rng), looks), 0)]
    else:
        looks = _multiples(clock.physics, duration)
        known = np.minimum(link.sent(looks + 0.5 * clock.physics, rng), looks)
    return np.maximum(known, 0.0)


def _multiples(period: float, duration: float) -> Array:
    return period * np.arange(int(duration / period * (1.0 + 1e-12) + 1e-9) + 1)
