"""State estimation of the walking controller: body terms, leg odometry, prediction."""

from typing import TYPE_CHECKING, Any

import numpy as np

from sealag.actuation import Actuators
from sealag.robot import Robot
from sealag.typing import Array
from sealag.walking._feet import Side
from sealag.walking._options import Prediction
from sealag.walking._step import StepReferences

if TYPE_CHECKING:
    from sealag.kernels.walking_law import Biped, Gains, Lead

_RING = 512  # commands in flight at most


class Body:
    """Configuration, velocity and terms of the robot as the controller believes them to be.

    Args:
        robot: The robot.
        feet: Frames of the left and the right foot.

    Attributes:
        q: Configuration (nq,).
        v: Velocity (nv,).
        terms: Its rigid-body terms, live.
        angular: Angular momentum about the centre of mass (3,), live.
    """

    def __init__(self, robot: Robot, feet: tuple[str, str]) -> None:
        self._workspace, self._feet = robot.workspace(), feet
        at = self._workspace
        self.q, self.v = robot.neutral(), np.zeros(robot.nv)
        self.terms, self.angular = at.terms, at.momentum[3:]

    def update(self) -> None:
        """Evaluate the terms at ``q`` and ``v``."""
        self._workspace.update(self.q, self.v)

    def feet(self) -> Array:
        """Return the positions of both feet (2, 3), m."""
        return np.stack([self.foot(side) for side in Side])

    def foot(self, foot: int) -> Array:
        """Return a copy of a foot's position (3,), m."""
        return self._workspace.frame_placement(self._feet[foot])[1].copy()

    def foot_rate(self, foot: int) -> Array:
        """Return a foot's velocity (3,), m/s."""
        return self._workspace.frame_velocity(self._feet[foot])[:3]


def biped_of(
    robot: Robot, actuators: Actuators, body: Body, feet: tuple[str, str], *, period: float,
    gains: "Gains", lead: "Lead",
) -> "Biped":  # fmt: skip
    """Return the robot as the walking kernels know it.

    Args:
        robot: The robot.
        actuators: Springs and motors as the controller believes them to be.
        body: Where it is; its arrays are shared.
        feet: Frames of the left and the right foot.
        period: Of the controller, s.
        gains: Of the law.
        lead: By which means springs and motors carry the task torque.
    """
    from sealag.kernels import dynamics, walking_law

    n, nv = robot.n, robot.nv
    stiffness, damping = actuators.spring_stiffness, actuators.motor_damping
    springs = walking_law.Springs(
        stiffness=np.array(stiffness), damping=np.array(damping), lag=damping / stiffness,
        limit=np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 1e3),
        table=motor_table(actuators, period),
    )  # fmt: skip
    return walking_law.Biped(
        tree=robot.tree, terms=body.terms, mounts=robot.frame_mounts(feet),
        feet=dynamics.allocate_frames(2, nv), springs=springs,
        flight=walking_law.Flight(np.full(_RING, -np.inf), np.zeros((_RING, n))),
        gains=gains, lead=lead, q=body.q, v=body.v, motor=np.zeros((n, 2)),
        anchor=np.zeros((2, 3)), tau_sea=np.zeros(n), tau=np.zeros(n), rates=np.zeros(n),
        smooth=np.zeros(n), scratch=walking_law.allocate_scratch(nv, n),
    )  # fmt: skip


class Estimator:
    """Estimates the state from a measurement, and predicts it to when the next command acts.

    The base's position and velocity follow from the foot stood on, the joint encoders and the IMU.

    Args:
        biped: The robot as kernels know it; q, v, motor and spring torques are moved.
        kept: The same as kernels take it.
        period: Of the controller, s.
        prediction: By which means.
        odometry: Whether the measured place and velocity of the base are replaced.
    """

    def __init__(
        self, biped: "Biped", kept: Any, *, period: float, prediction: Prediction, odometry: bool
    ) -> None:
        from sealag.kernels.walking_state import Timing, foresee

        self._timing, self._foresee, self._biped, self._kept = Timing, foresee, biped, kept
        self._period, self._prediction, self._odometry = period, prediction, odometry
        self._stance, self._newest, self._any = 0, 0, False

    def reset(self, feet: Array, stance: int) -> None:
        """Begin with both feet at known positions, and no command in flight.

        Args:
            feet: Their positions (2, 3), m.
            stance: Foot stood on.
        """
        # A plain integer: kernels take ten times as long to recognise an enumeration.
        self._biped.anchor[:], self._stance = feet, int(stance)
        self._biped.flight.arrival[:], self._newest, self._any = -np.inf, 0, False

    def sent(self, command: Array, arrival: float) -> None:
        """Add a command to those in flight.

        Args:
            command: (n,) Nm.
            arrival: When it will reach the motors, s.
        """
        flight = self._biped.flight
        self._newest = (self._newest + 1) % _RING
        flight.command[self._newest], flight.arrival[self._newest] = command, arrival
        if not self._any:
            flight.command[:], self._any = command, True

    def move(
        self, body: Body, step: StepReferences, *, theta: Array, theta_dot: Array,
        measured: float, now: float,
    ) -> None:  # fmt: skip
        """Predict the body's q and v from the measurement to ``now``, and evaluate its terms there.

        Args:
            body: The robot.
            step: The step's references.
            theta: Motor angles (n,), rad.
            theta_dot: Motor speeds (n,), rad/s.
            measured: Instant of the measurement, s.
            now: Instant to predict, s.
        """
        ticks = round((now - measured) / self._period)
        if self._prediction == Prediction.VELOCITY:
            ticks = -ticks
        elif self._prediction == Prediction.NONE or not self._any:
            ticks = 0
        if self._odometry:
            self._step_over(body, step, measured)
        motor = self._biped.motor
        motor[:, 0], motor[:, 1] = theta, theta_dot
        timing = self._timing(
            measured=measured, period=self._period, ticks=ticks, touchdown=step.begin,
            lift_off=step.begin + step.transfer_time, stance=step.stance,
            foot=self._stance if self._odometry else -1, newest=self._newest,
        )  # fmt: skip
        self._foresee(self._kept, tuple(timing))

    def _step_over(self, body: Body, step: StepReferences, t: float) -> None:
        """Anchor the odometry at the new foot once it carries half of the weight."""
        old, new = self._stance, step.stance
        if new != old and step.phase(t) >= 0.5 * step.transfer_time:
            body.update()
            anchor = self._biped.anchor
            anchor[new] = anchor[old] + body.foot(new) - body.foot(old)
            x, y, _ = anchor[new].tolist()
            anchor[new, 2], self._stance = step.foot_height(x, y), new


def motor_table(actuators: Actuators, period: float) -> Array:
    """Return the exact step (n, 2, 4) of B_s θ̈ + D_θ θ̇ + K θ = f, f linear over a period.

    Args:
        actuators: The motors.
        period: s.

    Returns:
        Rows θ and θ̇ after the period; columns θ, θ̇, f and ḟ before it.
    """
    from scipy.linalg import expm

    table = np.zeros((actuators.n, 2, 4))
    for j in range(actuators.n):
        A = np.zeros((4, 4))
        inertia = actuators.shaped_inertia[j]
        A[0, 1] = A[2, 3] = 1.0
        A[1, 0] = -actuators.spring_stiffness[j] / inertia
        A[1, 1] = -actuators.motor_damping[j] / inertia
        A[1, 2] = 1.0 / inertia
        table[j] = expm(A * period)[:2]
    return table
