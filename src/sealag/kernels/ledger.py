"""Names of the plant's books: what each row of its works and stores is, without Numba."""

from typing import NamedTuple

from sealag.typing import Array

PORT, SHAFT, MOTOR_WORK, COMMAND, DAMPING, VISCOUS, COULOMB, SPRING_DAMPING, JOINT_DAMPING = range(
    9
)
JOINT_FLOWS = (
    "port",  # ∫ tau_sea q̇: springs to links
    "shaft",  # ∫ tau_sea θ̇: motors to springs
    "motor_work",  # ∫ tau_m θ̇
    "command",  # ∫ tau_osc θ̇
    "damping",  # ∫ D_theta θ̇²
    "viscous",
    "coulomb",
    "spring_damping",
    "joint_damping",  # of the bearings, on the links' side
)
HOLDING, SLIDING, TORSION, DISTURBANCE, IMPACT = range(5)
SCALAR_FLOWS = ("holding", "sliding", "torsion", "disturbance", "impact")
KINETIC_STORE, GRAVITY_STORE, SPRING_STORE, MOTOR_STORE = range(4)
STORES = ("kinetic", "gravity", "spring", "motor")


class Ledger(NamedTuple):
    """Cumulative works since the beginning of a run, and the stores now, J."""

    joint: Array  # (9, n) as in JOINT_FLOWS
    scalar: Array  # (5,) as in SCALAR_FLOWS; the first four are done on the robot, impact is lost
    stores: Array  # (4,) as in STORES
    moved: Array  # (1,) sum of the absolute changes of the stores
