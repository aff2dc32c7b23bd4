"""Passivity criteria: how much delay a design tolerates, and the proof of it."""

from sealag.passivity._bounds import (
    DelayBound,
    limiting_direction,
    max_delay,
    max_delay_from_stiffness,
)
from sealag.passivity._certificate import (
    Assumption,
    Basis,
    Certificate,
    Criterion,
    Critical,
    LocalLoop,
    Place,
    Proof,
    Rest,
    Status,
    Window,
    Worst,
    content_digest,
    write_certificate,
)
from sealag.passivity._checks import Check, Verification
from sealag.passivity._common import (
    CommonBound,
    max_delay_common,
    max_delay_common_from_stiffness,
)
from sealag.passivity._multipliers import TaskMultiplier, joint_multiplier, task_multiplier
from sealag.passivity._multitask import MultitaskBound, max_delay_multitask
from sealag.passivity._polytope import (
    PolytopeBound,
    max_delay_polytope,
    max_delay_polytope_from_stiffness,
)
from sealag.passivity._problem import (
    Factor,
    MultiplierProblem,
    Solution,
    factorise,
    proven_delays,
    refuted_delay,
)
from sealag.passivity._reading import read_certificate
from sealag.passivity._solvers import ClarabelCvxpy, ClarabelDirect, ClosedForm, Solver
from sealag.passivity._storage import (
    DelayStorage,
    delay_storage,
    link_storage,
    motor_storage,
    task_storage,
)
from sealag.passivity._task_multipliers import task_multipliers
from sealag.passivity._verify import verify

__all__ = [
    "Assumption",
    "Basis",
    "Certificate",
    "Check",
    "ClarabelCvxpy",
    "ClarabelDirect",
    "ClosedForm",
    "CommonBound",
    "Criterion",
    "Critical",
    "DelayBound",
    "DelayStorage",
    "Factor",
    "LocalLoop",
    "MultiplierProblem",
    "MultitaskBound",
    "Place",
    "PolytopeBound",
    "Proof",
    "Rest",
    "Solution",
    "Solver",
    "Status",
    "TaskMultiplier",
    "Verification",
    "Window",
    "Worst",
    "content_digest",
    "delay_storage",
    "factorise",
    "joint_multiplier",
    "limiting_direction",
    "link_storage",
    "max_delay",
    "max_delay_common",
    "max_delay_common_from_stiffness",
    "max_delay_from_stiffness",
    "max_delay_multitask",
    "max_delay_polytope",
    "max_delay_polytope_from_stiffness",
    "motor_storage",
    "proven_delays",
    "read_certificate",
    "refuted_delay",
    "task_multiplier",
    "task_multipliers",
    "task_storage",
    "verify",
    "write_certificate",
]
