"""The law's matrices along a motion, block by block, so that a long one needs little memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from sealag.design._design import Design
from sealag.robot import Motion
from sealag.store import blocks, release
from sealag.whole_body import Rest, Spaces


@dataclass(frozen=True, kw_only=True)
class Along:
    """A motion of a design.

    Attributes:
        system: the design.
        motion: its instants.
    """

    system: Design
    motion: Motion

    @classmethod
    def of(cls, system: Design, motion: Motion | None = None) -> Self:
        """Take a design along a motion.

        Args:
            system: the design.
            motion: its instants; the posture if None.
        """
        return cls(system=system, motion=system.still() if motion is None else motion)

    @cached_property
    def rest(self) -> Rest | None:
        """Where the loop of a single instant rests; None for a motion."""
        return self.system.rest(self.motion) if len(self.motion) == 1 else None

    @cached_property
    def _first(self) -> Spaces:
        """Those of the first block: all of a motion that is not long."""
        return self.system.spaces(self.motion.at(next(blocks(len(self.motion)))))

    def parts(self) -> Iterator[tuple[slice, Spaces]]:
        """Go through the motion.

        Yields:
            The instants of a block, and the law's matrices there.
        """
        for rows in blocks(len(self.motion)):
            if rows.start == 0:
                yield rows, self._first
            else:
                yield rows, self.system.spaces(self.motion.at(rows))
            release(self.motion.q, self.motion.v)

    def at(self, instants: Sequence[int]) -> Spaces:
        """Return the law's matrices at some instants, in the order that is asked for.

        Args:
            instants: which.
        """
        chosen, order = np.unique(np.asarray(instants, dtype=np.int64), return_inverse=True)
        if not len(chosen) or chosen[-1] < len(self._first):
            return self._first.at(instants)
        return self.system.spaces(self.motion.at(chosen.tolist())).at(order.tolist())
