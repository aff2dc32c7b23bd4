"""What the walking controller knows of the robot: body terms, odometry and prediction."""

import math

import numpy as np

from sealag.actuation import Actuators
from sealag.locomotion._walking_options import Prediction
from sealag.locomotion._walking_step import StepReferences
from sealag.robot import Robot
from sealag.typing import Array

_RING = 512


class Body:
    """Terms of the robot at one configuration and velocity.

    Args:
        robot: The robot.
        feet: Frames of the left and the right foot.
    """

    def __init__(self, robot: Robot, feet: tuple[str, str]) -> None:
        nv = robot.nv
        self._workspace, self._feet = robot.workspace(), feet
        self.q, self.v = np.zeros(robot.nq), np.zeros(nv)
        self.J, self.b = np.zeros((2, 3, nv)), np.zeros((2, 3))
        self.feet, self.feet_rate = np.zeros((2, 3)), np.zeros((2, 3))
        self.M, self.h, self.R = np.zeros((nv, nv)), np.zeros(nv), np.zeros((3, 3))
        self.com, self.com_rate, self.com_bias = np.zeros(3), np.zeros(3), np.zeros(3)
        self.com_jacobian, self.angular = np.zeros((3, nv)), np.zeros(3)

    def update(self, q: Array, v: Array) -> None:
        """Evaluate everything.

        Args:
            q: Configuration (nq,).
            v: Velocity (nv,).
        """
        at = self._workspace
        self.q[:], self.v[:] = q, v
        at.update(self.q, self.v)
        self.M[:], self.h[:] = at.M, at.nle
        for i, foot in enumerate(self._feet):
            self.J[i] = at.frame_jacobian(foot)[:3]
            self.b[i] = at.frame_bias(foot)[:3]
            self.feet[i] = at.frame_placement(foot)[1]
            self.feet_rate[i] = self.J[i] @ self.v
        self.com[:], self.com_rate[:] = at.com, at.com_velocity
        self.com_jacobian[:] = at.com_jacobian()
        self.com_bias[:] = at.com_bias()
        self.angular[:] = (at.centroidal_map() @ self.v)[3:]
        _rotation(self.q[3:7], self.R)

    def forget_velocity(self) -> None:
        """Leave gravity alone of the velocity-dependent terms."""
        self.h[:] = self._workspace.gravity()
        self.b[:], self.com_bias[:] = 0.0, 0.0


def _rotation(quaternion: Array, out: Array) -> None:
    x, y, z, w = quaternion.tolist()
    out[0] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    out[1] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    out[2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)


class Odometry:
    """Base position and velocity from the stance leg, the joint encoders and the IMU.

    Args:
        feet: Where both feet stand at the start (2, 3), m.
        stance: Foot stood on at the start.
    """

    def __init__(self, feet: Array, stance: int) -> None:
        self._anchor, self._stance = feet.copy(), stance

    def correct(self, q: Array, v: Array, at: Body, step: StepReferences, *, t: float) -> None:
        """Replace base position and linear velocity in ``q`` and ``v``.

        Args:
            q: Measured configuration (nq,); its position is replaced.
            v: Measured velocity (nv,); its linear velocity is replaced.
            at: The robot's terms at ``q``, ``v``.
            step: The step's references.
            t: Instant of the measurement, s.
        """
        foot = self._stance
        shift = self._anchor[foot] - at.feet[foot]
        if step.stance != foot and step.phase(t) >= 0.5 * step.transfer_time:
            self._stance = foot = step.stance
            self._anchor[foot] = at.feet[foot] + shift
            x, y, _ = self._anchor[foot].tolist()
            self._anchor[foot, 2] = step.ground(x, y)
            shift = self._anchor[foot] - at.feet[foot]
        q[:3] += shift
        v[:3] -= at.R.T @ at.feet_rate[foot]


class Predictor:
    """Predicts the state at the instant at which the next command will act.

    Args:
        robot: The robot.
        actuators: Springs and motors as the controller believes them to be.
        period: Of the controller, s.
        prediction: By which means.
    """

    def __init__(
        self, robot: Robot, actuators: Actuators, *, period: float, prediction: Prediction
    ) -> None:
        from sealag.kernels import rigid, walking

        self._kernel, self._integrate = walking, rigid.integrate
        self._period, self._prediction = period, prediction
        self._base = robot.nv_base
        self._K = np.ascontiguousarray(actuators.spring_stiffness)
        self._table = motor_table(actuators, period)
        self._arrival, self._command = np.full(_RING, -np.inf), np.zeros((_RING, robot.n))
        self._newest, self._any = 0, False
        self._motor = np.zeros((robot.n, 2))
        self._displacement = np.zeros(robot.nv)
        self.tau_sea = np.zeros(robot.n)

    def sent(self, command: Array, arrival: float) -> None:
        """Remember a command.

        Args:
            command: (n,) Nm.
            arrival: When it will reach the motors, s.
        """
        self._newest = (self._newest + 1) % _RING
        self._command[self._newest], self._arrival[self._newest] = command, arrival
        if not self._any:
            self._command[:], self._any = command, True

    def move(
        self, q: Array, v: Array, at: Body, step: StepReferences, *,
        theta: Array, theta_dot: Array, measured: float, now: float,
    ) -> None:  # fmt: skip
        """Move ``q`` and ``v`` in place from the measurement's instant to ``now``.

        Args:
            q: Configuration (nq,).
            v: Velocity (nv,).
            at: The robot's terms at that state.
            step: The step's references.
            theta: Motor angles (n,), rad.
            theta_dot: Motor speeds (n,), rad/s.
            measured: Instant of the measurement, s.
            now: Instant to predict, s.
        """
        n = theta.size
        ticks = round((now - measured) / self._period)
        self._motor[:, 0], self._motor[:, 1] = theta, theta_dot
        joints = q[-n:].copy()
        moved = self._displacement
        moved[:] = 0.0
        if self._prediction == Prediction.VELOCITY:
            moved[:] = v * (now - measured)
        elif self._prediction == Prediction.MODEL and ticks > 0 and self._any:
            order = np.array([1 - step.stance, step.stance])
            moved[:] = self._kernel.predict(
                at.M, at.h, at.J[order], at.b[order], joints, v, self._motor, self._K,
                self._table, measured, self._period, ticks, self._arrival, self._command,
                self._newest, step.begin, step.begin + step.transfer_time,
            )  # fmt: skip
        self.tau_sea[:] = self._K * (self._motor[:, 0] - joints - moved[-n:])
        self._integrate(q.copy(), moved, self._base, q)


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


def tilt(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw (rad) of a rotation matrix (3, 3), R = Rz Ry Rx."""
    pitch = math.asin(min(1.0, max(-1.0, -float(R[2, 0]))))
    return (
        math.atan2(float(R[2, 1]), float(R[2, 2])),
        pitch,
        math.atan2(float(R[1, 0]), float(R[0, 0])),
    )
