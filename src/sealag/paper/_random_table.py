"""A thousand random plants: how often each criterion allows what is unstable."""

from dataclasses import dataclass

import numpy as np

from sealag.errors import SolverError
from sealag.margin import delay_margin, random_sea_plant
from sealag.passivity import max_delay, max_delay_from_stiffness
from sealag.whole_body import StiffnessForm


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomPlantTable:
    """Bounds against exact margins on random series elastic plants.

    Attributes:
        plants: number of plants.
        undecided: for how many the exact margin could not be decided; they count for neither.
        published_longer: for how many (29) allows a delay at which the plant is unstable.
        published_without_delay: how many of those are unstable without any delay.
        certified_spoke: for how many the certified criterion gave a bound and the potential has
            a minimum.
        certified_longer: for how many of those the bound exceeds the exact margin.
        smallest_ratio: smallest exact margin over certified bound.
        median_ratio: its median.
    """

    plants: int
    undecided: int
    published_longer: int
    published_without_delay: int
    certified_spoke: int
    certified_longer: int
    smallest_ratio: float
    median_ratio: float


def random_plant_table(count: int = 1000, *, seed: int = 0) -> RandomPlantTable:
    """Compare both criteria with the exact margin on random plants.

    Plants whose springs and gravity have no stable equilibrium whatever the criterion says are
    counted for neither, because passivity does not promise stability there.

    Args:
        count: number of plants.
        seed: of the first; the others follow.
    """
    longer = still = spoke = wrong = undecided = 0
    ratios = []
    for index in range(seed, seed + count):
        plant = random_sea_plant(index)
        try:
            margin = delay_margin(plant.A_0, plant.A_1, symmetries=plant.symmetries).delay
        except SolverError:
            undecided += 1
            continue
        force = plant.form is StiffnessForm.FORCE
        published = max_delay(
            plant.J,
            plant.Lambda,
            plant.K_x,
            plant.D_theta,
            form=StiffnessForm.FORCE if force else StiffnessForm.PUBLISHED,
        )
        anchored = bool(np.linalg.eigvalsh(plant.G)[0] >= 0.0)
        if anchored and float(published.delay) > margin:
            longer += 1
            still += margin == 0.0
        if plant.certifiable and plant.stable:
            bound = float(max_delay_from_stiffness(plant.F, plant.D_theta).delay)
            spoke += 1
            wrong += bound > margin
            if np.isfinite(margin):
                ratios.append(margin / bound)
    return RandomPlantTable(
        plants=count,
        undecided=undecided,
        published_longer=longer,
        published_without_delay=int(still),
        certified_spoke=spoke,
        certified_longer=int(wrong),
        smallest_ratio=float(np.min(ratios)),
        median_ratio=float(np.median(ratios)),
    )
