"""A thousand random plants: how often each criterion allows what is unstable."""

from dataclasses import dataclass

import numpy as np

from humanoids2016._random_plants import SeaPlant, random_sea_plant
from sealag.errors import SolverError
from sealag.margin import DelayedLoop
from sealag.passivity import Instant, Problem, max_delay, solve


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantComparison:
    """One random plant with its exact margin and both bounds.

    Attributes:
        plant: the plant.
        margin_s: exact delay margin, s; None if it could not be decided.
        published_s: bound of (29) as printed, with J* Λ K_x or, for force stiffness, K_x, s.
        certified_s: bound of the certified criterion, s; None where it refuses, or where the
            potential has no minimum.
    """

    plant: SeaPlant
    margin_s: float | None
    published_s: float
    certified_s: float | None

    @property
    def anchored(self) -> bool:
        """Whether gravity by itself lets the links stand: else no criterion promises anything."""
        return bool(np.linalg.eigvalsh(self.plant.G)[0] >= 0.0)

    @property
    def published_is_longer(self) -> bool:
        """Whether (29) allows a delay at which an anchored plant is unstable."""
        return self.anchored and self._exceeds(self.published_s)

    @property
    def certified_is_longer(self) -> bool:
        """Whether the certified criterion does."""
        return self.certified_s is not None and self._exceeds(self.certified_s)

    def _exceeds(self, delay: float) -> bool:
        return self.margin_s is not None and delay > self.margin_s


def compare_plant(seed: int, *, joints: int | None = None) -> PlantComparison:
    """Compare both criteria with the exact margin on one random plant.

    Args:
        seed: of the plant.
        joints: number of its joints, or None to draw it.

    Raises:
        InputError: fewer than one joint.
    """
    plant = random_sea_plant(seed, joints=joints)
    published = max_delay(plant.J, plant.Lambda, plant.K_x, plant.D_theta, form=plant.form.printed)
    certified = None
    if plant.certifiable and plant.stable:
        problem = Problem.of_stiffness(plant.F, plant.D_theta)
        certified = float(solve(problem, share=Instant()).delay)
    try:
        margin = DelayedLoop(plant.A_0, plant.A_1, symmetries=plant.symmetries).margin().delay
    except SolverError:
        margin = None
    return PlantComparison(
        plant=plant, margin_s=margin, published_s=float(published.delay), certified_s=certified
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomPlantTable:
    """Bounds against exact margins on random series elastic plants.

    Attributes:
        plants: number of plants.
        undecided: for how many the exact margin could not be decided; they count for neither.
        presupposed: for how many the paper's law is what runs: ΛK_x as printed, with motor angles
            or a q̄(θ) that exists, x̂ of the tank included.
        published_longer: for how many of these (29) allows a delay at which the plant is unstable.
        published_without_delay: how many of those are unstable without any delay.
        other_longer: the same as `published_longer` for all other plants: link angles fed back,
            other stiffness forms, no q̄(θ).
        certified_spoke: for how many the certified criterion gave a bound and the potential has
            a minimum.
        certified_longer: for how many of those the bound exceeds the exact margin.
        smallest_ratio: smallest exact margin over certified bound.
        median_ratio: its median.
    """

    plants: int
    undecided: int
    presupposed: int
    published_longer: int
    published_without_delay: int
    other_longer: int
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
    all_ = [compare_plant(index) for index in range(seed, seed + count)]
    known = [one for one in all_ if one.margin_s is not None]
    unsafe = [one for one in known if one.published_is_longer]
    longer = [one for one in unsafe if one.plant.presupposed]
    spoken = [
        (one.margin_s, one.certified_s)
        for one in all_
        if one.margin_s is not None and one.certified_s is not None
    ]
    ratios = [margin / bound for margin, bound in spoken if np.isfinite(margin)]
    return RandomPlantTable(
        plants=count,
        undecided=count - len(known),
        presupposed=sum(one.plant.presupposed for one in all_),
        published_longer=len(longer),
        published_without_delay=sum(one.margin_s == 0.0 for one in longer),
        other_longer=len(unsafe) - len(longer),
        certified_spoke=len(spoken),
        certified_longer=sum(one.certified_is_longer for one in known),
        smallest_ratio=float(np.min(ratios)),
        median_ratio=float(np.median(ratios)),
    )
