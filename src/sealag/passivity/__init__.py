"""Passivity criteria: how much delay a design tolerates, and the proof of it."""

from sealag.passivity._bounds import (
    DelayBound,
    limiting_direction,
    max_delay,
    max_delay_from_stiffness,
)
from sealag.passivity._multitask import MultitaskBound, max_delay_multitask

__all__ = [
    "DelayBound",
    "MultitaskBound",
    "limiting_direction",
    "max_delay",
    "max_delay_from_stiffness",
    "max_delay_multitask",
]
