"""Delays over time, the bounds that the criterion needs, and links that carry packets late."""

from sealag.delay._delays import Delays, RoundTrip
from sealag.delay._link import Link, PacketOrder
from sealag.delay._signal import Constant, Sinusoid, Table

__all__ = [
    "Constant",
    "Delays",
    "Link",
    "PacketOrder",
    "RoundTrip",
    "Sinusoid",
    "Table",
]
