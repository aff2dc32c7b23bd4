"""The paper's figures and statements, computed here and checked one by one."""

from humanoids2016._ablation import (
    PUBLISHED_LAW,
    AblationTable,
    ablation_cases,
    ablation_table,
    gait_cases,
)
from humanoids2016._beyond import HELD_OUT, DelayMap, beyond_cases, delay_map, walk_beyond
from humanoids2016._bounds_page import beyond_section, figure_5_section, limits_section
from humanoids2016._claims import Claim, Verdict
from humanoids2016._figure4 import (
    CertifiedVariant,
    Figure4,
    figure_4,
    figure_4_claims,
    simulated_motion,
)
from humanoids2016._figure5 import TorqueTrace, figure_5, figure_5_claims, measured_lag
from humanoids2016._paper_page import write_paper_page
from humanoids2016._random_table import (
    PlantComparison,
    RandomPlantTable,
    compare_plant,
    random_plant_table,
)
from humanoids2016._study import reproduce
from humanoids2016._unsafe import UnsafeExample, delayed_margin, unsafe_examples
from humanoids2016._walk import Walk, WalkCase, measure_walk, simulate_walk
from humanoids2016._walk_errors import SensorNoise
from humanoids2016._walk_page import energy_section, means_section, walk_section
from humanoids2016._walk_table import (
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
    "beyond_section",
    "compare_plant",
    "delay_map",
    "delayed_margin",
    "energy_section",
    "figure_4",
    "figure_4_claims",
    "figure_5",
    "figure_5_claims",
    "figure_5_section",
    "gain_cases",
    "gait_cases",
    "limits_section",
    "means_section",
    "measure_walk",
    "measured_lag",
    "random_plant_table",
    "reproduce",
    "robustness_cases",
    "rough_terrains",
    "simulate_walk",
    "simulated_motion",
    "unsafe_examples",
    "walk_beyond",
    "walk_claim",
    "walk_section",
    "walk_success",
    "write_paper_page",
]
