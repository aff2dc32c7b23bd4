"""Delays over time, the bounds that the criterion needs, and links that carry packets late."""

from sealag.delay._delays import Delays, RoundTrip
from sealag.delay._line import DelayLine, Link, PacketOrder
from sealag.delay._signal import (
    Constant,
    DelaySignal,
    Share,
    Sinusoid,
    Table,
    measured,
    share_left_out,
)

__all__ = [
    "Constant",
    "DelayLine",
    "DelaySignal",
    "Delays",
    "Link",
    "PacketOrder",
    "RoundTrip",
    "Share",
    "Sinusoid",
    "Table",
    "measured",
    "share_left_out",
]
