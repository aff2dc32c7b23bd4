"""The centralised whole-body operational-space controller, Eqs. (10)-(17), one tick at a time."""

from collections.abc import Callable

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import ContractionError, RobotError
from sealag.robot import Contact, Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._options import ControllerOptions, TaskError
from sealag.whole_body._protocol import Measurement
from sealag.whole_body._stack import FORM_CODE, RANK_TOLERANCE
from sealag.whole_body._tank import EnergyTank
from sealag.whole_body._task_reader import read_tasks
from sealag.whole_body._tasks import Feedback, GravityCompensation, Hierarchy, TaskInertia

_SETTLE = 6  # iterations for q̄(θ) of the true state, where only the storage is wanted
_SETTLED = 1e-12  # rad: a smaller step of q̄(θ) is the last
_LOST = 10.0  # rad: a larger one is no robot's
_GAUSS = ((0.5 - 0.5 / 3**0.5, 0.5), (0.5 + 0.5 / 3**0.5, 0.5))  # places and weights on 0 … 1


class Controller:
    """τ_osc = Σ J*ᵀ S x̃ + ḡ + D_θ θ̇_d at the fed-back configuration.

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
            InputError: the posture has another shape.
            UnknownNameError: a frame or joint does not exist.
            RobotError: the mass matrix at the posture is not positive definite.
        """
        from sealag.kernels import control_law, operational_space

        self._kernel = control_law
        self.options = options or ControllerOptions()
        self._robot, self._actuators, self._reference = robot, actuators, reference
        frames, self._tasks = read_tasks(robot, hierarchy, contacts, posture=posture)
        self._levels, K_x = self._tasks[2], hierarchy.gain(robot)
        sizes = robot.nv, robot.n, len(self._tasks[0]), len(K_x)
        self._sizes, self._memory = sizes, np.zeros(operational_space.memory_size(*sizes))
        self._space = operational_space.divide(self._memory, *sizes)
        self._allocate(frames)
        self._gains = (
            K_x,
            self._planned_gravity,
            FORM_CODE[hierarchy.form],
            hierarchy.task_inertia is TaskInertia.LAMBDA_STAR,
            RANK_TOLERANCE,
            self.options.task_error is TaskError.CONSISTENT,
            self.options.gravity is GravityCompensation.FEEDBACK,
        )
        self._solve(np.asarray(posture, dtype=float))
        self._along[:] = self._space.joint_from_base
        if self.options.gravity is GravityCompensation.PLANNED:
            self._planned_gravity[:] = self._space.gravity

    def _allocate(self, frames: list[str]) -> None:
        robot, options = self._robot, self.options
        nv, n, c, m = self._sizes
        self._terms = robot.workspace().terms
        self._seen = (
            *robot.frame_mounts(frames), np.zeros((len(frames), 6, nv)),
            np.zeros((len(frames), 3, 3)), np.zeros((len(frames), 3)), np.zeros((len(frames), 6)),
        )  # fmt: skip
        self._J_t, self._J_s = np.zeros((m, nv)), np.zeros((c, nv))
        self._error, self._offset, self._wanted = np.zeros(m), np.zeros(m), np.zeros(m)
        self._motion, self._along = np.zeros(nv), np.zeros((nv, n))
        self._planned_gravity, self._unused = np.zeros(n), np.zeros(n)
        self._sag, self._step, self._square = np.zeros(n), np.zeros(n), np.zeros((n, n))
        self._theta, self._last = np.zeros(n), 0.0
        self._tank = EnergyTank(
            size=m,
            energy=options.tank_energy,
            rate=options.tank_rate,
            delay_bound=options.delay_bound,
            flow=options.tank_flow,
        )

    @property
    def tank_energy(self) -> float:
        """Energy left in the tank, J, never below 0; 0 if the law has none."""
        tank = self.options.feedback is Feedback.STATIC_JOINT_TANK
        return self._tank.energy if tank else 0.0

    @property
    def contraction(self) -> float:
        """‖K^-½ J*ᵀ S J* K^-½‖ where the law was last evaluated: below 1, q̄(θ) exists.

        The gradient of gravity compensation that is fed back is not in it; see `evaluate`.
        """
        J, root = self._space.J_star, np.sqrt(self._actuators.spring_stiffness)
        return float(np.linalg.norm(J.T @ self._space.stiffness @ J / np.outer(root, root), 2))

    def reset(self, t: float, measurement: Measurement) -> None:
        """Forget the past: fill the tank, start q̄(θ) and x̂ anew.

        Args:
            t: first instant, s.
            measurement: the state then.
        """
        self._sag[:] = measurement.q_joint - measurement.theta
        self._tank.empty_memory()
        self._last = t
        self._solve(measurement.q)
        self._along[:] = self._space.joint_from_base

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Compute the command of Eqs. (11), (17).

        Args:
            t: the controller's clock, s.
            measurement: the newest measurement.
            out: (n,) command, Nm.

        Raises:
            RobotError: the mass matrix is not positive definite.
            ContractionError: q̄(θ) is fed back and does not exist, since the task is stiffer than
                the springs, or is not found, since the reference is out of reach.
        """
        rate = self._refer(t)
        match self.options.feedback:
            case Feedback.JOINT:
                self._law(measurement, measurement.q_joint, out)
            case Feedback.MOTOR:
                self._law(measurement, measurement.theta, out)
            case Feedback.STATIC_JOINT:
                self._static_law(measurement, self._sag, self.options.static_iterations, out)
            case Feedback.STATIC_JOINT_TANK:
                self._static_law(measurement, self._sag, self.options.static_iterations, out)
                self._tank_law(t, measurement, out)
        self._along[:] = self._space.joint_from_base
        if rate is not None and self.options.velocity_feedforward:
            rate = np.array(rate, dtype=float)
            self._leave_to_higher(rate)
            theta_dot = np.linalg.lstsq(self._space.J_star, rate, rcond=1e-6)[0]
            out += self._actuators.motor_damping * theta_dot

    def storage(self, t: float, measurement: Measurement, command: Array) -> float:
        """Return V_3, the potential of the undelayed command, and the tank's energy, J.

        Its gradient in θ is minus the command, with J* and S frozen where they are:
        V_3 = ½ x̃ᵀ S x̃ − ∫ ḡᵀ dθ; for q̄(θ) that at q̄, less ½ lᵀ K⁻¹ l; through the tank with
        x̃̂ = x_d − x̂, x̂ carried on by J* from the last measured θ to the true one. Compensation
        that is fed back has a potential up to its asymmetry. `tank_energy` is the tank's part
        alone. The next tick is what it would have been without this call.

        Args:
            t: instant at which the references are taken, s.
            measurement: the true state then.
            command: where the undelayed command (n,) is written, without feedforward of θ̇_d, Nm.
        """
        feedback, torque = self.options.feedback, command
        self._refer(t)
        joints = measurement.q_joint if feedback is Feedback.JOINT else measurement.theta
        if feedback in (Feedback.STATIC_JOINT, Feedback.STATIC_JOINT_TANK):
            sag = self._sag.copy()
            self._static_law(measurement, sag, _SETTLE, torque)
            joints = measurement.theta + sag
        else:
            self._law(measurement, joints, torque)
        if feedback is Feedback.STATIC_JOINT_TANK:
            joints = measurement.theta
            self._gravity_of_motors(measurement)
            if self._tank.started:
                carried = self._space.J_star @ (measurement.theta - self._theta)
                self._error[:] = self._wanted - self._tank.position - carried
            self._torque(torque)
        energy = 0.5 * float(self._error @ self._space.stiffness @ self._error)
        if feedback is Feedback.STATIC_JOINT:
            energy -= 0.5 * float(torque @ (torque / self._actuators.spring_stiffness))
        if feedback is Feedback.STATIC_JOINT_TANK:
            energy += self._tank.energy
        match self.options.gravity:
            case GravityCompensation.PLANNED:
                energy -= float(self._planned_gravity @ joints)
            case GravityCompensation.FEEDBACK:
                energy -= self._work_of_gravity(measurement, joints)
        return energy

    def _work_of_gravity(self, measurement: Measurement, joints: Array) -> float:
        """U_g of the measured configuration and ∫ ḡᵀ dq_j from there to the fed-back one."""
        away = joints - measurement.q_joint
        self._solve(measurement.q)
        work = float(self._terms[10][1])
        for place, weight in _GAUSS:
            self._law(measurement, measurement.q_joint + place * away, self._unused)
            work += weight * float(self._space.gravity @ away)
        return work

    def _refer(self, t: float) -> Array | None:
        """Take the references of an instant; their rate, if there are any."""
        if self._reference is None:
            return None
        offset, rate = self._reference(t)
        self._offset[:] = offset
        return rate

    def _solve(self, q: Array) -> None:
        """Evaluate J*, S, ḡ and the task errors at a configuration."""
        self._evaluate(q, self._robot.joint_positions(q), self._unused)

    def _evaluate(self, q: Array, joints: Array, out: Array) -> None:
        """Evaluate them, and the torque, at a configuration moved to given joint angles."""
        good = self._kernel.law(
            self._robot.tree, self._terms, self._seen, self._tasks, self._gains,
            (q, joints, self._along, self._offset),
            (self._J_s, self._J_t, self._error, self._wanted, out), self._memory, self._sizes,
        )  # fmt: skip
        if not good:
            raise RobotError(f"The mass matrix of {self._robot.name} is not positive definite.")

    def _leave_to_higher(self, rate: Array) -> None:
        """Take out of the tasks' rates what the tasks above will do."""
        if len(self._levels) > 2:
            self._kernel.leave_to_higher(
                self._J_t, self._space.lift, self._levels, rate, self._motion
            )

    def _torque(self, out: Array) -> None:
        space, fed_back = self._space, self.options.gravity is GravityCompensation.FEEDBACK
        gravity = space.gravity if fed_back else self._planned_gravity
        self._kernel.task_torque(space.J_star, space.stiffness, self._error, gravity, out)

    def _law(self, measurement: Measurement, joints: Array, out: Array) -> None:
        """The law l at given joint angles."""
        self._evaluate(measurement.q, joints, out)

    def _static_law(
        self, measurement: Measurement, sag: Array, iterations: int, out: Array
    ) -> None:
        """The law at q̄(θ) by Newton's method, from the last sag q̄ − θ, which is moved.

        The springs carry it: l(q̄) = K (θ − q̄) = −K sag, so that the last step needs no new
        evaluation of the law.
        """
        K, space, step = self._actuators.spring_stiffness, self._space, self._step
        for _ in range(iterations):
            self._law(measurement, measurement.theta + sag, out)
            exists = self._kernel.static_step(
                space.J_star, space.stiffness, K, out, sag, self._square, step
            )
            size = float(np.abs(step).max())
            if not (exists and size < _LOST):
                raise self._without_static_state(size)
            if size < _SETTLED:
                break
        out[:] = -K * sag
        self._error -= space.J_star @ step

    def _without_static_state(self, step: float) -> ContractionError:
        if self.contraction >= 1.0:
            return ContractionError(
                "q̄(θ) does not exist: the task is stiffer than the springs "
                f"(contraction factor {self.contraction:.2f}; below 1 is needed)."
            )
        return ContractionError(
            f"q̄(θ) is not found: Newton's step towards it is {step:.2g} rad. The springs can hold "
            f"the task's stiffness (contraction factor {self.contraction:.2f}), but its error is "
            "out of reach: is the reference too far away?"
        )

    def _gravity_of_motors(self, measurement: Measurement) -> None:
        """With the tank, compensation that is fed back is taken at θ, whose gradient it has."""
        if self.options.gravity is GravityCompensation.FEEDBACK:
            self._law(measurement, measurement.theta, self._step)

    def _tank_law(self, t: float, measurement: Measurement, out: Array) -> None:
        """Replace x(q̄(θ)) by the tank's x̂."""
        tank, target = self._tank, self._wanted - self._error
        self._gravity_of_motors(measurement)
        space = self._space
        if tank.started:
            tank.step(
                t - self._last,
                space.J_star @ (measurement.theta - self._theta),
                wanted=self._wanted,
                target=target,
                stiffness=space.stiffness,
            )
        else:
            tank.start(target)
        self._theta[:], self._last = measurement.theta, t
        self._error[:] = self._wanted - tank.position
        self._torque(out)
