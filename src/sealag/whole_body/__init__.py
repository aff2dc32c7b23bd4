"""The whole-body law: tasks, signals, the controller that runs it, and its frozen loop."""

from sealag.whole_body._controller import Controller
from sealag.whole_body._frozen import FrozenLoop, freeze, sea_loop
from sealag.whole_body._law import Law
from sealag.whole_body._links import FreeLinks, LinkPlant
from sealag.whole_body._protocol import (
    Measurement,
    StoringController,
    TankController,
    TickController,
)
from sealag.whole_body._rest import Rest, posture_of, rest_of
from sealag.whole_body._signal_states import LawDerivative, SignalState
from sealag.whole_body._signals import (
    SIGNAL_NAMES,
    LinkAngles,
    MotorAngles,
    Refusal,
    Signal,
    StaticJoint,
    Tank,
    signal_named,
)
from sealag.whole_body._spaces import Spaces, relative_asymmetry, spaces_along
from sealag.whole_body._static_joint import StaticJointState, static_joint_state
from sealag.whole_body._tank import TankFlow
from sealag.whole_body._tasks import (
    RANK_TOLERANCE,
    GravityCompensation,
    StiffnessForm,
    Task,
    TaskError,
    TaskInertia,
    TaskKind,
    stiffness_matrix,
)

__all__ = [
    "RANK_TOLERANCE",
    "SIGNAL_NAMES",
    "Controller",
    "FreeLinks",
    "FrozenLoop",
    "GravityCompensation",
    "Law",
    "LawDerivative",
    "LinkAngles",
    "LinkPlant",
    "Measurement",
    "MotorAngles",
    "Refusal",
    "Rest",
    "Signal",
    "SignalState",
    "Spaces",
    "StaticJoint",
    "StaticJointState",
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
    "posture_of",
    "relative_asymmetry",
    "rest_of",
    "sea_loop",
    "signal_named",
    "spaces_along",
    "static_joint_state",
    "stiffness_matrix",
]
