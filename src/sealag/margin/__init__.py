"""Delay margins of the frozen loop ẋ = A_0 x + A_1 x(t − d): exact for a constant delay, sufficient
for one that varies."""

from sealag.margin._jitter import jitter_margin
from sealag.margin._margin import DelayMargin, Interval, delay_margin
from sealag.margin._roots import rightmost_roots

__all__ = [
    "DelayMargin",
    "Interval",
    "delay_margin",
    "jitter_margin",
    "rightmost_roots",
]
