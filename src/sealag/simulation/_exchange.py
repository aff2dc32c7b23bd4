"""Who hears of what, and when: known before a run, since no packet's way depends on its content."""

from dataclasses import dataclass

import numpy as np

from sealag.typing import Array, IntArray


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
