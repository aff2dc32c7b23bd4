"""The network between robot and controllers, and how often each of them looks."""

import math
from dataclasses import dataclass
from typing import Self

from sealag.delay import Constant, Delays, Link, RoundTrip
from sealag.errors import InputError
from sealag.units import in_ms


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
