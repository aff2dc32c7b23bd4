"""Running signals: the fed-back angles from tick to tick, and the law's derivative at rest."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from sealag.typing import Array
from sealag.whole_body._evaluation import LawEvaluation
from sealag.whole_body._protocol import Measurement
from sealag.whole_body._slopes import slopes_of, weights
from sealag.whole_body._tank import EnergyTank
from sealag.whole_body._tasks import GravityCompensation

STEP = 2e-5
"""rad, m: half the base of central differences of the command, extrapolated with those of half the
base. Near singular postures, where the law bends within 1e-3 rad, plain differences of 1e-5 rad
leave 1e-5 of the derivative; these leave 5e-9, of which half is rounding."""


class Present(NamedTuple):
    """What the law would command without delay.

    Attributes:
        energy: potential of the tasks and what a tank holds, J.
        joints: (n,) joint angles that gravity compensation is taken at, rad.
    """

    energy: float
    joints: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LawDerivative:
    """The law about a state at rest, with memory ξ.

        ξ̇ = A ξ + B_q δq + B_theta δθ + B_v δv + B_rate δθ̇
        δτ_osc = C ξ + C_q δq + C_theta δθ + C_v δv + C_rate δθ̇

    Attributes:
        A: (s, s) 1/s; s = 0 for a law without memory.
        B_q: (s, nv).
        B_theta: (s, n).
        B_v: (s, nv).
        B_rate: (s, n).
        C: (n, s).
        C_q: (n, nv) along tangent motions, Nm/rad.
        C_theta: (n, n), Nm/rad.
        C_v: (n, nv) of tangent velocities, Nms/rad.
        C_rate: (n, n) of motor velocities, Nms/rad.
        period: s, that the memory is the bilinear equivalent for; 0 if it is continuous.
        held: whether it moves at the controller's ticks, with its measurement held in between.
    """

    A: Array
    B_q: Array
    B_theta: Array
    B_v: Array
    B_rate: Array
    C: Array
    C_q: Array
    C_theta: Array
    C_v: Array
    C_rate: Array
    period: float = 0.0
    held: bool = False

    @classmethod
    def memoryless(cls, C_q: Array, C_theta: Array) -> "LawDerivative":
        """Return the derivative of a law without memory that feels no rates.

        Args:
            C_q: (n, nv).
            C_theta: (n, n).
        """
        n, nv = C_q.shape
        none = np.zeros((0, n))
        return cls(
            A=np.zeros((0, 0)), B_q=np.zeros((0, nv)), B_theta=none, B_v=np.zeros((0, nv)),
            B_rate=none, C=none.T,
            C_q=C_q, C_theta=C_theta, C_v=np.zeros((n, nv)), C_rate=np.zeros((n, n)),
        )  # fmt: skip

    def with_drag(self, slope: Array, *, of_links: bool) -> "LawDerivative":
        """Return the derivative of the law with damping that is computed from rates.

        Args:
            slope: (n, n) its command by joint rates, Nms/rad.
            of_links: whether the rates are those of the links.
        """
        if not of_links:
            return replace(self, C_rate=slope)
        C_v = np.zeros_like(self.C_v)
        C_v[:, C_v.shape[1] - len(slope) :] = slope
        return replace(self, C_v=C_v)

    def change(self, other: "LawDerivative") -> float:
        """Return how far another derivative of the same law lies from this one, as a share of it.

        Args:
            other: the other one.
        """
        mine = np.hstack([self.C_q, self.C_theta, self.C])
        theirs = np.hstack([other.C_q, other.C_theta, other.C])
        return float(np.linalg.norm(theirs - mine) / max(np.linalg.norm(mine), 1e-300))


class SignalState(Protocol):
    """A signal that runs: it moves the law from tick to tick."""

    def reset(self, t: float, measurement: Measurement) -> None:
        """Clear the memory.

        Args:
            t: first instant, s.
            measurement: the state then.
        """
        ...

    def command(self, t: float, measurement: Measurement, out: Array) -> None:
        """Write τ_osc of a measurement, and advance the memory.

        Args:
            t: the controller's clock, s.
            measurement: the newest measurement.
            out: (n,) command, Nm, written.
        """
        ...

    def present(self, measurement: Measurement, out: Array) -> Present:
        """Write the command of the true state; the memory stays as it is.

        Args:
            measurement: the true state.
            out: (n,) command, Nm, written.
        """
        ...

    def deflection(self, carried: Array) -> Array:
        """Return the spring deflection θ − q_j (n,) at which the task error is 0.

        Args:
            carried: (n,) torque that springs carry in the posture, Nm.
        """
        ...

    def settled(self, q: Array, theta: Array, out: Array, *, nearby: bool = False) -> None:
        """Write the command of a state that does not move, once it has settled.

        Args:
            q: (nq,) configuration.
            theta: (n,) motor angles, rad.
            out: (n,) command, Nm, written.
            nearby: start from the motions of the last state, which is near, not from those of q.
        """
        ...

    def derivative(
        self, q: Array, theta: Array, width: float = STEP, *, rough: bool = False
    ) -> LawDerivative:
        """Return the derivative of what runs, about a state that does not move.

        Args:
            q: (nq,) configuration.
            theta: (n,) motor angles, rad.
            width: half the base of the central differences, rad and m.
            rough: one-sided differences instead, as Newton's method needs: a fourth of the cost.
        """
        ...

    @property
    def tank_energy(self) -> float:
        """Energy in the tank, J; 0 without one."""
        ...


class MeasuredAngles:
    """Measured motor or link angles; no memory."""

    tank_energy = 0.0

    def __init__(self, law: LawEvaluation, *, links: bool) -> None:
        self._law, self._links = law, links
        self._at = np.zeros(law.robot.n)

    def _joints(self, q: Array, theta: Array) -> Array:
        return self._law.robot.joint_positions(q) if self._links else theta

    def reset(self, t: float, measurement: Measurement) -> None:
        """Take overline(UN_s) of the measurement."""
        self._law.follow(measurement.q)

    def command(self, t: float, measurement: Measurement, out: Array) -> None:
        """Write τ_osc."""
        q = measurement.q
        self._law.at(q, self._joints(q, measurement.theta), out)

    def present(self, measurement: Measurement, out: Array) -> Present:
        """Write the command of the true state."""
        self.command(0.0, measurement, out)
        return Present(self._law.task_energy(), self._joints(measurement.q, measurement.theta))

    def deflection(self, carried: Array) -> Array:
        """Return 0 for motor angles, K⁻¹ ḡ for link angles."""
        return carried / self._law.spring_stiffness if self._links else np.zeros_like(carried)

    def settled(self, q: Array, theta: Array, out: Array, *, nearby: bool = False) -> None:
        """Write the command of a state that does not move."""
        if not nearby:
            self._law.follow(q)
        law, joints = self._law, self._joints(q, theta)
        away = joints - law.robot.joint_positions(q)
        law.settled(lambda: law.at(q, joints, out), lambda: away)

    def derivative(
        self, q: Array, theta: Array, width: float = STEP, *, rough: bool = False
    ) -> LawDerivative:
        """Differentiate the settled command: s = θ, or q_j where the links are fed back."""
        self.settled(q, theta, np.zeros(self._law.robot.n))
        slopes = slopes_of(self._law, q, 0.0 if rough else width)
        if self._links:
            return LawDerivative.memoryless(
                slopes.torque, np.zeros_like(slopes.torque[:, self._law.robot.nv_base :])
            )
        return LawDerivative.memoryless(
            slopes.torque @ slopes.by_q, slopes.torque @ slopes.by_joints
        )


def _differences(
    law: LawEvaluation, function, q: Array, theta: Array, width: float, *, rows: int = 0
):
    """∂f/∂q (k, nv) and ∂f/∂θ (k, n) of function(q, θ, out), by differences."""
    robot = law.robot
    k, nv, eye = rows or robot.n, robot.nv, np.eye(robot.nv + robot.n)
    found, out, here = np.zeros((k, nv + robot.n)), np.zeros(k), np.zeros(k)
    function(q, theta, here)
    for i, direction in enumerate(eye):
        for h, weight in weights(width):
            out[:] = here
            if h:
                step = h * direction
                function(robot.integrate(q, step[:nv]) if i < nv else q, theta + step[nv:], out)
            found[:, i] += weight * out
    return found[:, :nv], found[:, nv:]


class StaticState:
    """q̄(θ) by Newton's method, warm-started from tick to tick."""

    tank_energy = 0.0

    def __init__(self, law: LawEvaluation, iterations: int, tank: EnergyTank | None = None) -> None:
        self._law, self.followed = law, law.followed(np.zeros(law.robot.n))
        self._running = law.running(static=self.followed, iterations=iterations, tank=tank)

    def reset(self, t: float, measurement: Measurement) -> None:
        """Start q̄(θ) at the measured joint angles."""
        self.followed.sag[:] = measurement.q_joint - measurement.theta
        self.followed.started[0] = 0
        self._law.follow(measurement.q)

    def command(self, t: float, measurement: Measurement, out: Array) -> None:
        """Write τ_osc, with few Newton steps from where q̄ follows the motors."""
        self.tick(0.0, measurement, out)

    def tick(self, period: float, measurement: Measurement, out: Array) -> None:
        """Write τ_osc a period (s) after the last one."""
        self._law.tick(self._running, period, measurement.q, measurement.theta, out)

    def present(self, measurement: Measurement, out: Array) -> Present:
        """Write the command at the settled q̄: V_3 at q̄ less ½ lᵀ K⁻¹ l."""
        sag = self.followed.sag.copy()
        self._law.static(measurement.q, measurement.theta, sag, out)
        energy = self._law.task_energy()
        energy -= 0.5 * float(out.dot(out / self._law.spring_stiffness))
        return Present(energy, measurement.theta + sag)

    def deflection(self, carried: Array) -> Array:
        """Return K⁻¹ ḡ of the compensation, at which q̄(θ) = q_j."""
        none = self._law.law.gravity is GravityCompensation.NONE
        return np.zeros_like(carried) if none else carried / self._law.spring_stiffness

    def settled(self, q: Array, theta: Array, out: Array, *, nearby: bool = False) -> None:
        """Write the command at q̄ of a state that does not move."""
        law, joints = self._law, self._law.robot.joint_positions(q)
        sag = joints - theta
        if not nearby:
            law.follow(q)
        law.settled(lambda: law.static(q, theta, sag, out), lambda: theta + sag - joints)

    def derivative(
        self, q: Array, theta: Array, width: float = STEP, *, rough: bool = False
    ) -> LawDerivative:
        """Differentiate the settled command K (θ − q̄): s = q̄, with K (θ − q̄) = l."""
        law, K = self._law, np.diag(self._law.spring_stiffness)
        self.settled(q, theta, np.zeros(law.robot.n))
        torque, by_q, by_joints = slopes_of(law, q, 0.0 if rough else width)
        answer = np.linalg.solve(K + torque @ by_joints, np.hstack([-torque @ by_q, K]))
        C = -K @ answer
        C[:, law.robot.nv :] += K
        return LawDerivative.memoryless(C[:, : law.robot.nv], C[:, law.robot.nv :])


class TankState:
    """x̂ of the energy tank; u pulls it to x(q̄(θ))."""

    def __init__(self, law: LawEvaluation, tank: EnergyTank, iterations: int) -> None:
        self._law, self._tank, self._static = law, tank, StaticState(law, iterations, tank)
        self._last, self._unused = 0.0, np.zeros(law.robot.n)

    @property
    def tank_energy(self) -> float:
        """Energy left, J, never below 0."""
        return self._tank.energy

    def reset(self, t: float, measurement: Measurement) -> None:
        """Fill the tank and forget x̂ and q̄."""
        self._tank.reset()
        self._last = t
        self._static.reset(t, measurement)

    def command(self, t: float, measurement: Measurement, out: Array) -> None:
        """Write τ_osc at x̂, which follows the motors and, while the tank pays, x(q̄(θ))."""
        self._static.tick(t - self._last, measurement, out)
        self._last = t

    def _matrices(self, q: Array, theta: Array) -> None:
        """Evaluate fed-back gravity compensation at θ, so that its gradient is that of F_q."""
        if self._law.gravity_is_fed_back:
            self._law.at(q, theta, self._unused)

    def present(self, measurement: Measurement, out: Array) -> Present:
        """Write the command with x̂ carried on by J* from the last measured θ to the true one."""
        law, tank, static = self._law, self._tank, self._static.followed
        self._static.present(measurement, out)
        self._matrices(measurement.q, measurement.theta)
        if static.started[0]:
            carried = law.space.J_star @ (measurement.theta - static.theta)
            law.error[:] = law.wanted - tank.position - carried
        law.torque(out)
        return Present(law.task_energy() + tank.energy, measurement.theta)

    def deflection(self, carried: Array) -> Array:
        """Return that of q̄(θ)."""
        return self._static.deflection(carried)

    def settled(self, q: Array, theta: Array, out: Array, *, nearby: bool = False) -> None:
        """Write the command once x̂ has come to x(q̄(θ)); `nearby` makes no difference."""
        target = np.zeros(self._law.rows)
        self._target(q, theta, target)
        self._at(q, theta, target, out)

    def _target(self, q: Array, theta: Array, out: Array) -> None:
        """x(q̄(θ)) (m,) of a state that does not move, relative to the posture's."""
        self._static.settled(q, theta, self._unused)
        out[:] = self._law.wanted - self._law.error

    def _at(self, q: Array, theta: Array, position: Array, out: Array) -> None:
        """The command (n,) of a state that does not move, with x̂ at a position (m,)."""
        law, joints = self._law, self._law.robot.joint_positions(q)
        self._static.settled(q, theta, out)
        if law.gravity_is_fed_back:
            law.follow(q)
            law.settled(lambda: law.at(q, theta, out), lambda: theta - joints)
        law.error[:] = law.wanted - position
        law.torque(out)

    def derivative(
        self, q: Array, theta: Array, width: float = STEP, *, rough: bool = False
    ) -> LawDerivative:
        """Return x̂̇ = J* θ̇ + rate (x(q̄) − x̂) while the tank can pay, and x̂ = J* θ while it cannot.

        What the tank holds changes with the square of the motion, so that near a rest it pays for
        all that u does as long as it holds anything.
        """
        law, m, width = self._law, self._law.rows, 0.0 if rough else width
        target, command = np.zeros(m), np.zeros(law.robot.n)
        self._target(q, theta, target)
        C_q, C_theta = _differences(
            law, lambda a, b, out: self._at(a, b, target, out), q, theta, width
        )
        self._at(q, theta, target, command)
        J, C = law.space.J_star.copy(), -law.space.J_star.T @ law.space.stiffness
        if not self._tank.can_pay:
            return LawDerivative.memoryless(C_q, C_theta + C @ J)
        T_q, T_theta = _differences(law, self._target, q, theta, width, rows=m)
        rate = self._tank.rate
        return LawDerivative(
            A=-rate * np.eye(m), B_q=rate * T_q, B_theta=rate * T_theta, B_v=np.zeros_like(T_q),
            B_rate=J, C=C, C_q=C_q, C_theta=C_theta, C_v=np.zeros_like(C_q),
            C_rate=np.zeros_like(C_theta),
        )  # fmt: skip
