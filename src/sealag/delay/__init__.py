"""Delays over time, the bounds that the criterion needs, and links that carry packets late."""

from sealag.delay._delays import UNSTATED_PERIOD, Delays, RoundTrip
from sealag.delay._link import Link, PacketOrder
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
    "UNSTATED_PERIOD",
    "Constant",
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
