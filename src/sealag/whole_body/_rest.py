"""Where the loop rests: the equilibrium of links, springs, contacts and law."""

import math
from dataclasses import dataclass

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import ContractionError
from sealag.robot import Contact, Robot
from sealag.typing import Array
from sealag.whole_body._evaluation import LawEvaluation
from sealag.whole_body._law import Law
from sealag.whole_body._links import LinkPlant, null_space
from sealag.whole_body._signal_states import LawDerivative, SignalState

_BALANCED = 1e-10
"""Share of weight and torques that may be left over. Ten times smaller is rounding of the law; at
ten times larger the margin's last digits move."""

_ROUNDING = 1e-15
"""rad: rounding of an angle, times K a torque. It matters only for springs stiffer than 1e5 times
the weight; a hundred times larger would stop the search too early for ordinary springs."""

_AT_POSTURE = 1e-7
"""The same share, of gravity that contacts must balance in the posture. Project files round angles:
ten times smaller refuses postures given with seven digits; ten times larger accepts a push."""

_PLACED = 1e-12  # m, rad: how far a contact may be from where the posture has it
_ASTRAY = 1e3  # m, rad: a search for motor angles that steps so far has gone away
_ROUNDS = 60
_LONGEST_STEP = 0.2  # rad: a longer Newton step leaves the region where its direction is good
_HALVINGS = 12
_BISECTIONS = 30  # of the logarithm of a weight: to a part in 1e7
_QUICK = 0.1
"""Part of the residual that a step may leave for the law's derivative to serve once more: one costs
as much as several steps, so that it is taken anew only where it no longer leads on."""

_PATIENCE = 12
"""Rounds in which the least residual must halve. Those that lead to an equilibrium need up to nine;
without an end they cost a minute for a robot that buckles."""

_CUTOFF = 1e-10  # of the largest singular value: directions along which nothing acts (symmetries)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """Where the loop rests while it holds a posture.

    Attributes:
        q: (nq,) configuration; the posture itself if none was found.
        theta: (n,) motor angles, rad.
        tau_sea: (n,) spring torque there, Nm.
        found: whether all balances: links, springs, motors and contacts.
        moved: largest distance of a joint from the posture, rad or m.
        reason: why there is no equilibrium; empty if there is one.
    """

    q: Array
    theta: Array
    tau_sea: Array
    found: bool
    moved: float
    reason: str

    @classmethod
    def in_posture(
        cls,
        robot: Robot,
        law: Law,
        actuators: Actuators,
        posture: Array,
        *,
        contacts: tuple[Contact, ...],
    ) -> "Rest":
        """Return the loop's state in the posture: tasks without error, springs that carry gravity.

        It is where the loop rests if its references are corrected for the sag of a law that feeds
        back motor angles, or if an operator has brought it there.

        Args:
            robot: the robot.
            law: the law.
            actuators: its springs.
            posture: (nq,) configuration.
            contacts: which frames are held.

        Raises:
            RobotError: the mass matrix is not positive definite.
        """
        return _Search(robot, law, actuators, posture, contacts).posture()

    @classmethod
    def of(
        cls,
        robot: Robot,
        law: Law,
        actuators: Actuators,
        posture: Array,
        *,
        contacts: tuple[Contact, ...],
    ) -> "Rest":
        """Find the equilibrium near a posture that the law holds.

        Uᵀ τ = g − J_sᵀ λ, τ = K (θ − q_j) = τ_osc(q, θ) with contacts where the posture has them,
        by Newton's method with the derivative of the law that runs. A law that compensates gravity
        at the static joint state rests at the posture; one that feeds back motor angles sags.

        Args:
            robot: the robot.
            law: the law.
            actuators: its springs.
            posture: (nq,) configuration that the law holds.
            contacts: which frames are held.

        Raises:
            RobotError: the mass matrix is not positive definite.
        """
        return _Search(robot, law, actuators, posture, contacts).run()


class _Search:
    """Newton's method on q and θ."""

    def __init__(
        self,
        robot: Robot,
        law: Law,
        actuators: Actuators,
        posture: Array,
        contacts: tuple[Contact, ...],
    ) -> None:
        K = actuators.spring_stiffness
        self._robot, self._K, self._posture = robot, K, np.asarray(posture, dtype=float)
        evaluation = LawEvaluation(robot, law, K, contacts=contacts, posture=posture)
        self._evaluation = evaluation
        self._signal: SignalState = law.signal.start(evaluation, delay_bound=0.0)
        self._plant = LinkPlant(robot, contacts)
        self._places = self._plant.places(self._posture)
        self._scale = max(robot.weight, float(np.abs(robot.gravity(posture)).max()), 1e-3)

    def run(self) -> Rest:
        """Return the equilibrium; without one the posture, with the reason."""
        if self._robot.floating_base and not self._places:  # nothing holds the robot: it falls
            return self._answer(self._posture, self._held(), self._why())
        posture = self.posture()
        if posture.found and self._evaluation.law.rests_at_posture:
            return posture
        try:
            # Where contacts do not balance the posture, its margin is 0 wherever the loop rests.
            for falling in (True, False) if posture.found else (True,):
                found = self._follow(falling=falling)
                if found is not None:
                    return self._answer(*found, "")
        except ContractionError as error:
            return self._answer(self._posture, self._first(self._posture), str(error))
        return self._answer(self._posture, self._held(), self._why())

    def _follow(self, *, falling: bool) -> tuple[Array, Array] | None:
        """Newton's method from the posture: with steps in a region of trust that let the residual
        fall, or with whole directions and residuals that may rise in between, as where a soft law
        sags past a posture that it cannot hold."""
        q, theta = self._posture, self._first(self._posture)
        residual = self._residual(q, theta)
        mark, since, slope = self._size(residual), 0, None  # slope: of the law and of the links
        for _ in range(_ROUNDS):
            if self._small(residual):
                if slope is not None:  # digits that a last Newton step would have brought
                    step = self._newton(q, residual, slope, trusted=True)
                    q, theta, _, _ = self._search(q, theta, step, residual, falling=True)
                return q, theta
            kept, before = slope is not None, self._size(residual)
            slope = slope or self._slope(q, theta)
            step = self._newton(q, residual, slope, trusted=falling)
            q, theta, residual, moved = self._search(q, theta, step, residual, falling=falling)
            size = self._size(residual)
            if size > _QUICK * before:
                slope = None
                if kept and not moved:
                    continue
            mark, since = (size, 0) if size < mark / 2.0 else (mark, since + 1)
            if not moved or since > _PATIENCE:
                return None
        return None

    def posture(self) -> Rest:
        """Return the state in the posture."""
        q, base = self._posture, self._robot.nv_base
        joints = self._robot.joint_positions(q)
        evaluation = self._evaluation
        evaluation.follow(q)
        carried = evaluation.space.gravity.copy()
        left = self._robot.gravity(q)
        left[base:] -= carried
        Z = null_space(self._plant.jacobian(q), self._robot.nv)
        balanced = np.abs(Z.T @ left).max(initial=0.0) < _AT_POSTURE * self._scale
        reason = "" if balanced else self._why()
        return Rest(
            q=q,
            theta=joints + self._signal.deflection(carried),
            tau_sea=carried,
            found=not reason,
            moved=0.0,
            reason=reason,
        )

    def _first(self, q: Array) -> Array:
        """Motor angles whose springs carry gravity as far as contacts do not."""
        torque = self._robot.gravity(q) - self._plant.support(q)
        return self._robot.joint_positions(q) + torque[self._robot.nv_base :] / self._K

    def _held(self) -> Array:
        """Motor angles that rest under the law while the links are held in the posture."""
        joints, theta = self._robot.joint_positions(self._posture), self._first(self._posture)
        out, least, since = np.zeros(self._robot.n), np.inf, 0
        try:
            for _ in range(_ROUNDS):
                self._signal.settled(self._posture, theta, out, nearby=True)
                theta, last = joints + out / self._K, theta
                step = np.abs(theta - last).max(initial=0.0)
                if step < _PLACED:
                    return theta
                least, since = (step, 0) if step < least / 2.0 else (least, since + 1)
                # A task that is stiffer than the springs drives it away.
                if since > _PATIENCE or not step < _ASTRAY:
                    break
        except ContractionError:
            pass
        return self._first(self._posture)

    def _residual(self, q: Array, theta: Array) -> tuple[Array, Array, Array]:
        """Contact displacement (c,), forces along free motions (k,), torque left at motors (n,)."""
        joints = self._robot.joint_positions(q)
        springs, command = self._K * (theta - joints), np.zeros(self._robot.n)
        self._signal.settled(q, theta, command, nearby=True)
        force = self._robot.gravity(q)
        force[self._robot.nv_base :] -= springs
        Z = null_space(self._plant.jacobian(q), self._robot.nv)
        return self._plant.displacement(q, self._places), Z.T @ force, springs - command

    def _small(self, residual: tuple[Array, Array, Array]) -> bool:
        away, force, torque = (float(np.abs(part).max(initial=0.0)) for part in residual)
        room = _BALANCED * self._scale + _ROUNDING * float(self._K.max())
        return away < _PLACED and max(force, torque) < room

    def _size(self, residual: tuple[Array, Array, Array]) -> float:
        away, force, torque = (float(np.linalg.norm(part)) for part in residual)
        return away + (force + torque) / self._scale

    def _slope(self, q: Array, theta: Array) -> tuple[LawDerivative, Array]:
        """Derivative of the law, and ∂(g − J_sᵀ λ − Uᵀ τ)/∂q (nv, nv)."""
        robot = self._robot
        springs = self._K * (theta - robot.joint_positions(q))
        H = self._plant.stiffness(q, springs, np.eye(robot.nv))
        H[robot.nv_base :, robot.nv_base :] += np.diag(self._K)
        return self._signal.derivative(q, theta, rough=True), H

    def _newton(
        self,
        q: Array,
        residual: tuple[Array, Array, Array],
        slopes: tuple[LawDerivative, Array],
        *,
        trusted: bool,
    ) -> Array:
        """Step (nv + n,) of least norm; the best one of the longest length if it is to be trusted
        and longer: near a load at which the loop buckles, a full step is of any length."""
        robot, n, K = self._robot, self._robot.n, np.diag(self._K)
        base, (slope, H) = robot.nv_base, slopes
        J_s = self._plant.jacobian(q)
        Z = null_space(J_s, robot.nv)
        coupling = np.vstack([np.zeros((base, n)), -K])
        C_q, C_theta = slope.C_q, slope.C_theta
        if len(slope.A):  # at rest the memory has settled: A ξ + B δ = 0
            follow = slope.C @ np.linalg.inv(-slope.A)
            C_q, C_theta = C_q + follow @ slope.B_q, C_theta + follow @ slope.B_theta
        motors = np.hstack([-np.hstack([np.zeros((n, base)), K]) - C_q, K - C_theta])
        rows = [
            np.hstack([J_s, np.zeros((len(J_s), n))]),
            np.hstack([Z.T @ H, Z.T @ coupling]) / self._scale,
            motors / self._scale,
        ]
        away, force, torque = residual
        right = np.concatenate([away, force / self._scale, torque / self._scale])
        U, values, V = np.linalg.svd(np.vstack(rows), full_matrices=False)
        acts = values > _CUTOFF * values[0]
        values, seen, V = values[acts], U[:, acts].T @ right, V[acts]

        def step(weight: float) -> Array:
            return -(values / (values**2 + weight) * seen) @ V

        found = step(0.0)
        if not trusted or np.abs(found).max() <= _LONGEST_STEP:
            return found
        low, high = math.log(_CUTOFF**2), math.log(1e4) + 2.0 * math.log(values[0])
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            long = np.abs(step(math.exp(middle))).max() > _LONGEST_STEP
            low, high = (middle, high) if long else (low, middle)
        return step(math.exp(high))

    def _search(
        self,
        q: Array,
        theta: Array,
        step: Array,
        residual: tuple[Array, Array, Array],
        *,
        falling: bool,
    ) -> tuple[Array, Array, tuple[Array, Array, Array], bool]:
        """Follow the step as far as the residual falls, or as far as the law exists."""
        nv, before = self._robot.nv, self._size(residual)
        share = min(1.0, _LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
        for _ in range(_HALVINGS):
            new_q = self._robot.integrate(q, share * step[:nv])
            new_theta = theta + share * step[nv:]
            try:
                new = self._residual(new_q, new_theta)
            except ContractionError:
                new = None
            if new is not None and (not falling or self._size(new) < before or self._small(new)):
                return new_q, new_theta, new, True
            share /= 2.0
        return q, theta, residual, False

    def _why(self) -> str:
        left = self._robot.gravity(self._posture) - self._plant.support(self._posture)
        base = float(np.abs(left[: self._robot.nv_base]).max(initial=0.0))
        if base > 1e-6 * self._scale and not len(self._places):
            return (
                "the base floats and nothing holds it: give contacts, or fix the base "
                '(robot.base = "fixed")'
            )
        if base > 1e-6 * self._scale:
            return (
                f"no contact force balances {base:.3g} (N, Nm) of gravity at the base, and no "
                "posture nearby is balanced"
            )
        return "no balance of springs, gravity and law was found near the posture"

    def _answer(self, q: Array, theta: Array, reason: str) -> Rest:
        joints = self._robot.joint_positions(q)
        moved = np.abs(joints - self._robot.joint_positions(self._posture))
        return Rest(
            q=q,
            theta=theta,
            tau_sea=self._K * (theta - joints),
            found=not reason,
            moved=float(moved.max(initial=0.0)),
            reason=reason,
        )
