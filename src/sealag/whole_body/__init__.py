"""The whole-body law: tasks, signals, the controller that runs it, and its frozen loop."""

from sealag.whole_body._controller import Controller
from sealag.whole_body._freeze import freeze
from sealag.whole_body._frozen import FrozenLoop, sea_loop
from sealag.whole_body._law import Law
from sealag.whole_body._links import FreeLinks, LinkPlant
from sealag.whole_body._protocol import (
    Measurement,
    StoringController,
    TankController,
    TickController,
)
from sealag.whole_body._rest import Rest
from sealag.whole_body._signals import (
    SIGNAL_NAMES,
    LinkAngles,
    MotorAngles,
    Signal,
    StaticJoint,
    Tank,
    signal_named,
)
from sealag.whole_body._spaces import Spaces, relative_asymmetry
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
    "SIGNAL_NAMES",
    "Controller",
    "FreeLinks",
    "FrozenLoop",
    "GravityCompensation",
    "Law",
    "LinkAngles",
    "LinkPlant",
    "Measurement",
    "MotorAngles",
    "Rest",
    "Signal",
    "Spaces",
    "StaticJoint",
    "StiffnessForm",
    "StoringController",
    "Tank",
    "TankController",
    "TankFlow",
    "Task",
    "TaskError",
    "TaskInertia",
    "TaskKind",
    "TickController",
    "freeze",
    "relative_asymmetry",
    "sea_loop",
    "signal_named",
]
