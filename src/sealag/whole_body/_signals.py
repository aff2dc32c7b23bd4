"""What the law is taken at: signals with their stiffness, refusal, potential and memory."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol

import numpy as np

from sealag.errors import InputError, UnknownNameError, either, word
from sealag.typing import Array, BoolArray
from sealag.whole_body._signal_states import (
    MeasuredAngles,
    SignalState,
    StaticState,
    TankState,
)
from sealag.whole_body._tank import EnergyTank, TankFlow

if TYPE_CHECKING:
    from sealag.whole_body._evaluation import LawEvaluation

_ENDLESS = 1e-12
"""Determinant of I − K⁻¹ F_q from which a law is exactly as stiff as its springs."""


class Refusal(NamedTuple):
    """Why no passive bound covers a law.

    Attributes:
        instants: (N,) where it holds.
        reason: in words.
    """

    instants: BoolArray
    reason: str


class Signal(Protocol):
    """The signal that a law is taken at."""

    name: ClassVar[str]
    """Its word in project files and certificates."""
    has_potential: ClassVar[bool]
    """Whether the feedback of it is collocated with the motors."""
    rests_at_posture: ClassVar[bool]
    """Whether its error is 0 in the posture although springs carry gravity there, and nothing is
    remembered."""

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return −∂τ_osc/∂θ (…, n, n) of a law with joint stiffness F_q (…, n, n), springs K (n,);
        NaN where the signal does not exist. For link angles it acts on them.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) springs, Nm/rad.
        """
        ...

    def refusal(self, contraction: Array) -> Refusal | None:
        """Return why no passive bound covers it, given the contraction factors (N,).

        Args:
            contraction: (N,) contraction factors of q̄(θ).
        """
        ...

    def start(self, law: "LawEvaluation", *, delay_bound: float) -> SignalState:
        """Return the running signal.

        Args:
            law: what evaluates the law.
            delay_bound: bound d̄ of the delay that a tank pays for, s.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorAngles:
    """x(θ): motor angles taken for joint angles. Collocated, −∂τ_osc/∂θ = F_q."""

    name: ClassVar[str] = "motor"
    has_potential: ClassVar[bool] = True
    rests_at_posture: ClassVar[bool] = False

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return F_q.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) springs, Nm/rad.
        """
        return F_q

    def refusal(self, contraction: Array) -> None:
        """Return None.

        Args:
            contraction: (N,) contraction factors of q̄(θ).
        """

    def start(self, law: "LawEvaluation", *, delay_bound: float) -> SignalState:
        """Return the running signal.

        Args:
            law: what evaluates the law.
            delay_bound: bound d̄ of the delay that a tank pays for, s.
        """
        return MeasuredAngles(law, links=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkAngles:
    """x(q_j): link angles. −∂τ_osc/∂q_j = F_q acts across the springs, which no passive bound
    covers."""

    name: ClassVar[str] = "joint"
    has_potential: ClassVar[bool] = False
    rests_at_posture: ClassVar[bool] = False

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return F_q, which acts on link angles.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) springs, Nm/rad.
        """
        return F_q

    def refusal(self, contraction: Array) -> Refusal:
        """Return that it is not collocated.

        Args:
            contraction: (N,) contraction factors of q̄(θ).
        """
        return Refusal(
            np.ones(len(contraction), dtype=bool),
            "link angles are fed back, which is not collocated with the motors: no passivity "
            "bound covers it; rely on the local margin",
        )

    def start(self, law: "LawEvaluation", *, delay_bound: float) -> SignalState:
        """Return the running signal.

        Args:
            law: what evaluates the law.
            delay_bound: bound d̄ of the delay that a tank pays for, s.
        """
        return MeasuredAngles(law, links=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticJoint:
    """x(q̄(θ)) of Eqs. (15)-(17), q̄ the joint angles at which the springs carry the law.

    Attributes:
        iterations: Newton iterations a tick at most, warm-started.
    """

    iterations: int = 2
    name: ClassVar[str] = "static_joint"
    has_potential: ClassVar[bool] = True
    rests_at_posture: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Refuse to iterate never.

        Raises:
            InputError: there is no iteration.
        """
        if self.iterations < 1:
            raise InputError(f"iterations is {self.iterations}; 1 is the fewest.")

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return F_q (I − K⁻¹ F_q)⁻¹, the series of law and springs; NaN where it has no end.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) springs, Nm/rad.
        """
        F_theta = np.full_like(F_q, np.nan)
        loop = np.swapaxes(np.eye(len(K)) - F_q / K[:, None], -1, -2)
        ends = np.abs(np.linalg.det(loop)) > _ENDLESS
        F_theta[ends] = np.linalg.solve(loop[ends], np.swapaxes(F_q, -1, -2)[ends])
        return np.swapaxes(F_theta, -1, -2)

    def refusal(self, contraction: Array) -> Refusal | None:
        """Return where q̄(θ) is no contraction.

        Args:
            contraction: (N,) contraction factors of q̄(θ).
        """
        bad = ~(contraction < 1.0)
        if not bad.any():
            return None
        return Refusal(
            bad,
            f"q̄(θ) is no contraction at {bad.sum()} of {len(bad)} instants (factor up to "
            f"{contraction.max():.2f}): the task is stiffer than the springs",
        )

    def start(self, law: "LawEvaluation", *, delay_bound: float) -> SignalState:
        """Return the running signal.

        Args:
            law: what evaluates the law.
            delay_bound: bound d̄ of the delay that a tank pays for, s.
        """
        return StaticState(law, self.iterations)


def static_contraction(F_q: Array, K: Array) -> Array:
    """Return ‖K^-½ F_q K^-½‖ (…): below 1 the iteration for q̄(θ) contracts (sufficient).

    Args:
        F_q: (…, n, n) joint stiffness of the law, gravity compensation included.
        K: (n,) spring stiffness.
    """
    root = np.sqrt(K)
    return np.linalg.norm(F_q / root[:, None] / root, ord=2, axis=(-2, -1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tank:
    """x̂ of Eqs. (18)-(22): x̂̇ = u + J* θ̇, with u paid for out of an energy tank.

    While u is 0, x̂ moves with the motors: −∂τ_osc/∂θ = F_q.

    Attributes:
        energy: at the start, J.
        rate: at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
        flow: what the tank pays for.
        iterations: Newton iterations a tick at most for q̄(θ).
    """

    energy: float = 1.0
    rate: float = 5.0
    flow: TankFlow = TankFlow.CORRECTED
    iterations: int = 2
    name: ClassVar[str] = "static_joint_tank"
    has_potential: ClassVar[bool] = True
    rests_at_posture: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            InputError: energy or rate is negative or not finite, or there is no iteration.
        """
        object.__setattr__(self, "flow", word(TankFlow, self.flow, what="The tank's flow"))
        for name in ("energy", "rate"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"The tank's {name} is {value}; 0 or a positive number is right.")
        if self.iterations < 1:
            raise InputError(f"iterations is {self.iterations}; 1 is the fewest.")

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return F_q: what u does besides is paid for.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) springs, Nm/rad.
        """
        return F_q

    def refusal(self, contraction: Array) -> Refusal | None:
        """Return that the published flow does not pay for all, or that q̄ does not exist.

        Args:
            contraction: (N,) contraction factors of q̄(θ).
        """
        if self.flow is TankFlow.PUBLISHED:
            return Refusal(
                np.ones(len(contraction), dtype=bool),
                "the published flow of the energy tank does not pay for u's work on the spring "
                "potential; the corrected flow does",
            )
        return StaticJoint(iterations=self.iterations).refusal(contraction)

    def start(self, law: "LawEvaluation", *, delay_bound: float) -> SignalState:
        """Return the running signal.

        Args:
            law: what evaluates the law.
            delay_bound: bound d̄ of the delay that a tank pays for, s.
        """
        tank = EnergyTank(
            size=law.rows,
            energy=self.energy,
            rate=self.rate,
            delay_bound=delay_bound,
            flow=self.flow,
        )
        return TankState(law, tank, self.iterations)


_SIGNALS = (MotorAngles, LinkAngles, StaticJoint, Tank)
SIGNAL_NAMES: tuple[str, ...] = tuple(kind.name for kind in _SIGNALS)
"""The signals' words in project files and certificates."""


def signal_named(name: str) -> Signal:
    """Return a signal with its default settings.

    Args:
        name: one of SIGNAL_NAMES.

    Raises:
        UnknownNameError: there is none of this name.
    """
    for kind in _SIGNALS:
        if kind.name == name:
            return kind()
    raise UnknownNameError(f"No signal is called {name!r}; there is {either(SIGNAL_NAMES)}.")
