"""What the whole-body controller does besides its stiffness."""

import math
from dataclasses import dataclass
from enum import StrEnum

from sealag.errors import InputError
from sealag.whole_body._tank import TankFlow
from sealag.whole_body._tasks import Feedback, GravityCompensation


class TaskError(StrEnum):
    """Which error a task below the first level feeds back.

    consistent: x̃_{k|prec} = x̃_k − J_k Σ_{i<k} P_i J_iᵀ Λ_i x̃_{i|prec}, what is left of x̃_k once
    the tasks above have removed theirs. Its rate is −J*_{k|prec} θ̇, as Corollary 1 takes it, so
    that −∂τ_osc/∂θ = Σ J*ᵀ S J* is symmetric with S.

    plain: x̃_k = x_d,k − x_k as printed. Its rate is −J_k overline(UN_s) θ̇: the stiffness
    Σ J*_{k|prec}ᵀ S_k J_k overline(UN_s) is not symmetric, has no potential, and is not the one
    that `evaluate` certifies. With one level the two are the same.
    """

    CONSISTENT = "consistent"
    PLAIN = "plain"


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerOptions:
    """What the law does besides its stiffness.

    Attributes:
        feedback: the signal that is fed back.
        gravity: where gravity compensation takes its configuration from.
        task_error: what tasks below the first level feed back.
        velocity_feedforward: whether D_θ θ̇_d of the reference motion is added, so that the
            embedded damping acts on θ̇ − θ̇_d only.
        static_iterations: Newton iterations a tick for q̄(θ) at most, warm-started.
        tank_flow: what the tank pays for; for feedback through the tank.
        tank_energy: energy in the tank at the start, J.
        tank_rate: rate at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
        delay_bound: d̄ that the tank's flow pays for, s.
    """

    feedback: Feedback = Feedback.MOTOR
    gravity: GravityCompensation = GravityCompensation.PLANNED
    task_error: TaskError = TaskError.CONSISTENT
    velocity_feedforward: bool = True
    static_iterations: int = 2
    tank_flow: TankFlow = TankFlow.CORRECTED
    tank_energy: float = 1.0
    tank_rate: float = 5.0
    delay_bound: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            InputError: an energy, rate or delay is negative or not finite, or there is no
                iteration.
        """
        for name in ("tank_energy", "tank_rate", "delay_bound"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"{name} is {value}; it must be 0 or a positive number.")
        if self.static_iterations < 1:
            raise InputError(f"static_iterations is {self.static_iterations}; 1 is the fewest.")
