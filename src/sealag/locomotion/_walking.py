"""Walking with springs and delay: whole-body law, weight transfer, steps, all at one tick."""

import math

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError, SolverError
from sealag.locomotion._terrain import Terrain
from sealag.locomotion._walking_options import Prediction, WalkingGait, WalkingOptions
from sealag.locomotion._walking_placement import Placement
from sealag.locomotion._walking_start import walking_start
from sealag.locomotion._walking_state import Body, Odometry, Predictor, tilt
from sealag.locomotion._walking_step import StepReferences
from sealag.robot import Robot
from sealag.typing import Array
from sealag.whole_body import Feedback, Measurement

_DAMPING = 1e-9  # share of the trace: bounds torques near a straight knee
_LATE_SWING = 0.6  # share of the step after which a touch is a touchdown


class WalkingController:
    """Walks a biped with two point feet and six series elastic joints; one call per tick.

    In single support six tasks take the six joints: CoM height, torso roll and pitch, swing foot.
    CoM x and y follow the pendulum and are steered by where the next foot lands; yaw is free. The
    task torque is that of Eqs. (11), (17) written with accelerations: J*ᵀΛ(ẍ_d + K_x x̃ − J̇v)
    plus Coriolis and gravity torques. In double support the torques of the two single supports
    are blended: both keep both feet at rest, so their convex combination moves the weight from
    foot to foot and is continuous.

    Args:
        robot: Floating base, six actuated joints.
        actuators: Springs and motors as the controller believes them to be.
        terrain: The ground as the controller believes it to be.
        feet: Frames of the left and the right foot.
        gait: The plan.
        options: Which means are used, and their gains.
        period: Time between two ticks, s.

    Attributes:
        touchdowns: Planned steps so far: (instant on the controller's clock, foot number, its
            planned place (3,)).
        tau_task: Task torque of the last tick (n,), before feedforward of motor and spring, Nm.

    Raises:
        InputError: The robot is not such a biped, or the period is not positive.
    """

    def __init__(
        self,
        robot: Robot,
        actuators: Actuators,
        terrain: Terrain,
        *,
        feet: tuple[str, str] = ("left_foot", "right_foot"),
        gait: WalkingGait | None = None,
        options: WalkingOptions | None = None,
        period: float = 1e-3,
    ) -> None:
        from sealag.kernels import walking

        if robot.nv_base != 6 or robot.n != 6:
            raise InputError(
                f"walking needs a floating base and 6 actuated joints; {robot.name} has "
                f"{robot.nv_base} base velocities and {robot.n} joints"
            )
        if not (math.isfinite(period) and period > 0.0):
            raise InputError(f"the controller's period must be a time > 0 s, got {period}")
        self._kernel, self._robot, self._actuators = walking, robot, actuators
        self._terrain, self._period = terrain, period
        self.feet = tuple(robot.check_frame(foot) for foot in feet)
        self.gait, self.options = gait or WalkingGait(), options or WalkingOptions()
        self._body = Body(robot, feet)
        self._torque_limit = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 1e3)
        self._D = np.ascontiguousarray(actuators.motor_damping)
        self._D_by_K = actuators.motor_damping / actuators.spring_stiffness
        self._rows = np.zeros((6, robot.nv))
        self._bias, self._wanted, self._height = np.zeros(6), np.zeros(6), np.zeros(3)
        self._spin = np.zeros((3, robot.nv))
        self.tau_task = np.zeros(robot.n)
        self.touchdowns: list[tuple[float, int, Array]] = []

    def reset(self, t: float, measurement: Measurement) -> None:
        """Begin at the apex over the foot that is loaded, in the middle of its step.

        Args:
            t: First instant, s.
            measurement: The state then, not delayed.

        Raises:
            InputError: Not exactly one foot is on the ground.
        """
        contact = measurement.contact
        if contact.size != 2 or (contact > 0.0).sum() != 1:
            raise InputError("a walk begins with one of two feet on the ground")
        gait, body = self.gait, self._body
        body.update(measurement.q, measurement.v)
        self.placement = Placement(gait, self.options, self._robot.mass)
        self.step = StepReferences(gait, self._terrain, step_length=self.placement.plan.step_length)
        self.step.stance = int(contact.argmax())
        self.step.start(
            t,
            phase=0.5 * (gait.step_time + gait.transfer_time),
            com=np.array([body.com[2], body.com_rate[2]]),
            feet=body.feet,
            swing=body.feet_rate[1 - self.step.stance],
        )
        self._odometry = Odometry(body.feet, self.step.stance)
        self._predictor = Predictor(
            self._robot, self._actuators, period=self._period, prediction=self.options.prediction
        )
        self._smooth: Array | None = None
        self.touchdowns.clear()

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Compute the command tau_osc.

        Args:
            t: The controller's own clock, s.
            measurement: The newest that has arrived.
            out: Where the command (n,) is written, Nm.

        Raises:
            SolverError: The state has left what the law can be computed for.
        """
        options = self.options
        age = t - measurement.time
        now = t + (age + options.embedded_delay if options.preview else 0.0)
        self._observe(measurement, now)
        self._switch(now, measurement.contact)
        step, body = self.step, self._body
        phase = step.phase(now)
        self.placement.update(
            phase, step, body.com, body.com_rate, angular=body.angular, period=self._period
        )
        if phase >= self.gait.transfer_time:
            if not step.swinging:
                step.lift(body.feet[1 - step.stance])
            step.move(now, self._period)
        rates = self._tasks(now, phase)
        if not math.isfinite(self.tau_task.sum()):
            raise SolverError("the walking law has no finite torque in this state")
        np.clip(self.tau_task, -self._torque_limit, self._torque_limit, out=self.tau_task)
        out[:] = self._embedded(rates)
        self._predictor.sent(out, t + age + options.embedded_delay)

    def motor_start(self, q: Array, v: Array, *, stance: int = 1) -> Array:
        """Return motor angles (n,) whose springs carry the first task torque, rad.

        Args:
            q: Configuration at the start (nq,).
            v: Velocity at the start (nv,).
            stance: Foot stood on: 0 left, 1 right.
        """
        robot = self._robot
        first = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=2)
        first.q[:], first.v[:], first.contact[stance] = q, v, 1.0
        first.theta[:], first.theta_dot[:] = first.q_joint, first.v_joint
        self.reset(0.0, first)
        self.tick(0.0, first, np.zeros(robot.n))
        return first.q_joint + self.tau_task / self._actuators.spring_stiffness

    # State ---------------------------------------------------------------------------------------
    def _observe(self, measurement: Measurement, now: float) -> None:
        """Estimate and predict the state, and evaluate the robot's terms there."""
        options, body, q = self.options, self._body, measurement.q.copy()
        v = measurement.v.copy()
        if options.feedback == Feedback.MOTOR:
            q[-6:] = measurement.theta
        elif options.feedback == Feedback.STATIC_JOINT:
            q[-6:] = measurement.theta - self.tau_task / self._actuators.spring_stiffness
        body.update(q, v)
        if options.odometry:
            self._odometry.correct(q, v, body, self.step, t=measurement.time)
            body.update(q, v)
        if options.prediction != Prediction.NONE:
            self._predictor.move(
                q, v, body, self.step, theta=measurement.theta,
                theta_dot=measurement.theta_dot, measured=measurement.time, now=now,
            )  # fmt: skip
            body.update(q, v)
        else:
            self._predictor.tau_sea[:] = measurement.tau_sea

    def _switch(self, now: float, contact: Array) -> None:
        """Begin the next step when planned, or when the swing foot is seen on the ground."""
        step, gait = self.step, self.gait
        late = step.phase(now) > _LATE_SWING * gait.step_time + 0.4 * gait.transfer_time
        touched = self.options.early_contact and late and contact[1 - step.stance] > 0.0
        if touched or step.phase(now) >= gait.step_time - 1e-9:
            self.touchdowns.append((now, 1 - step.stance, step.target.copy()))
            step.change(now, self._body.feet)
            self.placement.restart()

    # Law -----------------------------------------------------------------------------------------
    def _tasks(self, now: float, phase: float) -> Array:
        """Set ``tau_task`` and return the planned joint rates (n,)."""
        options, body, step = self.options, self._body, self.step
        transfer, swing = self.gait.transfer_time, 1 - step.stance
        step.height_at(now, self._height)
        roll, pitch, yaw = tilt(body.R)
        heading = np.array(
            [[math.cos(yaw), math.sin(yaw), 0.0], [-math.sin(yaw), math.cos(yaw), 0]]
        )
        self._spin[:, 3:6] = body.R
        turn = self._spin @ body.v
        gains = (options.height_stiffness, options.posture_stiffness, options.swing_stiffness)
        damping = [2.0 * options.task_damping * math.sqrt(k) for k in gains]
        planned = 1.0 if options.acceleration_feedforward else 0.0
        z, z_rate, z_bend = self._height.tolist()
        wanted = self._wanted
        wanted[0] = planned * z_bend + gains[0] * (z - body.com[2])
        wanted[0] += damping[0] * (z_rate - body.com_rate[2])
        wanted[1] = -gains[1] * roll
        wanted[2] = -gains[1] * pitch
        wanted[1:3] -= damping[1] * (heading @ turn)
        posture, rate = heading @ self._spin, np.zeros(3)
        if not options.acceleration_feedforward:
            body.forget_velocity()
        M_inverse = np.linalg.inv(body.M)
        if phase < transfer:
            wanted[3:] = 0.0
            share = phase / transfer
            self.tau_task[:] = share * self._support(M_inverse, step.stance, posture)
            self.tau_task += (1.0 - share) * self._support(M_inverse, swing, posture)
        else:
            error = step.swing[0] - body.feet[swing]
            rate = step.swing[1] + options.position_rate * error
            wanted[3:] = planned * step.swing[2] + gains[2] * error
            wanted[3:] += damping[2] * (step.swing[1] - body.feet_rate[swing])
            self.tau_task[:] = self._support(M_inverse, step.stance, posture)
        return self._planned_rates(z_rate, rate, posture, spin=float(turn[2]))

    def _support(self, M_inverse: Array, stance: int, posture: Array) -> Array:
        """Return the torque (n,) that gives the tasks ``_wanted`` while standing on one foot."""
        body, swing = self._body, 1 - stance
        self._rows[0], self._rows[1:3] = body.com_jacobian[2], posture
        self._rows[3:] = body.J[swing]
        self._bias[0], self._bias[3:] = body.com_bias[2], body.b[swing]
        a_0, P = self._kernel.constrain(M_inverse, body.h, body.J[stance], body.b[stance], 6)
        tau, _ = self._kernel.task_torques(a_0, P, self._rows, self._bias, self._wanted, _DAMPING)
        return tau

    def _planned_rates(self, rise: float, swing: Array, posture: Array, *, spin: float) -> Array:
        """Return the joint rates (n,) of the planned tasks and the predicted passive motion."""
        body, step = self._body, self.step
        rows = np.vstack(
            [
                body.J[step.stance], body.com_jacobian[2:], posture, body.J[1 - step.stance],
                body.com_jacobian[:2], self._spin[2:],
            ]
        )  # fmt: skip
        rates = np.zeros(12)
        rates[3], rates[6:9], rates[9:11], rates[11] = rise, swing, body.com_rate[:2], spin
        return self._kernel.damped_solve(rows, rates, _DAMPING)[6:]

    def _embedded(self, rates: Array) -> Array:
        """Return the command (n,) that makes springs and motors carry the task torque."""
        options, tau = self.options, self.tau_task
        command = tau.copy()
        if options.lead:
            if self._smooth is None:
                self._smooth = tau.copy()
            keep = math.exp(-self._period / options.lead_time)
            self._smooth = tau + keep * (self._smooth - tau)
            slope = (tau - self._smooth) / options.lead_time
            command = self._smooth + self._D_by_K * slope
        if options.velocity_feedforward:
            command += self._D * rates
        if options.torque_feedback > 0.0:
            command += options.torque_feedback * (tau - self._predictor.tau_sea)
        return command


def begin_walk(
    robot: Robot,
    actuators: Actuators,
    terrain: Terrain,
    *,
    feet: tuple[str, str] = ("left_foot", "right_foot"),
    gait: WalkingGait | None = None,
    options: WalkingOptions | None = None,
    period: float = 1e-3,
) -> tuple[WalkingController, Array, Array, Array]:
    """Return a walking controller and the state in which its walk begins.

    Args:
        robot: Biped with a floating base and six joints.
        actuators: Springs and motors as the controller believes them to be.
        terrain: The ground.
        feet: Frames of the left and the right foot.
        gait: The plan.
        options: Means and gains of the controller.
        period: Time between two ticks, s.

    Returns:
        The controller, q (nq,), v (nv,) and motor angles (n,) that carry the first torque, rad.

    Raises:
        InputError: The robot is not such a biped, or its legs cannot take the posture.
    """
    controller = WalkingController(
        robot, actuators, terrain, feet=feet, gait=gait, options=options, period=period
    )
    q, v = walking_start(robot, terrain, gait=controller.gait, feet=feet)
    return controller, q, v, controller.motor_start(q, v)
