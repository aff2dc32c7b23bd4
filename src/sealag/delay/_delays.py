"""The delays of both loops, and the three delays of the paper's criterion."""

from dataclasses import dataclass, replace
from typing import Any, Self

from sealag.delay._link import Link, PacketOrder
from sealag.delay._signal import DelaySignal, Share
from sealag.errors import InputError
from sealag.typing import Array
from sealag.units import LONGEST_DELAY_S, check_delay_s, in_ms

UNSTATED_PERIOD = 1e-3
"""Period of a controller that runs where none is stated, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundTrip:
    """Both directions of one network connection.

    It is a delay signal itself: the sum of both ways, without jitter and losses.

    Attributes:
        up: from the robot to the controller.
        down: from the controller to the robot.
    """

    up: Link
    down: Link

    @classmethod
    def halved(
        cls,
        signal: DelaySignal,
        *,
        jitter: float = 0.0,
        loss: float = 0.0,
        max_burst: int = 10,
        order: PacketOrder = PacketOrder.FIFO,
    ) -> Self:
        """Give half of a round trip to each way; what happens to packets holds for each way.

        Args:
            signal: the whole round trip.
            jitter: random delay of each packet, uniform in [0, jitter], s.
            loss: probability that a packet is lost.
            max_burst: largest number of packets lost in a row.
            order: what packets that overtake each other do.
        """
        half = Share(signal=signal, fraction=0.5)
        link = Link(delay=half, jitter=jitter, loss=loss, max_burst=max_burst, order=order)
        return cls(up=link, down=link)

    @property
    def upper_bound(self) -> float:
        """Sum of both ways' largest delays, s."""
        return self.up.delay.upper_bound + self.down.delay.upper_bound

    @property
    def lower_bound(self) -> float:
        """Sum of both ways' smallest delays, s."""
        return self.up.delay.lower_bound + self.down.delay.lower_bound

    @property
    def steepest_fall(self) -> float:
        """Sum of both ways' steepest falls, s/s."""
        return self.up.delay.steepest_fall + self.down.delay.steepest_fall

    @property
    def mean(self) -> float:
        """Sum of both ways' mean delays, s."""
        return self.up.delay.mean + self.down.delay.mean

    def at(self, t: float | Array) -> Any:
        """Return the sum of both ways' delays.

        Args:
            t: s.
        """
        return self.up.delay.at(t) + self.down.delay.at(t)

    def scaled(self, factor: float) -> Self:
        """Return the same connection with delays and jitter times a factor.

        Args:
            factor: at least 0.

        Raises:
            InputError: the factor is negative or not finite.
        """
        return replace(self, up=_scaled(self.up, factor), down=_scaled(self.down, factor))


def _scaled(link: Link, factor: float) -> Link:
    return replace(
        link, delay=Share(signal=link.delay, fraction=factor), jitter=factor * link.jitter
    )


@dataclass(frozen=True, slots=True, kw_only=True, init=False)
class Delays:
    """The delays of both loops, and what the criterion needs of them.

    d_0 = d_1 = T_H + T_L/2 is the total delay of the position feedback: both ways of the central
    connection and the embedded one's way down. d_2 = (T_H + T_L)/2 is that of the feedforward
    path: both ways down. The central controller's zero-order hold adds its period to each; a
    declared embedded period adds the time that each receiver may wait until it looks. Jitter and
    bursts of losses count with their bounds, so that all three bound a time-varying delay.

    Attributes:
        central: T_H, connection of the central controller; a plain signal is a round trip whose
            ways are alike.
        embedded: T_L, connection of the motor drives.
        sample_time: T_s, period of the central controller, 0 for a continuous one, s.
        embedded_period: T_e, period at which packets are sent and looked for on the robot's side,
            0 for at once, s.
        delayed_torque_feedback: whether the embedded torque feedback waits for the way up of the
            embedded connection; the criterion assumes that it does not.

    Raises:
        InputError: a period cannot be one, packets without a period are lost, or all together is
            longer than LONGEST_DELAY_S.
    """

    central: RoundTrip
    embedded: RoundTrip
    sample_time: float
    embedded_period: float
    delayed_torque_feedback: bool

    def __init__(
        self,
        *,
        central: RoundTrip | DelaySignal,
        embedded: RoundTrip | DelaySignal,
        sample_time: float = 0.0,
        embedded_period: float = 0.0,
        delayed_torque_feedback: bool = False,
    ) -> None:
        check_delay_s(sample_time, "The sample time")
        check_delay_s(embedded_period, "The embedded period")
        for name, value in (
            ("central", _round_trip(central)),
            ("embedded", _round_trip(embedded)),
            ("sample_time", sample_time),
            ("embedded_period", embedded_period),
            ("delayed_torque_feedback", delayed_torque_feedback),
        ):
            object.__setattr__(self, name, value)
        if embedded_period > sample_time > 0.0:
            raise InputError(
                f"The embedded period {in_ms(embedded_period)} is longer than the central one, "
                f"{in_ms(sample_time)}."
            )
        if self.d_1 > LONGEST_DELAY_S:
            raise InputError(
                f"The delays add up to d_1 = {in_ms(self.d_1)}, longer than "
                f"{in_ms(LONGEST_DELAY_S)}; shorten delays, jitter, periods or bursts of lost "
                "packets (max_burst)."
            )

    @property
    def d_1(self) -> float:
        """Upper bound of the position feedback's total delay, s."""
        up = self.central.up.late_bound(self.embedded_period or self.sample_time)
        return up + self.embedded_period + self.d_2

    @property
    def d_2(self) -> float:
        """Upper bound of the feedforward path's delay, s."""
        down = self.central.down.late_bound(self.sample_time)
        drive = self.embedded.down.late_bound(self.embedded_period or self.sample_time)
        if self.embedded.down.overtaken and not self.embedded_period:
            drive += self.central.down.spread  # packets overtake that left together
        return down + drive + self.sample_time + 2.0 * self.embedded_period

    @property
    def torque_feedback_delay(self) -> float | None:
        """Upper bound e of how late the drives' torque feedback is, with the wait for the next
        exchange and the hold until the one after, s; None if it is immediate."""
        if not self.delayed_torque_feedback:
            return None
        period = self.embedded_period or self.sample_time
        return self.embedded.up.late_bound(period) + 2.0 * self.embedded_period

    def sampled(self) -> "Delays":
        """Return the delays of a controller that runs: with a period, whose hold counts.

        A continuous controller gets the embedded period, or UNSTATED_PERIOD.
        """
        return replace(
            self, sample_time=self.sample_time or self.embedded_period or UNSTATED_PERIOD
        )

    def scaled(self, factor: float) -> "Delays":
        """Return the same connections with all delays and jitters times a factor.

        Args:
            factor: at least 0; periods stay.

        Raises:
            InputError: the factor is negative or not finite.
        """
        return replace(
            self, central=self.central.scaled(factor), embedded=self.embedded.scaled(factor)
        )


def _round_trip(signal: RoundTrip | DelaySignal) -> RoundTrip:
    if not hasattr(signal, "upper_bound"):
        raise InputError(
            f"A connection's delay is {signal!r}; a signal such as Constant(0.008), in s, or a "
            "RoundTrip is right."
        )
    return signal if isinstance(signal, RoundTrip) else RoundTrip.halved(signal)
