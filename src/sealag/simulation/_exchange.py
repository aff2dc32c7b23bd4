"""Who hears of what, and when: known before a run, since no packet's way depends on its content."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from sealag.errors import InputError
from sealag.simulation._network import Clock, Network
from sealag.typing import Array, IntArray

MOST_PACKETS = 2e7  # each takes about 130 bytes while their ways are planned


@dataclass(frozen=True, slots=True, kw_only=True)
class Ages:
    """How old the signals of a run became at most, just before something newer took their place.

    Attributes:
        measurement: Of a measurement when the controller used it, s.
        command: Of a command since it was sent, s.
        total: Of the measurement behind a command at work, s; what d_1 bounds.
    """

    measurement: float
    command: float
    total: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchanges:
    """What the controller knows at each of its K ticks, and which tick's command the drives obey.

    Without an embedded period the state is sent such that it arrives just at a tick, the master
    passes on what it holds as soon as a command is due, and drives obey from the instant of
    arrival; with one, all of the robot's side happens at its multiples.

    Attributes:
        tick: Instants of the ticks (K,), s.
        seen: Instants of the states that they know (K,), s; 0 is the start.
        taken: Instants at which the drives begin to obey a command (S,), s, increasing.
        command: Number of its tick (S,).
        torque: Instant of the spring torque that the drives' torque feedback knows during each
            embedded period, or each physics step (L,), s; None if it is not delayed.
    """

    tick: Array
    seen: Array
    taken: Array
    command: IntArray
    torque: Array | None

    @classmethod
    def plan(cls, network: Network, clock: Clock, *, duration: float, seed: int) -> Self:
        """Draw every packet's way.

        Args:
            network: The links.
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
            seen = network.central_up.sent(tick, up)
        else:
            arrival = network.central_up.arrivals(looks, up)
            seen = looks[np.maximum(network.central_up.held(arrival, tick), 0)]
        arrival = network.central_down.arrivals(tick, down)
        passed = np.sort(network.central_down.due(tick, arrival)) if looks is None else looks
        master = network.central_down.held(arrival, passed)
        late = network.embedded_down.arrivals(passed, drive)
        if looks is None:
            taken, number = network.embedded_down.takings(late)
        else:
            taken, number = looks, network.embedded_down.held(late, looks)
        command = np.where(number >= 0, master[number], -1)
        fresh = np.flatnonzero(np.diff(command, prepend=-1))
        known = None
        if network.embedded_up is not None:
            known = _torque(network, clock, duration, torque)
        return cls(
            tick=tick,
            seen=np.maximum(seen, 0.0),
            taken=taken[fresh],
            command=command[fresh],
            torque=known,
        )

    def ages(self, end: float) -> Ages:
        """Return the largest ages of a run.

        Args:
            end: When it ended, s.
        """
        stop = np.append(self.taken, np.inf).clip(max=end)
        ran = np.append(True, self.taken <= end)
        sent = np.append(0.0, self.tick[self.command])
        known = np.append(0.0, self.seen[self.command])
        ticked = self.tick <= end
        return Ages(
            measurement=float((self.tick - self.seen)[ticked].max()),
            command=float((stop - sent)[ran].max()),
            total=float((stop - known)[ran].max()),
        )


def _torque(network: Network, clock: Clock, duration: float, rng: np.random.Generator) -> Array:
    """Instants of the spring torques that the drives know.

    Torque that arrives at once and without end is held over a physics step: that of its middle is
    late by as much as the link in the mean.
    """
    link = network.embedded_up
    assert link is not None
    if clock.embedded:
        looks = _multiples(clock.embedded, duration)
        known = looks[np.maximum(link.held(link.arrivals(looks, rng), looks), 0)]
    else:
        looks = _multiples(clock.physics, duration)
        known = np.minimum(link.sent(looks + 0.5 * clock.physics, rng), looks)
    return np.maximum(known, 0.0)


def _multiples(period: float, duration: float) -> Array:
    return period * np.arange(int(duration / period * (1.0 + 1e-12) + 1e-9) + 1)
