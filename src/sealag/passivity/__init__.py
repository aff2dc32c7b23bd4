"""Passivity criteria: how much delay a design tolerates, and the proof of it."""

from sealag.passivity._bounds import (
    DelayBound,
    limiting_direction,
    max_delay,
    max_delay_from_stiffness,
)

__all__ = ["DelayBound", "limiting_direction", "max_delay", "max_delay_from_stiffness"]
