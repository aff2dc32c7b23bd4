"""The centralised whole-body operational-space controller, Eqs. (10)-(17), one tick at a time."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import ContractionError, InputError, RobotError
from sealag.robot import Contact, Robot, Workspace
from sealag.typing import Array, ArrayLike
from sealag.whole_body._protocol import Measurement
from sealag.whole_body._stack import FORM_CODE, RANK_TOLERANCE
from sealag.whole_body._tasks import (
    Feedback,
    GravityCompensation,
    Hierarchy,
    Task,
    TaskInertia,
    TaskKind,
)

_SETTLE = 5  # iterations for q̄(θ) of the true state, where only the storage is wanted


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerOptions:
    """What the law does besides its stiffness.

    Attributes:
        feedback: the signal that is fed back.
        gravity: where gravity compensation takes its configuration from.
        velocity_feedforward: whether D_θ θ̇_d of the reference motion is added, so that the
            embedded damping acts on θ̇ − θ̇_d only.
        static_iterations: fixed-point iterations a tick for q̄(θ), warm-started.
        tank_energy: energy in the tank at the start, J; for feedback through the tank.
        tank_rate: rate at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
        delay_bound: d̄ that the tank's flow pays for, s.
    """

    feedback: Feedback = Feedback.MOTOR
    gravity: GravityCompensation = GravityCompensation.PLANNED
    velocity_feedforward: bool = True
    static_iterations: int = 2
    tank_energy: float = 1.0
    tank_rate: float = 5.0
    delay_bound: float = 0.0


class Controller:
    """τ_osc = Σ J*ᵀ S (x_d − x) + ḡ + D_θ θ̇_d at the fed-back configuration.

    The configuration that x and all matrices are taken at is moved from the measured one along
    the contact-consistent motions by the difference between the fed-back joint angles and the
    measured ones. A robot's driver calls it exactly as the simulator does; after the first tick no
    memory is allocated that outlives a tick.
    """

    def __init__(
        self,
        robot: Robot,
        hierarchy: Hierarchy,
        actuators: Actuators,
        *,
        contacts: tuple[Contact, ...],
        posture: ArrayLike,
        options: ControllerOptions | None = None,
        reference: Callable[[float], tuple[Array, Array]] | None = None,
    ) -> None:
        """Prepare a controller that holds a posture, or follows a reference about it.

        Args:
            robot: the robot.
            hierarchy: its tasks.
            actuators: its springs and damping.
            contacts: which frames are held.
            posture: (nq,) configuration whose task positions are the references, and where
                planned gravity compensation is evaluated.
            options: the signal fed back, gravity, feedforward; defaults if None.
            reference: returns offset (m,) of the references and its rate (m,) at a time, for all
                rows by priority; None holds still.

        Raises:
            UnknownNameError: a frame or joint does not exist.
            RobotError: the mass matrix at the posture is not positive definite.
        """
        from sealag.kernels.operational_space import allocate

        self.options = options or ControllerOptions()
        self._robot, self._actuators, self._reference = robot, actuators, reference
        self._hierarchy, self._contacts = hierarchy, tuple(contacts)
        self._K_x = hierarchy.gain(robot)
        self._levels = np.array(hierarchy.levels(robot))
        self._rows = hierarchy.rows(robot)
        m, c = self._K_x.shape[0], sum(contact.kind.rows for contact in contacts)
        self._J_t, self._J_s = np.zeros((m, robot.nv)), np.zeros((c, robot.nv))
        self._error, self._target = np.zeros(m), np.zeros(m)
        self._space = allocate(robot.nv, robot.n, c, m=m)
        self._at = robot.workspace()
        self._rest = np.zeros(robot.nv)
        self._wanted = _targets(robot, hierarchy, np.asarray(posture, dtype=float))
        self._solve(np.asarray(posture, dtype=float))
        self._planned_gravity = self._space.gravity.copy()
        self._sag = np.zeros(robot.n)
        self._x_hat: Array | None = None
        self._energy, self._last = self.options.tank_energy, 0.0
        self.contraction = 0.0

    @property
    def tank_energy(self) -> float:
        """Energy left in the tank, J."""
        return self._energy

    def reset(self, t: float, measurement: Measurement) -> None:
        """Forget the past: fill the tank, start q̄(θ) and x̂ anew.

        Args:
            t: first instant, s.
            measurement: the state then.
        """
        self._sag[:] = measurement.q_joint - measurement.theta
        self._x_hat, self._last = None, t
        self._energy = self.options.tank_energy
        self._solve(measurement.q)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Compute the command of Eqs. (11), (17).

        Args:
            t: the controller's clock, s.
            measurement: the newest measurement.
            out: (n,) command, Nm.

        Raises:
            RobotError: the mass matrix is not positive definite.
            ContractionError: q̄(θ) is fed back and its iteration diverges.
        """
        offset, rate = self._reference(t) if self._reference else (None, None)
        match self.options.feedback:
            case Feedback.JOINT:
                self._law(measurement, measurement.q_joint, offset, out)
            case Feedback.MOTOR:
                self._law(measurement, measurement.theta, offset, out)
            case Feedback.STATIC_JOINT:
                self._static_law(measurement, offset, out)
            case Feedback.STATIC_JOINT_TANK:
                self._static_law(measurement, offset, out)
                self._tank_law(t, measurement, out)
        if rate is not None and self.options.velocity_feedforward:
            wanted = np.linalg.lstsq(self._space.J_star, rate, rcond=1e-6)[0]
            out += self._actuators.motor_damping * wanted

    def storage(self, t: float, measurement: Measurement) -> float:
        """Return V_3, the potential of the command, and the tank's energy, J.

        Task stiffness is frozen where it is. For q̄(θ) the potential is that of the law at q̄ plus
        ½ lᵀ K⁻¹ l, whose gradient in θ is l(q̄(θ)).

        Args:
            t: instant at which the references are taken, s.
            measurement: the true state then.
        """
        feedback, scratch = self.options.feedback, np.zeros(self._robot.n)
        offset = self._reference(t)[0] if self._reference else None
        joints = measurement.q_joint if feedback is Feedback.JOINT else measurement.theta
        if feedback in (Feedback.STATIC_JOINT, Feedback.STATIC_JOINT_TANK):
            sag = self._sag.copy()
            for _ in range(_SETTLE):
                self._law(measurement, measurement.theta + sag, offset, scratch)
                sag = -scratch / self._actuators.spring_stiffness
            joints = measurement.theta + sag
        self._law(measurement, joints, offset, scratch)
        error = self._error
        if feedback is Feedback.STATIC_JOINT_TANK and self._x_hat is not None:
            error = -self._x_hat
        potential = 0.5 * float(error @ self._space.stiffness @ error)
        if self.options.gravity is GravityCompensation.PLANNED:
            potential -= float(self._planned_gravity @ joints)
        if feedback is Feedback.STATIC_JOINT:
            potential += 0.5 * float(scratch @ (scratch / self._actuators.spring_stiffness))
        if feedback is Feedback.STATIC_JOINT_TANK:
            potential += self._energy
        return potential

    def _solve(self, q: Array) -> None:
        """Evaluate J*, S, ḡ and the task error at a configuration."""
        from sealag.kernels.operational_space import operational_space

        at, first = self._at, 0
        at.update(q, self._rest)
        for contact in self._contacts:
            last = first + contact.kind.rows
            self._J_s[first:last] = at.frame_jacobian(contact.frame)[: contact.kind.rows]
            first = last
        first = 0
        for row in self._rows:
            last = first + len(row.rows)
            self._J_t[first:last] = row.take(at)
            first = last
        good = operational_space(
            at.M, at.nle, self._J_s, self._J_t, self._K_x, self._levels,
            FORM_CODE[self._hierarchy.form],
            self._hierarchy.task_inertia is TaskInertia.LAMBDA_STAR,
            RANK_TOLERANCE, self._space,
        )  # fmt: skip
        if not good:
            raise RobotError(f"The mass matrix of {self._robot.name} is not positive definite.")
        self._measure_error(q)

    def _measure_error(self, q: Array) -> None:
        """x_d − x of every task row, rotations as rotation vectors in world axes."""
        first = 0
        for (task, wanted), row in zip(self._wanted, self._rows, strict=True):
            last = first + len(row.rows)
            self._error[first:last] = _difference(task, wanted, self._at, q=q, rows=row.rows)
            first = last

    def _law(
        self, measurement: Measurement, joints: Array, offset: Array | None, out: Array
    ) -> None:
        """The static law at given joint angles."""
        from sealag.kernels.operational_space import task_torque

        shift = self._space.joint_from_base @ (joints - measurement.q_joint)
        self._solve(self._robot.integrate(measurement.q, shift))
        if offset is not None:
            self._error += offset
        match self.options.gravity:
            case GravityCompensation.FEEDBACK:
                gravity = self._space.gravity
            case GravityCompensation.PLANNED:
                gravity = self._planned_gravity
            case _:
                gravity = self._rest[: self._robot.n]
        task_torque(self._space.J_star, self._space.stiffness, self._error, gravity, out)

    def _static_law(self, measurement: Measurement, offset: Array | None, out: Array) -> None:
        """The law at q̄(θ): q̄ ← θ − K⁻¹ l(q̄), warm-started with the last sag q̄ − θ."""
        before = np.inf
        for _ in range(max(1, self.options.static_iterations)):
            self._law(measurement, measurement.theta + self._sag, offset, out)
            new = -out / self._actuators.spring_stiffness
            change = float(np.abs(new - self._sag).max())
            if np.isfinite(before) and before > 1e-9:
                self.contraction = change / before
            self._sag[:], before = new, change
        if not np.isfinite(before) or before > 10.0:
            raise ContractionError("q̄(θ) diverges: the task is stiffer than the springs.")

    def _tank_law(self, t: float, measurement: Measurement, out: Array) -> None:
        """Replace x(q̄(θ)) by the tank's x̂, whose flow u the tank's energy pays for.

        x̂̇ = u + J* θ̇ and Ė = x̃̂ᵀ S u − ½ d̄ uᵀ S u − d̄ uᵀ S J* θ̇, with Q = S, the multiplier
        that is optimal for a symmetric stiffness; u = 0 when the tank is empty.
        """
        J, S = self._space.J_star, self._space.stiffness
        if self._x_hat is None:
            self._x_hat = -self._error.copy()
        step, self._last = max(t - self._last, 0.0), t
        flow = J @ measurement.theta_dot
        u = self.options.tank_rate * (-self._error - self._x_hat)
        d = self.options.delay_bound
        power = -self._x_hat @ S @ u - 0.5 * d * u @ S @ u - d * u @ S @ flow
        if self._energy + step * power < 0.0:
            u, power = np.zeros_like(u), 0.0
        self._energy += step * float(power)
        out += J.T @ S @ (-self._x_hat - self._error)
        self._x_hat = self._x_hat + step * (u + flow)


def _targets(robot: Robot, hierarchy: Hierarchy, posture: Array) -> list[tuple[Task, Array]]:
    """What each task shall reach: its value at the reference posture."""
    if posture.shape != (robot.nq,):
        raise InputError(f"The posture has shape {posture.shape}; ({robot.nq},) is needed.")
    wanted = []
    for task in hierarchy.ordered:
        match task.kind:
            case TaskKind.COM:
                value = robot.center_of_mass(posture)
            case TaskKind.POSTURE:
                value = robot.joint_positions(posture)
            case _:
                rotation, position = robot.frame_placement(task.frame or "", posture)
                value = np.hstack([rotation, position[:, None]])
        wanted.append((task, value))
    return wanted


def _difference(
    task: Task, wanted: Array, at: Workspace, *, q: Array, rows: tuple[int, ...]
) -> Array:
    """x_d − x on the chosen rows."""
    pick = list(rows)
    if task.kind is TaskKind.COM:
        return (wanted - at.com)[pick]
    if task.kind is TaskKind.POSTURE:
        return (wanted - q[len(q) - len(wanted) :])[pick]
    rotation, position = at.frame_placement(task.frame or "")
    both = np.concatenate([wanted[:, 3] - position, _rotation_vector(wanted[:, :3] @ rotation.T)])
    return both[pick]


def _rotation_vector(R: Array) -> Array:
    """The rotation vector of R, in the axes that R is written in."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0
    sine, cosine = float(np.linalg.norm(axis)), (float(np.trace(R)) - 1.0) / 2.0
    return axis * (np.arctan2(sine, cosine) / sine) if sine > 1e-9 else axis
