"""Series elastic actuators with their embedded controller, and how transparent they are."""

from sealag.actuation._actuators import Actuators

__all__ = ["Actuators"]
