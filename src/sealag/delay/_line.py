"""Links that carry packets late, out of order or not at all, and the lines that simulate them."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sealag.delay._signal import DelaySignal
from sealag.errors import InputError
from sealag.typing import Array

_BLOCK = 1024
_LARGEST = 125_000_000  # numbers on their way


class PacketOrder(StrEnum):
    """What the receiver makes of packets that overtake each other."""

    FIFO = "fifo"
    """The network keeps the order: a packet waits for those sent before it."""
    NEWEST = "newest"
    """Packets overtake; the receiver discards those older than what it holds."""
    ARRIVAL = "arrival"
    """Packets overtake; the receiver takes each as it comes, even an old one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """One direction of one network connection; the receiver holds the last packet it took.

    Attributes:
        delay: Delay of a packet as a function of the instant at which it is sent, s.
        jitter: Width of the random delay added to every packet, uniform in [0, jitter], s.
        loss: Probability that a packet is lost, in [0, 1).
        max_burst: Largest number of packets lost in a row; the next one gets through.
        order: What happens when packets overtake each other.

    Raises:
        InputError: A value is negative, not finite, or the loss is not below 1.
    """

    delay: DelaySignal
    jitter: float = 0.0
    loss: float = 0.0
    max_burst: int = 10
    order: PacketOrder = PacketOrder.FIFO

    def __post_init__(self) -> None:
        if not (math.isfinite(self.jitter) and self.jitter >= 0):
            raise InputError(f"jitter must be a finite number >= 0 s, got {self.jitter}")
        if not 0 <= self.loss < 1:
            raise InputError(f"loss must be a probability in [0, 1), got {self.loss}")
        if self.max_burst < 1:
            raise InputError(f"max_burst must be at least 1 packet, got {self.max_burst}")
        object.__setattr__(self, "order", PacketOrder(self.order))

    def late_bound(self, period: float) -> float:
        """Return an upper bound (s) on how late the newest packet is, its successors' losses too.

        Delay, jitter and the longest burst of losses; under ARRIVAL an overtaken packet may be
        older by the jitter once more.

        Args:
            period: Time between two packets, s.

        Raises:
            InputError: Packets are lost but have no period.
        """
        lost = self.max_burst if self.loss > 0 else 0
        if lost and not period > 0.0:
            raise InputError("lost packets have a bound only if packets have a period (> 0 s)")
        late = self.jitter if self.order == PacketOrder.ARRIVAL else 0.0
        return self.delay.upper_bound + self.jitter + late + lost * period

    def age_bound(self, period: float) -> float:
        """Return an upper bound (s) on the age of what the receiver holds, always.

        `late_bound` and the hold until the next packet.

        Args:
            period: Time between two packets, s.
        """
        return self.late_bound(period) + period

    def arrivals(self, times: Array, rng: np.random.Generator, *, after: int = 0) -> Array:
        """Draw when packets sent at ``times`` (N,) arrive (N,), s; inf where lost.

        Args:
            times: Instants of sending, increasing, s.
            rng: Source of the jitter and the losses.
            after: Number of packets lost in a row just before the first of these.
        """
        late = np.asarray(self.delay.at(times), dtype=float) * np.ones(times.shape)
        if self.jitter > 0:
            late = late + self.jitter * rng.random(times.shape)
        arrival = times + late
        if self.loss > 0:
            lost = rng.random(times.shape) < self.loss
            run = after
            for i in np.flatnonzero(lost):
                run = run + 1 if (i == 0 or lost[i - 1]) else 1
                if run > self.max_burst:
                    lost[i], run = False, 0
            arrival[lost] = np.inf
        return arrival


class DelayLine:
    """A link at run time: a ring buffer of packets, allocated once.

    Args:
        link: What the connection does to packets.
        width: Number of values in a packet.
        period: Time between two packets, s.
        receive_period: Time between two looks of the receiver, s.
        rng: Source of the jitter and the losses; a seeded generator makes a run repeatable.

    Raises:
        InputError: A period is not positive, or the packets on their way do not fit into memory.
    """

    __slots__ = (
        "_arrival", "_block", "_by_arrival", "_count", "_held", "_key", "_last", "_link",
        "_lost", "_next", "_period", "_pull", "_push", "_rng", "_values",
    )  # fmt: skip

    def __init__(
        self,
        link: Link,
        *,
        width: int,
        period: float,
        receive_period: float,
        rng: np.random.Generator,
    ) -> None:
        from sealag.kernels.links import pull, push

        for name, value in (("period", period), ("receive_period", receive_period)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be a finite time > 0 s, got {value}")
        capacity = 4 + math.ceil((link.age_bound(period) + receive_period) / period)
        if capacity * width > _LARGEST:
            raise InputError(
                f"A link holds {capacity} packets on their way at one every {period:g} s, more "
                "than fit into 1 GB of memory; lengthen its period or shorten its delay."
            )
        self._link, self._period, self._rng = link, period, rng
        self._arrival = np.full(capacity, np.inf)
        self._values = np.zeros((capacity, width))
        self._count = np.zeros(1, np.int64)
        self._held = np.zeros(width)
        self._key = np.array([-1.0, -np.inf])
        self._block = np.zeros(_BLOCK)
        self._next, self._lost, self._last = _BLOCK, 0, -np.inf
        self._by_arrival = link.order == PacketOrder.ARRIVAL
        self._push, self._pull = push, pull

    def fill(self, row: Array) -> None:
        """Make the receiver hold ``row`` until the first packet arrives.

        Args:
            row: The values before the run (width,).
        """
        self._held[:] = row

    def send(self, t: float, row: Array) -> None:
        """Send a packet; calls must follow each other by one period.

        Args:
            t: Instant of sending, s.
            row: The packet's values (width,); copied.
        """
        if self._next == _BLOCK:
            self._draw(t)
        self._push(self._arrival, self._values, self._count, row, self._block[self._next])
        self._next += 1

    def receive(self, t: float, out: Array) -> None:
        """Write what the receiver holds at ``t`` into ``out``.

        Args:
            t: Instant of reading, s.
            out: Where the values (width,) go.
        """
        self._pull(
            self._arrival, self._values, self._count, self._held, self._key, t,
            self._by_arrival, out,
        )  # fmt: skip

    def _draw(self, t: float) -> None:
        times = t + self._period * np.arange(_BLOCK)
        block = self._link.arrivals(times, self._rng, after=self._lost)
        kept = np.flatnonzero(np.isfinite(block))
        self._lost = _BLOCK - 1 - int(kept[-1]) if kept.size else self._lost + _BLOCK
        if self._link.order == PacketOrder.FIFO and kept.size:
            ordered = np.maximum.accumulate(np.maximum(block[kept], self._last))
            block[kept] = ordered
            self._last = float(ordered[-1])
        self._block[:] = block
        self._next = 0
