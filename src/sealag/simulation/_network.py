"""The network between robot and controllers, and how often each of them looks."""

import math
from dataclasses import dataclass
from typing import Any, Self

from sealag.delay import Constant, Delays, DelaySignal, Link, PacketOrder
from sealag.errors import InputError
from sealag.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A constant fraction of another delay signal.

    Attributes:
        signal: The whole delay.
        fraction: What part of it, >= 0.
    """

    signal: DelaySignal
    fraction: float

    @property
    def upper_bound(self) -> float:
        """Upper bound of the fraction, s."""
        return self.fraction * self.signal.upper_bound

    @property
    def mean(self) -> float:
        """Mean of the fraction, s."""
        return self.fraction * self.signal.mean

    def at(self, t: float | Array) -> Any:
        """Return the fraction of the delay at ``t`` (s)."""
        return self.fraction * self.signal.at(t)


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
    def from_delays(
        cls,
        delays: Delays,
        *,
        jitter: float = 0.0,
        loss: float = 0.0,
        max_burst: int = 10,
        order: PacketOrder = PacketOrder.FIFO,
    ) -> Self:
        """Share T_H between the central links and give half of T_L to the way down.

        The total is d_1 = T_H + T_L / 2 besides sampling, however T_H is shared.

        Args:
            delays: The round trips; ``up_share`` is the part of T_H on the way to the motors.
            jitter: Random delay of each central packet, uniform in [0, jitter], s.
            loss: Probability that a central packet is lost.
            max_burst: Largest number of central packets lost in a row.
            order: What central packets that overtake each other do.
        """

        def central(fraction: float) -> Link:
            return Link(
                delay=Share(signal=delays.central, fraction=fraction),
                jitter=jitter,
                loss=loss,
                max_burst=max_burst,
                order=order,
            )

        return cls(
            central_up=central(1.0 - delays.up_share),
            central_down=central(delays.up_share),
            embedded_down=Link(delay=Share(signal=delays.embedded, fraction=0.5)),
        )

    def delay_bound(self, clock: "Clock") -> float:
        """Return an upper bound of the total delay d_1 of the position feedback, s.

        Args:
            clock: How often packets are sent and looked for.
        """
        return (
            self.central_up.age_bound(clock.central)
            + self.central_down.age_bound(clock.central)
            + self.embedded_down.age_bound(clock.embedded)
            + clock.embedded
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """Periods of the physics and of both control loops; each a whole multiple of the one before.

    Attributes:
        physics: Step of the plant, s.
        embedded: Period at which the drives read the network, s; default the physics step.
        central: Period of the central controller and of the measurements, s.

    Raises:
        InputError: A period is not positive or not a whole multiple.
    """

    physics: float = 1e-3
    embedded: float = 0.0
    central: float = 1e-3

    def __post_init__(self) -> None:
        if self.embedded == 0.0:
            object.__setattr__(self, "embedded", self.physics)
        for name in ("physics", "embedded", "central"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"the {name} period must be a time > 0 s, got {value}")
        self.steps_of("embedded", self.embedded)
        self.steps_of("central", self.central)

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
                f"the {name} period {period} s must be a whole multiple of the physics step "
                f"{self.physics} s"
            )
        return steps
