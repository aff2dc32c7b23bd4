"""Series elastic actuators with their embedded controller, and how transparent they are."""

from sealag.actuation._actuators import (
    Actuators,
    actuators,
    actuators_of,
    joint_values,
    motors_of,
)
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
    "actuators_of",
    "deviation_rms",
    "joint_values",
    "motors_of",
    "torque_transfer",
    "transparency",
]
