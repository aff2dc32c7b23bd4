"""Microseconds a call, as every benchmark of a tick takes them: the median of blocks."""

import statistics
import time
from collections.abc import Callable

BLOCKS, TICKS = 7, 300


def median_us(call: Callable[[], object]) -> float:
    """Return the time of one call, µs.

    Args:
        call: what is timed.
    """
    call()
    times = []
    for _ in range(BLOCKS):
        start = time.perf_counter()
        for _ in range(TICKS):
            call()
        times.append((time.perf_counter() - start) / TICKS)
    return statistics.median(times) * 1e6
