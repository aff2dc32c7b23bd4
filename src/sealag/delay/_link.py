"""Links that carry packets late, out of order or not at all."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sealag.delay._signal import DelaySignal
from sealag.errors import InputError
from sealag.typing import Array, IntArray

_SAME = 1e-9  # s; an arrival this close after the receiver's look is at the look
_HALVINGS = 60
_BLOCK = 1024
_LONGEST_BURST = 1e9


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
        if not 1 <= self.max_burst <= _LONGEST_BURST:
            raise InputError(f"max_burst must be 1 … {_LONGEST_BURST:g} packets")
        object.__setattr__(self, "order", PacketOrder(self.order))

    @property
    def constant(self) -> bool:
        """Whether every packet is equally late and none is lost."""
        return self.loss == 0.0 and self.spread == 0.0

    def late_bound(self, period: float) -> float:
        """Return an upper bound (s) on how late the newest packet is, its successors' losses too.

        Delay, jitter and the longest burst of losses; under ARRIVAL a packet that was overtaken may
        be older by what jitter and a falling delay let it arrive later.

        Args:
            period: Time between two packets, s.

        Raises:
            InputError: Packets are lost but have no period.
        """
        lost = self.max_burst if self.loss > 0 else 0
        if lost and not period > 0.0:
            raise InputError("lost packets have a bound only if packets have a period (> 0 s)")
        return self.delay.upper_bound + self.jitter + self.overtaken + lost * period

    @property
    def spread(self) -> float:
        """By how much the ways of two packets may differ, s."""
        return self.jitter + self.delay.upper_bound - self.delay.lower_bound

    @property
    def overtaken(self) -> float:
        """How much older than the newest packet one that is taken after it may be, s."""
        if self.order != PacketOrder.ARRIVAL:
            return 0.0
        closing = 1.0 - self.delay.steepest_fall  # arrivals of packets sent a second apart, s
        return min(self.spread, self.jitter / closing) if closing > 0.0 else self.spread

    def arrivals(self, times: Array, rng: np.random.Generator) -> Array:
        """Draw when packets sent at ``times`` (N,) arrive (N,), s; inf where lost.

        Args:
            times: Instants of sending, increasing, s.
            rng: Source of the jitter and the losses; more packets leave those before as they are.
        """
        jitter, lost = self._drawn(len(times), rng)
        arrival = times + self.delay.at(times) + jitter
        arrival[lost] = -np.inf
        if self.order == PacketOrder.FIFO:
            arrival = np.maximum.accumulate(arrival)
        arrival[lost] = np.inf
        return arrival

    def due(self, times: Array, arrival: Array) -> Array:
        """Return when packets have arrived or are known to be lost (N,), s.

        Args:
            times: Instants of sending (N,), s.
            arrival: When each arrives (N,), s; inf where lost.
        """
        return np.minimum(arrival, times + self.delay.upper_bound + self.jitter)

    def takings(self, arrival: Array) -> tuple[Array, IntArray]:
        """Return when the receiver takes which packet, in the order of taking.

        Args:
            arrival: When each packet arrives (N,), s; inf where lost.

        Returns:
            Instants (S,), s, and the packets' numbers (S,).
        """
        number = np.argsort(arrival, kind="stable")[: int(np.isfinite(arrival).sum())]
        if self.order != PacketOrder.ARRIVAL:
            number = number[number >= np.maximum.accumulate(number)]
        return arrival[number], number

    def held(self, arrival: Array, looks: Array) -> IntArray:
        """Return the number of the packet that the receiver holds at each look (L,).

        -1 before the first has arrived.

        Args:
            arrival: When each packet arrives (N,), s; inf where lost.
            looks: Instants (L,), s.
        """
        instant, number = self.takings(arrival)
        return np.concatenate([[-1], number])[np.searchsorted(instant, looks + _SAME, "right")]

    def sent(self, looks: Array, rng: np.random.Generator) -> Array:
        """Return when what the receiver holds at each look was sent (L,), s.

        Packets leave at every instant, so that one arrives just at the look; jitter and losses are
        those of the looks.

        Args:
            looks: Instants (L,), increasing, s.
            rng: Source of the jitter and the losses.
        """
        jitter, lost = self._drawn(len(looks), rng)
        latest = looks - jitter
        earliest = latest - self.delay.upper_bound
        steady = self.delay.lower_bound == self.delay.upper_bound
        for _ in range(0 if steady else _HALVINGS):
            middle = 0.5 * (earliest + latest)
            early = middle + self.delay.at(middle) + jitter <= looks
            earliest, latest = np.where(early, middle, earliest), np.where(early, latest, middle)
        last = np.maximum.accumulate(np.where(lost, 0, np.arange(len(looks))))
        sent = np.where(lost & (last == 0), 0.0, earliest[last])
        return sent if self.order == PacketOrder.ARRIVAL else np.maximum.accumulate(sent)

    def _drawn(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Jitter (N,), s, and whether each packet is lost (N,)."""
        jitter, lost, run = np.zeros(count), np.zeros(count, bool), 0
        for first in range(0, count, _BLOCK):  # so that a longer run begins like a shorter one
            rest = slice(first, first + _BLOCK)
            size = len(jitter[rest])
            if self.jitter > 0:
                jitter[rest] = self.jitter * rng.random(_BLOCK)[:size]
            if self.loss > 0:
                lost[rest] = rng.random(_BLOCK)[:size] < self.loss
        for i in np.flatnonzero(lost):
            run = run + 1 if i and lost[i - 1] else 1
            if run > self.max_burst:
                lost[i] = False
        return jitter, lost
