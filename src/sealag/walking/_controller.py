"""The walking controller: whole-body law, weight transfer, steps and command at each tick."""

import math
from typing import TYPE_CHECKING

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError, SolverError
from sealag.kernels import keep
from sealag.robot import Robot
from sealag.typing import Array
from sealag.walking._carried import Carried
from sealag.walking._estimator import Body, Estimator, biped_of
from sealag.walking._feet import Side
from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground
from sealag.walking._options import (
    JointAngles,
    Prediction,
    WalkingOptions,
)
from sealag.walking._placement import Placement
from sealag.walking._step import StepReferences
from sealag.whole_body import Measurement

if TYPE_CHECKING:
    from sealag.kernels.walking_law import Gains, Lead

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
        feet: Frames of the left and the right foot.
        ground: The ground as the controller believes it to be.
        gait: The plan.
        options: Means and gains.
        period: Time between two ticks, s.

    Attributes:
        tau_task: Task torque of the last tick (n,), before feedforward of motor and spring, Nm.

    Raises:
        InputError: The robot is not such a biped, or the period is not positive.
    """

    def __init__(
        self,
        robot: Robot,
        actuators: Actuators,
        *,
        feet: tuple[str, str],
        ground: Ground,
        gait: WalkingGait,
        options: WalkingOptions,
        period: float,
    ) -> None:
        from sealag.kernels import walking_law

        if robot.nv_base != 6 or robot.n != 6:
            raise InputError(
                f"walking needs a floating base and 6 actuated joints; {robot.name} has "
                f"{robot.nv_base} base velocities and {robot.n} joints"
            )
        if not (math.isfinite(period) and period > 0.0):
            raise InputError(f"the controller's period must be a time > 0 s, got {period}")
        self._kernel, self._robot, self._actuators = walking_law, robot, actuators
        self._ground, self._period = ground, period
        self.gait, self.options = gait, options
        self._body = Body(robot, feet)
        gains, lead = _gains(self.options, gait, period)
        biped = biped_of(robot, actuators, self._body, feet, period=period, gains=gains, lead=lead)
        self._biped, self.tau_task, self._first = keep(biped), biped.tau, True
        self._tau_sea = biped.tau_sea
        self._estimator = Estimator(
            biped, self._biped, period=period, prediction=self.options.prediction,
            odometry=self.options.odometry,
        )  # fmt: skip

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
        body.q[:], body.v[:] = measurement.q, measurement.v
        body.update()
        self.placement = Placement(gait, self.options, self._robot.mass)
        self.step = StepReferences(gait, self._ground, step_length=self.placement.plan.step_length)
        stance = Side(int(contact.argmax()))
        feet = body.feet()
        self.step.start(
            t,
            stance,
            phase=0.5 * (gait.step_time + gait.transfer_time),
            com=np.array([body.terms.com[2], body.terms.com_velocity[2]]),
            feet=feet,
            swing=body.foot_rate(stance.other),
        )
        self._estimator.reset(feet, stance)
        self._first = True

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
            phase,
            step,
            body.terms.com,
            body.terms.com_velocity,
            angular=body.angular,
            period=self._period,
        )
        if phase >= self.gait.transfer_time:
            if not step.swinging:
                step.lift(body.foot(step.swing_foot))
            step.move(now, self._period)
        reference = self._kernel.Reference(
            height=step.height, height_time=step.height_time(now), swing=step.swing, phase=phase,
            transfer_time=self.gait.transfer_time, stance=step.stance,
            still=not options.acceleration_feedforward,
        )  # fmt: skip
        if not self._kernel.command(self._biped, tuple(reference), self._first, out):
            raise SolverError("the walking law has no finite torque in this state")
        self._first = False
        self._estimator.sent(out, t + age + options.embedded_delay)

    def motor_start(self, q: Array, v: Array, *, stance: Side = Side.RIGHT) -> Array:
        """Return motor angles (n,) whose springs carry the first task torque, rad.

        Args:
            q: Configuration at the start (nq,).
            v: Velocity at the start (nv,).
            stance: Foot stood on.
        """
        robot = self._robot
        first = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=2)
        first.q[:], first.v[:], first.contact[stance] = q, v, 1.0
        first.theta[:], first.theta_dot[:] = first.q_joint, first.v_joint
        self.reset(0.0, first)
        self.tick(0.0, first, np.zeros(robot.n))
        return first.q_joint + self.tau_task / self._actuators.spring_stiffness

    def memory(self) -> list[Carried]:
        """Return all that one tick leaves to the next, for whoever saves and restores a walk."""
        own = Carried(self, ("_first",), ())
        parts = (self.step, self.placement, self._estimator)
        return [own, *(one for part in parts for one in part.memory())]

    # State ---------------------------------------------------------------------------------------
    def _observe(self, measurement: Measurement, now: float) -> None:
        """Estimate and predict the state, and evaluate the robot's terms there."""
        options, body, stiffness = self.options, self._body, self._actuators.spring_stiffness
        body.q[:], body.v[:] = measurement.q, measurement.v
        if options.feedback == JointAngles.MOTOR:
            body.q[-6:] = measurement.theta
        elif options.feedback == JointAngles.STATIC_JOINT:
            body.q[-6:] = measurement.theta - self.tau_task / stiffness
        self._estimator.move(
            body, self.step, theta=measurement.theta, theta_dot=measurement.theta_dot,
            measured=measurement.time, now=now,
        )  # fmt: skip
        if options.prediction == Prediction.NONE:
            self._tau_sea[:] = measurement.tau_sea

    def _switch(self, now: float, contact: Array) -> None:
        """Begin the next step as planned, or at an early touchdown of the swing foot."""
        step, gait = self.step, self.gait
        late = step.phase(now) > _LATE_SWING * gait.step_time + 0.4 * gait.transfer_time
        touched = self.options.early_contact and late and contact[step.swing_foot] > 0.0
        if touched or step.phase(now) >= gait.step_time - 1e-9:
            step.change(now, self._body.feet())
            self.placement.restart()


def _gains(options: WalkingOptions, gait: WalkingGait, period: float) -> "tuple[Gains, Lead]":
    """Return gains and lead of the law."""
    from sealag.kernels.walking_law import Gains, Lead

    def damping(stiffness: float) -> float:
        return 2.0 * options.task_damping * math.sqrt(stiffness)

    # The couple acts in double support only, and there as 4 s (1 - s): on average over a step as
    # this share of itself, which scales stiffness and damping alike.
    acting = 2.0 / 3.0 * gait.transfer_time / gait.step_time
    gains = Gains(
        height_stiffness=float(options.height_stiffness),
        posture_stiffness=float(options.posture_stiffness),
        swing_stiffness=float(options.swing_stiffness),
        height_damping=damping(options.height_stiffness),
        posture_damping=damping(options.posture_stiffness),
        swing_damping=damping(options.swing_stiffness),
        heading_stiffness=float(options.heading_stiffness),
        heading_damping=damping(options.heading_stiffness / acting),
        planned=1.0 if options.acceleration_feedforward else 0.0,
        position_rate=float(options.position_rate),
        damping=_DAMPING,
    )
    lead = Lead(
        keep=math.exp(-period / options.lead_time),
        time=float(options.lead_time) if options.lead else 0.0,
        forward=1.0 if options.velocity_feedforward else 0.0,
        feedback=float(options.torque_feedback),
    )
    return gains, lead
