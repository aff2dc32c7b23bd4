"""Bounds and exact margins of random plants, side by side."""

from dataclasses import dataclass

from sealag.margin import SeaPlant, delay_margin, random_sea_plant
from sealag.passivity import max_delay, max_delay_from_stiffness


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One plant: exact margin, the published bound, and the certified one where it speaks."""

    plant: SeaPlant
    margin: float
    published: float
    certified: float | None


def compare(seed: int) -> Comparison:
    """Compute all three for the plant of a seed."""
    plant = random_sea_plant(seed)
    answer = delay_margin(plant.A_0, plant.A_1, symmetries=plant.symmetries)
    published = max_delay(plant.J, plant.Lambda, plant.K_x, plant.D_theta, form="published")
    certified = None
    if plant.certifiable and plant.stable:
        certified = float(max_delay_from_stiffness(plant.F, plant.D_theta).delay)
    return Comparison(
        plant=plant, margin=answer.delay, published=float(published.delay), certified=certified
    )
