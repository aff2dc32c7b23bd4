"""The whole-body control law as one value: what is certified, frozen, simulated and run."""

from dataclasses import dataclass, field

from sealag.errors import InputError
from sealag.whole_body._signals import MotorAngles, Signal
from sealag.whole_body._task_law import TaskLaw
from sealag.whole_body._tasks import GravityCompensation


@dataclass(frozen=True, slots=True, kw_only=True)
class Law(TaskLaw):
    """τ_osc = Σ_k J*_{k|prec}ᵀ (S_k x̃_k + D_k x̃̇_k) + ḡ, Eqs. (10)-(17), at the fed-back signal.

    x̃̇ = ẋ_d − J* θ̇, or of q̇_j where link angles are fed back. D is 0 in the paper, whose damping is
    that of the drives.

    Attributes:
        tasks: the tasks; those of equal priority share a level, in the order given.
        signal: where x and all matrices are taken: `MotorAngles`, `LinkAngles`, `StaticJoint` or
            `Tank`.
        gravity: where gravity compensation ḡ takes its configuration from.
        stiffness_form: how the stiffness S follows from K_x and the task inertia.
        task_inertia: which task inertia that is.
        task_error: which error tasks below the first level feed back.
        velocity_feedforward: whether D_θ θ̇_d of a moving reference is added, so that the embedded
            damping acts on θ̇ − θ̇_d only.
        ordered: the tasks by priority.
    """

    signal: Signal = field(default_factory=MotorAngles)

    def __post_init__(self) -> None:
        """Sort the tasks.

        Raises:
            InputError: there is none, two have one name, a word is not one of its kind, or the
                signal is none.
        """
        TaskLaw.__post_init__(self)
        if not isinstance(self.signal, Signal):
            raise InputError(
                f"The law's signal is {self.signal!r}; MotorAngles(), LinkAngles(), StaticJoint() "
                "or Tank() is right."
            )

    @property
    def rests_at_posture(self) -> bool:
        """Whether the loop rests in the posture that it holds wherever contacts balance it: the
        springs carry at q̄(θ) = q what compensates gravity."""
        return self.signal.rests_at_posture and self.gravity is not GravityCompensation.NONE
