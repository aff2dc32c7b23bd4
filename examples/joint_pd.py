"""Three delays of a joint-PD quadruped: Unitree Go2 on four feet, gains and drives as assumed here.

The controller is any object that ticks; `sealag.freeze` differentiates it as it runs. K_d computed
in the controller is late like K_p, and no passive bound exists; computed in the drives it has one.
"""

import numpy as np

import sealag

URDF = "example-robot-data:go2_description/urdf/go2.urdf"
STIFFNESS = 5000.0  # of gears and links, Nm/rad
robot = sealag.load_robot(URDF, floating_base=True)
feet = tuple(sealag.Contact(frame=f"{leg}_foot") for leg in ("FL", "FR", "RL", "RR"))
posture = robot.configuration(np.tile([0.0, 0.9, -1.8], 4))

# Feedforward: what the feet do not carry, shared with the least forces.
gravity, J_s = robot.gravity(posture), robot.contact_jacobian(feet, posture)
force = np.linalg.lstsq(J_s[:, :6].T, gravity[:6], rcond=None)[0]
feedforward = (gravity - J_s.T @ force)[6:]


class JointPD:
    """τ = K_p (θ_d − θ) − K_d θ̇ + τ_ff of the motors' encoders."""

    def __init__(self, K_p: float, K_d: float) -> None:
        self.K_p, self.K_d = K_p, K_d
        self.target = robot.joint_positions(posture) + feedforward / STIFFNESS

    def reset(self, t: float, measurement: sealag.Measurement) -> None:
        """Nothing to forget."""

    def tick(self, t: float, measurement: sealag.Measurement, out: np.ndarray) -> None:
        """Write the command."""
        away = self.target - measurement.theta
        out[:] = self.K_p * away - self.K_d * measurement.theta_dot + feedforward


print(" K_p   K_d  in       passive    jitter  constant")
for K_p, K_d in ((20.0, 0.5), (40.0, 1.0), (80.0, 5.0)):
    for place, late, in_drives in (("centre", K_d, 0.01), ("drives", 0.0, K_d)):
        motors = sealag.Actuators.of(
            robot.joints,
            spring_stiffness=STIFFNESS,
            rotor_inertia=0.01,
            inertia_shaping=1.0,
            motor_damping=in_drives,
        )
        loop = sealag.freeze(JointPD(K_p, late), robot, motors, contacts=feet, q=posture).loop
        passive = "     none" if late else f"{1e3 * in_drives / K_p:6.2f} ms"  # K_p d ≤ K_d
        jitter = loop.jitter_margin().delay
        constant = loop.margin().delay
        shown = f"{passive} {1e3 * jitter:6.2f} ms {1e3 * constant:6.2f} ms"
        print(f"{K_p:4.0f}  {K_d:4.1f}  {place:6} {shown}")
