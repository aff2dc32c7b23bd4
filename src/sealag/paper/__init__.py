"""The paper's figures and statements, computed here and checked one by one."""

from sealag.paper._ablation import (
    PUBLISHED_LAW,
    AblationTable,
    ablation_cases,
    ablation_table,
    gait_cases,
)
from sealag.paper._beyond import HELD_OUT, DelayMap, beyond_cases, delay_map, walk_beyond
from sealag.paper._claims import Claim, Verdict
from sealag.paper._figure4 import (
    CertifiedVariant,
    Figure4,
    figure_4,
    figure_4_claims,
    simulated_motion,
)
from sealag.paper._figure5 import TorqueTrace, figure_5, figure_5_claims, measured_lag
from sealag.paper._random_table import (
    PlantComparison,
    RandomPlantTable,
    compare_plant,
    random_plant_table,
)
from sealag.paper._unsafe import UnsafeExample, delayed_margin, unsafe_examples
from sealag.paper._walk import Walk, WalkCase, measure_walk, simulate_walk
from sealag.paper._walk_errors import SensorNoise
from sealag.paper._walk_table import (
    WalkRow,
    gain_cases,
    robustness_cases,
    rough_terrains,
    walk_claim,
    walk_success,
)

__all__ = [
    "HELD_OUT",
    "PUBLISHED_LAW",
    "AblationTable",
    "CertifiedVariant",
    "Claim",
    "DelayMap",
    "Figure4",
    "PlantComparison",
    "RandomPlantTable",
    "SensorNoise",
    "TorqueTrace",
    "UnsafeExample",
    "Verdict",
    "Walk",
    "WalkCase",
    "WalkRow",
    "ablation_cases",
    "ablation_table",
    "beyond_cases",
    "compare_plant",
    "delay_map",
    "delayed_margin",
    "figure_4",
    "figure_4_claims",
    "figure_5",
    "figure_5_claims",
    "gain_cases",
    "gait_cases",
    "measure_walk",
    "measured_lag",
    "random_plant_table",
    "robustness_cases",
    "rough_terrains",
    "simulate_walk",
    "simulated_motion",
    "unsafe_examples",
    "walk_beyond",
    "walk_claim",
    "walk_success",
]
