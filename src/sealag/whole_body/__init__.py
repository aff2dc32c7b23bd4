"""The whole-body controller: tasks, contact-consistent matrices, and what it feeds back."""

from sealag.whole_body._controller import Controller
from sealag.whole_body._linearise import Linearisation, linearise
from sealag.whole_body._options import ControllerOptions, TaskError
from sealag.whole_body._protocol import (
    Measurement,
    StoringController,
    TankController,
    TickController,
)
from sealag.whole_body._stack import (
    RANK_TOLERANCE,
    WholeBodyStack,
    evaluate,
    passive_stiffness,
    relative_asymmetry,
)
from sealag.whole_body._static_joint import StaticJointState, static_joint_state
from sealag.whole_body._tank import TankFlow
from sealag.whole_body._tasks import (
    Feedback,
    GravityCompensation,
    Hierarchy,
    StiffnessForm,
    Task,
    TaskInertia,
    TaskKind,
    stiffness_matrix,
)

__all__ = [
    "RANK_TOLERANCE",
    "Controller",
    "ControllerOptions",
    "Feedback",
    "GravityCompensation",
    "Hierarchy",
    "Linearisation",
    "Measurement",
    "StaticJointState",
    "StiffnessForm",
    "StoringController",
    "TankController",
    "TankFlow",
    "Task",
    "TaskError",
    "TaskInertia",
    "TaskKind",
    "TickController",
    "WholeBodyStack",
    "evaluate",
    "linearise",
    "passive_stiffness",
    "relative_asymmetry",
    "static_joint_state",
    "stiffness_matrix",
]
