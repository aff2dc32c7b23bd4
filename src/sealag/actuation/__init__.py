"""Series elastic actuators with their embedded controller, and how transparent they are."""

from sealag.actuation._actuators import Actuators, actuators, actuators_of, motor_parameters
from sealag.actuation._transparency import transparency

__all__ = [
    "Actuators",
    "actuators",
    "actuators_of",
    "motor_parameters",
    "transparency",
]
