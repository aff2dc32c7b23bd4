"""The means by which the walking controller works against the delay, and its gains."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self

from sealag.walking._ranged import check_fields, ranged


class Prediction(StrEnum):
    """How the state is predicted over the delay."""

    NONE = "none"
    """The delayed state is taken for the present one."""
    VELOCITY = "velocity"
    """The measured velocity is extrapolated."""
    MODEL = "model"
    """Links, springs and motors are moved under the commands still in flight."""


class JointAngles(StrEnum):
    """What the walking law takes for the joint positions."""

    JOINT = "joint"
    """Link angles, measured."""
    MOTOR = "motor"
    """Motor angles."""
    STATIC_JOINT = "static_joint"
    """Motor angles less what the last task torque winds the springs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkingOptions:
    """Means and gains of the walking controller; each means can be left out.

    Attributes:
        preview: Work ahead of the delay: the references are those of the instant at which the
            command will reach the motors.
        embedded_delay: What the command's way lasts longer than the measurement's, s: half the
            mean T_L of the paper, 1.5 ms, and one period of hold. The measurement's age is known;
            the command's way is taken as that age and this.
        prediction: How the state at that instant is predicted.
        acceleration_feedforward: The tasks' planned accelerations enter the law.
        velocity_feedforward: The embedded damping acts on θ̇ − q̇_d, not on θ̇: D_θ q̇_d is added
            to the command, with q̇_d the joint rates of the planned task velocities.
        position_rate: Planned swing-foot velocities return position errors at this rate, 1/s.
        lead: The springs' own motion is fed forward too: (D_θ/K) dτ/dt, the other half of the
            planned motor velocity q̇_d + K⁻¹ τ̇.
        lead_time: Time constant of the derivative of the lead, s.
        torque_feedback: Gain on the difference of task torque and predicted spring torque.
        task_damping: Damping ratio of the task-space feedback on predicted velocities.
        height_stiffness: K_x of the CoM height, 1/s².
        posture_stiffness: K_x of torso roll and pitch, 1/s².
        swing_stiffness: K_x of the swing foot, 1/s².
        heading_stiffness: Of the heading, forward, in double support, where two feet can push as a
            couple, 1/s²; 0 leaves the yaw free, as a single point foot does.
        momentum_placement: The footstep is placed by the angular momentum about the stance foot
            (legs included), not by the CoM velocity.
        bias_gain: Share of a step's error of apex speed that is corrected in the next, against
            constant errors as an IMU's tilt; 0 also leaves out the legs' momentum known at the
            start.
        placement_time: Time constant over which the predicted end of the step is averaged, s.
        placement_freeze: The foothold is fixed this long before touchdown, s.
        early_contact: A foot seen on the ground late in its swing begins the next step.
        odometry: The base's position and velocity come from the stance leg, the joint encoders
            and the IMU; the measured ones are not used.
        feedback: What the published law takes for the joint positions: link side, motor side, or
            q̄(θ) by one fixed-point iteration of Eq. (15) per tick.

    Raises:
        InputError: A number is outside its range.
    """

    preview: bool = True
    embedded_delay: float = ranged(0.0025, 0.0, 1.0, "s")
    prediction: Prediction = Prediction.MODEL
    acceleration_feedforward: bool = True
    velocity_feedforward: bool = True
    position_rate: float = ranged(10.0, 0.0, 1e4, "1/s")
    lead: bool = True
    lead_time: float = ranged(0.005, 1e-6, 10.0, "s")
    torque_feedback: float = ranged(1.0, 0.0, 1e3)
    task_damping: float = ranged(0.5, 0.0, 1e3)
    height_stiffness: float = ranged(100.0, 0.0, 1e6, "1/s²")
    posture_stiffness: float = ranged(100.0, 0.0, 1e6, "1/s²")
    swing_stiffness: float = ranged(400.0, 0.0, 1e6, "1/s²")
    heading_stiffness: float = ranged(10.0, 0.0, 1e6, "1/s²")
    momentum_placement: bool = True
    bias_gain: float = ranged(0.3, 0.0, 10.0)
    placement_time: float = ranged(0.05, 0.0, 10.0, "s")
    placement_freeze: float = ranged(0.03, 0.0, 10.0, "s")
    early_contact: bool = True
    odometry: bool = True
    feedback: JointAngles = JointAngles.JOINT

    def __post_init__(self) -> None:
        check_fields(self, "walking.options")

    def published(self, **changes: Any) -> Self:
        """Return the law of Eqs. (11) and (17) with plain D_θ θ̇: position feedback and gravity.

        Footsteps and the order of the steps are planned as before.

        Args:
            changes: Options to set otherwise.
        """
        options: dict[str, Any] = {
            "preview": False,
            "prediction": Prediction.NONE,
            "acceleration_feedforward": False,
            "velocity_feedforward": False,
            "lead": False,
            "torque_feedback": 0.0,
            "task_damping": 0.0,
            "heading_stiffness": 0.0,
            "feedback": JointAngles.STATIC_JOINT,
        }
        return replace(self, **{**options, **changes})
