"""What walks where, and how."""

from dataclasses import dataclass

from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground
from sealag.walking._options import WalkingOptions


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
