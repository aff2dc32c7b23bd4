"""Exact local delay margin of the frozen loop ẋ = A_0 x + A_1 x(t − d)."""

from sealag.margin._crossings import Crossing
from sealag.margin._margin import DelayMargin, Interval, delay_margin, delay_margins
from sealag.margin._roots import rightmost_roots

__all__ = [
    "Crossing",
    "DelayMargin",
    "Interval",
    "delay_margin",
    "delay_margins",
    "rightmost_roots",
]
