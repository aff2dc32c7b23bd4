"""The law's matrices along a motion, block by block, so that a long one needs little memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sealag.design._local import Local, local_of
from sealag.robot import Motion
from sealag.store import blocks, release
from sealag.typing import Array
from sealag.whole_body import Rest, Spaces

if TYPE_CHECKING:
    from sealag.design._system import System


@dataclass(frozen=True, kw_only=True)
class Along:
    """A motion of a design.

    Attributes:
        system: the design.
        motion: its instants.
    """

    system: "System"
    motion: Motion

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

    def local(self, bounds: Array, rest: Rest | None = None) -> Local:
        """Decide stability and margin of the law that runs at every instant.

        Args:
            bounds: (N,) of the certified criterion, s; 0 where it decides nothing.
            rest: where the loop of the first instant rests, if that is known already.
        """
        return local_of(self, bounds, rest)
