"""The whole-body law: tasks, signals, the controller that runs it, and its frozen loop."""

from sealag.whole_body._controller import Controller
from sealag.whole_body._freeze import freeze
from sealag.whole_body._frozen import FrozenLoop
from sealag.whole_body._law import Law
from sealag.whole_body._protocol import (
    Measurement,
    TickController,
)
from sealag.whole_body._rest import Rest
from sealag.whole_body._signals import (
    LinkAngles,
    MotorAngles,
    Signal,
    StaticJoint,
    Tank,
)
from sealag.whole_body._spaces import Spaces
from sealag.whole_body._tank import TankFlow
from sealag.whole_body._tasks import (
    GravityCompensation,
    StiffnessForm,
    Task,
    TaskError,
    TaskInertia,
    TaskKind,
)

__all__ = [
    "Controller",
    "FrozenLoop",
    "GravityCompensation",
    "Law",
    "LinkAngles",
    "Measurement",
    "MotorAngles",
    "Rest",
    "Signal",
    "Spaces",
    "StaticJoint",
    "StiffnessForm",
    "Tank",
    "TankFlow",
    "Task",
    "TaskError",
    "TaskInertia",
    "TaskKind",
    "TickController",
    "freeze",
]
