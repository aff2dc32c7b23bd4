"""What walks where, and how; and the state in which it begins."""

from dataclasses import dataclass

from sealag.actuation import Actuators
from sealag.robot import Robot
from sealag.typing import Array
from sealag.walking._controller import WalkingController
from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground
from sealag.walking._options import WalkingOptions
from sealag.walking._start import walking_start


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkStart:
    """A walking controller and the state in which its walk begins.

    Attributes:
        controller: the controller.
        q: configuration (nq,).
        v: velocity (nv,).
        theta: motor angles (n,) whose springs carry the first task torque, rad.
        theta_dot: motor speeds (n,), those of the joints, rad/s.
    """

    controller: WalkingController
    q: Array
    v: Array
    theta: Array
    theta_dot: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Walking:
    """A walk to be taken: feet, ground, gait, and the controller's means.

    Attributes:
        feet: frames of the left and the right foot.
        steps: how many steps are asked for.
        friction: Coulomb coefficient of the feet.
        ground: the ground, as the controller knows it and as it is.
        gait: the plan.
        options: means and gains of the walking controller.
    """

    feet: tuple[str, str]
    steps: int
    friction: float
    ground: Ground
    gait: WalkingGait
    options: WalkingOptions

    @property
    def duration(self) -> float:
        """Time for the steps and half of the next, s."""
        return round((self.steps + 0.5) * self.gait.step_time, 3)

    def begin(self, robot: Robot, actuators: Actuators, *, period: float = 1e-3) -> WalkStart:
        """Return a walking controller and the state in which its walk begins, on the right foot.

        Args:
            robot: Biped with a floating base and six joints.
            actuators: Springs and motors as the controller believes them to be.
            period: Time between two ticks, s.

        Raises:
            InputError: The robot is not such a biped, or its legs cannot take the posture.
        """
        controller = WalkingController(
            robot, actuators, feet=self.feet, ground=self.ground, gait=self.gait,
            options=self.options, period=period,
        )  # fmt: skip
        q, v = walking_start(robot, feet=self.feet, ground=self.ground, gait=self.gait)
        return WalkStart(
            controller=controller,
            q=q,
            v=v,
            theta=controller.motor_start(q, v),
            theta_dot=robot.joint_velocities(v),
        )
