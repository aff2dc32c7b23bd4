"""Series elastic actuators with their embedded controller, and how transparent they are."""

from sealag.actuation._actuators import Actuators, actuators, joint_values, motor_parameters
from sealag.actuation._transparency import (
    Transparency,
    deviation_rms,
    torque_transfer,
    transparency,
)

__all__ = [
    "Actuators",
    "Transparency",
    "actuators",
    "deviation_rms",
    "joint_values",
    "motor_parameters",
    "torque_transfer",
    "transparency",
]
