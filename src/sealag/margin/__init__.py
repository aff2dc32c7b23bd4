"""Delay margins of the frozen loop ẋ = A_0 x + A_1 x(t − d): exact for a constant delay, sufficient
for one that varies."""

from sealag.margin._delayed import DelayedLoop
from sealag.margin._margin import DelayMargin

__all__ = [
    "DelayMargin",
    "DelayedLoop",
]
