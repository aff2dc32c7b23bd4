"""Delay margins of the frozen loop ẋ = A_0 x + A_1 x(t − d): exact for a constant delay, sufficient
for one that varies."""

from sealag.margin._margin import DelayMargin, delay_margin
from sealag.margin._roots import rightmost_roots
from sealag.margin._sampled import SampledMargin, sampled_margin, sampled_radius

__all__ = [
    "DelayMargin",
    "delay_margin",
    "jitter_margin",
    "rightmost_roots",
    "sampled_margin",
    "sampled_radius",
]
