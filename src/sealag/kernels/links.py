"""Link kernels: packets in a ring buffer, each with its arrival time; the receiver holds the last.

``arrival`` (capacity,) and ``values`` (capacity, width) are the ring, ``count`` (1,) the number of
packets sent; ``held`` (width,) is what the receiver has, ``key`` (2,) the held packet's number and
arrival time.
"""

import numpy as np
from numba import njit

_SAME = 1e-9  # s; an arrival this close after the receiver's tick is at the tick


@njit(cache=True)
def push(arrival, values, count, row, when):
    """Send one packet that arrives at ``when`` (inf: lost)."""
    slot = count[0] % arrival.size
    arrival[slot] = when
    values[slot] = row
    count[0] += 1


@njit(cache=True)
def pull(arrival, values, count, held, key, now, by_arrival, out):
    """Take the newest packet that has arrived by ``now`` into ``held`` and copy it to ``out``.

    ``by_arrival``: the last to arrive wins, even if it was overtaken; else the last sent wins.
    """
    best = -1
    first = max(0, count[0] - arrival.size)
    for number in range(count[0] - 1, first - 1, -1):
        if not by_arrival and number <= key[0]:
            break
        when = arrival[number % arrival.size]
        if when > now + _SAME:
            continue
        if not by_arrival:
            best = number
            break
        if when > key[1] or (when == key[1] and number > key[0]):
            key[0], key[1] = number, when
            held[:] = values[number % arrival.size]
    if best >= 0:
        key[0], key[1] = best, arrival[best % arrival.size]
        held[:] = values[best % arrival.size]
    out[:] = held


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    arrival, values, count = np.zeros(2), np.zeros((2, 1)), np.zeros(1, np.int64)
    row, key = np.zeros(1), np.array([-1.0, -np.inf])
    push(arrival, values, count, row, 0.0)
    pull(arrival, values, count, row.copy(), key, 0.0, False, row)
