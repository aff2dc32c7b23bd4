"""Exact local delay margin of a frozen closed loop: crossings, modes and stability intervals."""

from sealag.margin._margin import Crossing, DelayMargin, delay_margin
from sealag.margin._roots import rightmost_roots

__all__ = ["Crossing", "DelayMargin", "delay_margin", "rightmost_roots"]
