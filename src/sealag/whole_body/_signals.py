"""Fed-back signals: the joint angles at which a law is evaluated, Eqs. (15)-(22)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from sealag.errors import InputError, UnknownNameError, either, word
from sealag.typing import Array, BoolArray
from sealag.whole_body._evaluation import LawEvaluation
from sealag.whole_body._signal_states import (
    MeasuredAngles,
    SignalState,
    StaticState,
    TankState,
)
from sealag.whole_body._tank import EnergyTank, TankFlow

_AS_STIFF_AS_SPRINGS = 1e-12
"""|det(I − K⁻¹ F_q)| below which a law counts as stiff as its springs, F_θ without bound. Ten times
larger refuses laws whose F_θ has three digits; ten times smaller keeps F_θ that is rounding."""


class Refusal(NamedTuple):
    """Why no passive bound covers a law.

    Attributes:
        instants: (N,) where it holds.
        reason: in words.
    """

    instants: BoolArray
    reason: str


class SeriesLimit(NamedTuple):
    """F_q ≼ (C_s + C_d)⁻¹: a spring in series with the stiffness that a delay leaves.

    Attributes:
        spring: (n,) compliance C_s of the springs, rad/Nm.
        delay: (n,) compliance C_d = d / D_θ of the delay, rad/Nm.
    """

    spring: Array
    delay: Array

    @property
    def stiffness(self) -> Array:
        """(C_s + C_d)⁻¹, (n,) Nm/rad."""
        return 1.0 / (self.spring + self.delay)


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal(ABC):
    """The joint angles at which a law evaluates x, J*, S and ḡ; a new signal is a subclass.

    Attributes:
        name: its word in project files and certificates.
        has_potential: whether its feedback is collocated with the motors.
        of_links: whether rates are those of the links instead of the motors'.
        rests_at_posture: whether the task error is 0 in the posture although springs carry gravity
            there, and the signal has no memory.
    """

    name: ClassVar[str]
    has_potential: ClassVar[bool] = True
    of_links: ClassVar[bool] = False
    rests_at_posture: ClassVar[bool] = False

    @staticmethod
    def names() -> tuple[str, ...]:
        """Return the signals' words in project files and certificates."""
        return tuple(kind.name for kind in _SIGNALS)

    @staticmethod
    def named(name: str) -> "Signal":
        """Return a signal with its default settings.

        Args:
            name: one of `names`.

        Raises:
            UnknownNameError: there is none of this name.
        """
        for kind in _SIGNALS:
            if kind.name == name:
                return kind()
        raise UnknownNameError(f"No signal is called {name!r}; there is {either(Signal.names())}.")

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return F_θ = −∂τ_osc/∂θ, (…, n, n) Nm/rad; F_q where the angles move with the motors.

        NaN where the signal does not exist. For link angles it is −∂τ_osc/∂q_j.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) spring stiffness, Nm/rad.
        """
        return F_q

    def limits(self, K: Array, delay: Array) -> tuple[SeriesLimit, ...]:
        """Return what F_q ≽ 0 must lie below for F_θ ≼ D_θ / d and a signal that exists.

        Args:
            K: (n,) spring stiffness, Nm/rad.
            delay: (n,) d / D_θ, rad/Nm.
        """
        return (SeriesLimit(np.zeros_like(K), delay),)

    def refusal(self, contraction: Array) -> Refusal | None:
        """Return why no passive bound covers the signal; None if one does.

        Args:
            contraction: (N,) contraction factors of q̄(θ).
        """
        return None

    @abstractmethod
    def start(self, law: LawEvaluation, *, delay_bound: float) -> SignalState:
        """Return the running signal.

        Args:
            law: evaluates the law at joint angles.
            delay_bound: d̄, the delay that a tank pays for, s.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorAngles(Signal):
    """x(θ): motor angles taken for joint angles. Collocated, −∂τ_osc/∂θ = F_q."""

    name: ClassVar[str] = "motor"

    def start(self, law: LawEvaluation, *, delay_bound: float) -> SignalState:
        return MeasuredAngles(law, links=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkAngles(Signal):
    """x(q_j): link angles. −∂τ_osc/∂q_j = F_q acts across the springs; no passive bound covers
    it."""

    name: ClassVar[str] = "joint"
    has_potential: ClassVar[bool] = False
    of_links: ClassVar[bool] = True

    def refusal(self, contraction: Array) -> Refusal:
        return Refusal(
            np.ones(len(contraction), dtype=bool),
            "link angles are fed back, which is not collocated with the motors: no passivity "
            "bound covers it; rely on the local margin",
        )

    def start(self, law: LawEvaluation, *, delay_bound: float) -> SignalState:
        return MeasuredAngles(law, links=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticJoint(Signal):
    """x(q̄(θ)) of Eqs. (15)-(17), q̄ the joint angles at which the springs carry the law.

    Attributes:
        iterations: Newton steps towards q̄(θ) a tick at most, from where q̄ follows the motors to
            first order; the first tick searches until it has settled. One leaves 2e-6 rad where
            all joints of ANYmal move by 2 rad/s; each more evaluates the law once more.
    """

    iterations: int = 1
    name: ClassVar[str] = "static_joint"
    rests_at_posture: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Require at least one iteration.

        Raises:
            InputError: there is none.
        """
        if self.iterations < 1:
            raise InputError(f"iterations is {self.iterations}; 1 is the fewest.")

    def motor_stiffness(self, F_q: Array, K: Array) -> Array:
        """Return F_q (I − K⁻¹ F_q)⁻¹, law and springs in series; NaN where that is singular.

        Args:
            F_q: (…, n, n) joint stiffness of the law, Nm/rad.
            K: (n,) spring stiffness, Nm/rad.
        """
        F_theta = np.full_like(F_q, np.nan)
        loop = np.swapaxes(np.eye(len(K)) - F_q / K[:, None], -1, -2)
        regular = np.abs(np.linalg.det(loop)) > _AS_STIFF_AS_SPRINGS
        F_theta[regular] = np.linalg.solve(loop[regular], np.swapaxes(F_q, -1, -2)[regular])
        return np.swapaxes(F_theta, -1, -2)

    def limits(self, K: Array, delay: Array) -> tuple[SeriesLimit, ...]:
        """Return (K⁻¹ + d D_θ⁻¹)⁻¹: F_θ = (F_q⁻¹ − K⁻¹)⁻¹ grows with F_q.

        Args:
            K: (n,) spring stiffness, Nm/rad.
            delay: (n,) d / D_θ, rad/Nm.
        """
        return (SeriesLimit(1.0 / K, delay),)

    def refusal(self, contraction: Array) -> Refusal | None:
        bad = ~(contraction < 1.0)
        if not bad.any():
            return None
        return Refusal(
            bad,
            f"q̄(θ) is no contraction at {bad.sum()} of {len(bad)} instants (factor up to "
            f"{contraction.max():.2f}): the task is stiffer than the springs",
        )

    def start(self, law: LawEvaluation, *, delay_bound: float) -> SignalState:
        return StaticState(law, self.iterations)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tank(Signal):
    """x̂ of Eqs. (18)-(22): x̂̇ = u + J* θ̇, with u paid for out of an energy tank.

    While u is 0, x̂ moves with the motors: −∂τ_osc/∂θ = F_q.

    Attributes:
        energy: at the start, J.
        rate: at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
        flow: what the tank pays for.
        iterations: Newton steps towards q̄(θ) a tick at most, as `StaticJoint` counts them.
    """

    energy: float = 1.0
    rate: float = 5.0
    flow: TankFlow = TankFlow.CORRECTED
    iterations: int = 1
    name: ClassVar[str] = "static_joint_tank"

    def __post_init__(self) -> None:
        """Check energy, rate and iterations.

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

    def limits(self, K: Array, delay: Array) -> tuple[SeriesLimit, ...]:
        """Return D_θ / d, and K below which q̄(θ) exists.

        Args:
            K: (n,) spring stiffness, Nm/rad.
            delay: (n,) d / D_θ, rad/Nm.
        """
        nothing = np.zeros_like(K)
        return SeriesLimit(nothing, delay), SeriesLimit(1.0 / K, nothing)

    def refusal(self, contraction: Array) -> Refusal | None:
        if self.flow is TankFlow.PUBLISHED:
            return Refusal(
                np.ones(len(contraction), dtype=bool),
                "the published flow of the energy tank does not pay for u's work on the spring "
                "potential; the corrected flow does",
            )
        return StaticJoint(iterations=self.iterations).refusal(contraction)

    def start(self, law: LawEvaluation, *, delay_bound: float) -> SignalState:
        tank = EnergyTank(
            rows=law.rows,
            energy=self.energy,
            rate=self.rate,
            delay_bound=delay_bound,
            flow=self.flow,
        )
        return TankState(law, tank, self.iterations)


_SIGNALS = (MotorAngles, LinkAngles, StaticJoint, Tank)


def static_contraction(F_q: Array, K: Array) -> Array:
    """Return ‖K^-½ F_q K^-½‖ (…): below 1 the iteration for q̄(θ) contracts (sufficient).

    Args:
        F_q: (…, n, n) joint stiffness of the law, gravity compensation included.
        K: (n,) spring stiffness.
    """
    root = np.sqrt(K)
    return np.linalg.norm(F_q / root[:, None] / root, ord=2, axis=(-2, -1))
