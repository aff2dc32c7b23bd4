"""The paper's figures and statements, computed here and checked one by one."""

from sealag.paper._claims import Claim, Verdict
from sealag.paper._figure4 import CertifiedVariant, Figure4, figure_4, figure_4_claims
from sealag.paper._random_table import RandomPlantTable, random_plant_table
from sealag.paper._unsafe import UnsafeExample, sea_loop, unsafe_examples

__all__ = [
    "CertifiedVariant",
    "Claim",
    "Figure4",
    "RandomPlantTable",
    "UnsafeExample",
    "Verdict",
    "figure_4",
    "figure_4_claims",
    "random_plant_table",
    "sea_loop",
    "unsafe_examples",
]
