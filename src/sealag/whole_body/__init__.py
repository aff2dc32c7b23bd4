"""sealag.whole_body."""

from sealag.whole_body._protocol import Measurement, StoringController, TickController

__all__ = ["Measurement", "StoringController", "TickController"]
