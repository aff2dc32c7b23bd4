"""Passivity criteria: how much delay a design tolerates, and the proof of it."""

from sealag.passivity._bounds import (
    DelayBound,
    limiting_direction,
    max_delay,
    max_delay_from_stiffness,
)
from sealag.passivity._certificate import (
    Certificate,
    Criterion,
    Proof,
    Status,
    Worst,
    read_certificate,
    write_certificate,
)
from sealag.passivity._multipliers import joint_multiplier
from sealag.passivity._multitask import MultitaskBound, max_delay_multitask
from sealag.passivity._verify import Check, Verification, verify

__all__ = [
    "Certificate",
    "Check",
    "Criterion",
    "DelayBound",
    "MultitaskBound",
    "Proof",
    "Status",
    "Verification",
    "Worst",
    "joint_multiplier",
    "limiting_direction",
    "max_delay",
    "max_delay_from_stiffness",
    "max_delay_multitask",
    "read_certificate",
    "verify",
    "write_certificate",
]
