"""State estimation of the walking controller: body terms, leg odometry, prediction."""

import numpy as np

from sealag.actuation import Actuators
from sealag.robot import Robot
from sealag.typing import Array
from sealag.walking._feet import Side
from sealag.walking._options import Prediction
from sealag.walking._step import StepReferences

_RING = 512


class Body:
    """Configuration, velocity and terms of the robot as the controller believes them to be.

    Args:
        robot: The robot.
        feet: Frames of the left and the right foot.

    Attributes:
        q: Configuration (nq,).
        v: Velocity (nv,).
        tree: The robot, as kernels take it.
        terms: Its terms, as kernels take them.
        mounts: How the feet are fixed, as kernels take it.
        com: Position, velocity and acceleration at zero v̇ of the centre of mass (3, 3), live.
        angular: Angular momentum about the centre of mass (3,), live.
    """

    def __init__(self, robot: Robot, feet: tuple[str, str]) -> None:
        self._workspace, self._feet = robot.workspace(), feet
        at = self._workspace
        self.q, self.v = robot.neutral(), np.zeros(robot.nv)
        self.tree, self.terms, self.mounts = robot.tree, at.terms, robot.frame_mounts(feet)
        self.com, self.angular = self.terms[7], at.momentum[3:]

    def update(self) -> None:
        """Evaluate the terms at ``q`` and ``v``."""
        self._workspace.update(self.q, self.v)

    def gravity(self) -> Array:
        """Return the gravity torque (nv,)."""
        return self._workspace.gravity()

    def feet(self) -> Array:
        """Return the positions of both feet (2, 3), m."""
        return np.stack([self.foot(side) for side in Side])

    def foot(self, foot: int) -> Array:
        """Return a copy of a foot's position (3,), m."""
        return self._workspace.frame_placement(self._feet[foot])[1].copy()

    def foot_rate(self, foot: int) -> Array:
        """Return a foot's velocity (3,), m/s."""
        return self._workspace.frame_velocity(self._feet[foot])[:3]


class Estimator:
    """Estimates the state from a measurement, and predicts it to when the next command acts.

    The base's position and velocity follow from the foot stood on, the joint encoders and the IMU.

    Args:
        robot: The robot.
        actuators: Springs and motors as the controller believes them to be.
        period: Of the controller, s.
        prediction: By which means.
        odometry: Whether the measured place and velocity of the base are replaced.
    """

    def __init__(
        self, robot: Robot, actuators: Actuators, *, period: float, prediction: Prediction,
        odometry: bool,
    ) -> None:  # fmt: skip
        from sealag.kernels import walking_state

        self._kernel = walking_state
        self._period, self._prediction, self._odometry = period, prediction, odometry
        self._K = np.ascontiguousarray(actuators.spring_stiffness)
        self._table = motor_table(actuators, period)
        self._motor = np.zeros((robot.n, 2))
        self._anchor, self._stance = np.zeros((2, 3)), 0
        self._ring = np.full(_RING, -np.inf), np.zeros((_RING, robot.n))
        self._newest, self._any = 0, False
        self.tau_sea = np.zeros(robot.n)

    def reset(self, feet: Array, stance: int) -> None:
        """Begin with both feet at known positions, and no command in flight.

        Args:
            feet: Their positions (2, 3), m.
            stance: Foot stood on.
        """
        self._anchor[:], self._stance = feet, stance
        self._ring[0][:], self._newest, self._any = -np.inf, 0, False

    def sent(self, command: Array, arrival: float) -> None:
        """Add a command to those in flight.

        Args:
            command: (n,) Nm.
            arrival: When it will reach the motors, s.
        """
        self._newest = (self._newest + 1) % _RING
        arrivals, commands = self._ring
        commands[self._newest], arrivals[self._newest] = command, arrival
        if not self._any:
            commands[:], self._any = command, True

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
        self._motor[:, 0], self._motor[:, 1] = theta, theta_dot
        clock = measured, self._period, step.begin, step.begin + step.transfer_time
        self._kernel.foresee(
            body.tree, body.terms, body.mounts, body.q, body.v, self._motor, step.stance,
            self._stance if self._odometry else -1, self._anchor, self._K, self._table, clock,
            ticks, self._ring, self._newest, self.tau_sea,
        )  # fmt: skip

    def _step_over(self, body: Body, step: StepReferences, t: float) -> None:
        """Anchor the odometry at the new foot once it carries half of the weight."""
        old, new = self._stance, step.stance
        if new != old and step.phase(t) >= 0.5 * step.transfer_time:
            body.update()
            self._anchor[new] = self._anchor[old] + body.foot(new) - body.foot(old)
            x, y, _ = self._anchor[new].tolist()
            self._anchor[new, 2], self._stance = step.foot_height(x, y), new


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
