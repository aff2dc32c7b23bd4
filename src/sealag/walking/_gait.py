"""What a walk should look like, and the periodic motion of the pendulum that walks so."""

import math
from dataclasses import dataclass

from sealag.constants import GRAVITY
from sealag.errors import InputError
from sealag.walking._ranged import check_fields, ranged


@dataclass(frozen=True, slots=True, kw_only=True)
class PeriodicGait:
    """The periodic motion of the pendulum on flat ground that a gait asks for.

    During the weight transfer of duration d the centre of pressure moves linearly from foot to
    foot. With ω² = g/h, e = exp(ωT) and κ = e (1 − (1 − exp(−ωd))/(ωd)), the capture point
    ξ = x + ẋ/ω at the end of a step, from the foot stood on, is

        ξ_x = (v_a/ω) exp(ω(T−d)/2),   ξ_y = w (e−κ)/(e+1),   and   L = ξ_x (e−1)/(e−κ).

    Attributes:
        rate: ω, 1/s.
        growth: e.
        carried: κ, the part of it that the old foot still carries.
        end_forward: ξ_x, m.
        end_outward: ξ_y, m.
        step_length: L, m.
        apex_outward: Distance of the CoM from the stance foot across, at the apex, m.
    """

    rate: float
    growth: float
    carried: float
    end_forward: float
    end_outward: float
    step_length: float
    apex_outward: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkingGait:
    """The gait that the walk shall have. Assumptions of ours: the paper gives none of them.

    Attributes:
        apex_speed: Forward speed of the CoM over the stance foot, m/s.
        step_time: From touchdown to touchdown, s.
        transfer_time: Double support at the step's beginning in which the weight moves from the
            old to the new foot, s.
        com_height: CoM over the ground, mean of two footholds, m.
        step_width: Distance of successive footholds across the direction of walking, m.
        clearance: Height of the swing foot over the higher of the grounds below it, m.
        foot_radius: Height of the foot frame over the ground when standing, m.
        smallest_width: Footholds are never placed closer than this across, m.

    Raises:
        InputError: A value is outside its range, or the weight transfer fills the step.
    """

    apex_speed: float = ranged(0.5, 1e-4, 20.0, "m/s")
    step_time: float = ranged(0.35, 0.05, 10.0, "s")
    transfer_time: float = ranged(0.06, 1e-3, 6.0, "s")
    com_height: float = ranged(0.86, 0.05, 20.0, "m")
    step_width: float = ranged(0.26, 1e-3, 5.0, "m")
    clearance: float = ranged(0.08, 1e-4, 5.0, "m")
    foot_radius: float = ranged(0.025, 1e-6, 1.0, "m")
    smallest_width: float = ranged(0.12, 1e-6, 5.0, "m")

    def __post_init__(self) -> None:
        check_fields(self, "walking.gait")
        if self.transfer_time > 0.6 * self.step_time:
            raise InputError(
                f"The weight transfer of {self.transfer_time:g} s leaves too little of the step of "
                f"{self.step_time:g} s: at most 60 % is right."
            )

    def periodic(self) -> PeriodicGait:
        """Return the pendulum's periodic motion of this gait."""
        rate = math.sqrt(GRAVITY / self.com_height)
        growth = math.exp(rate * self.step_time)
        shift = rate * self.transfer_time
        carried = growth * (1.0 - (1.0 - math.exp(-shift)) / shift)
        swing = math.exp(0.5 * rate * (self.step_time - self.transfer_time))
        forward = self.apex_speed / rate * swing
        outward = self.step_width * (growth - carried) / (growth + 1.0)
        return PeriodicGait(
            rate=rate,
            growth=growth,
            carried=carried,
            end_forward=forward,
            end_outward=outward,
            step_length=forward * (growth - 1.0) / (growth - carried),
            apex_outward=outward / swing,
        )
