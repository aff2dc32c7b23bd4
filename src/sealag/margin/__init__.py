"""Exact local delay margin of the frozen loop ẋ = A_0 x + A_1 x(t − d)."""

from sealag.margin._margin import DelayMargin, delay_margin
from sealag.margin._roots import rightmost_roots

__all__ = [
    "DelayMargin",
    "delay_margin",
    "rightmost_roots",
]
