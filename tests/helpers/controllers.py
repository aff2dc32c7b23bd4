"""Small controllers for simulator tests."""

import numpy as np


class Constant:
    """Commands a constant torque."""

    def __init__(self, torque):
        self.torque = np.asarray(torque, dtype=float)

    def reset(self, t, measurement):
        """Nothing to forget."""

    def tick(self, t, measurement, out):
        """Write the torque."""
        out[:] = self.torque


class JointPD:
    """tau = K (q_d - q) - D q̇ + offset on link positions, or on motor angles, with V_3."""

    def __init__(self, target, *, stiffness, damping=0.0, offset=0.0, motor=False):
        self.target, self.stiffness, self.damping = target, stiffness, damping
        self.offset, self.motor = offset, motor

    def reset(self, t, measurement):
        """Nothing to forget."""

    def tick(self, t, measurement, out):
        """Write the command."""
        place = measurement.theta if self.motor else measurement.q_joint
        rate = measurement.theta_dot if self.motor else measurement.v_joint
        out[:] = self.stiffness * (self.target - place) - self.damping * rate + self.offset


class StoringPD(JointPD):
    """Motor-side stiffness whose potential is known."""

    def storage(self, t, measurement, command):
        """Return V_3 and write the undelayed command."""
        self.tick(t, measurement, command)
        away = measurement.theta - self.target
        return float(0.5 * away @ (self.stiffness * away))
