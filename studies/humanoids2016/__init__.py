"""The paper's figures and statements, computed with sealag and checked one by one."""

from humanoids2016._ablation import (
    PUBLISHED_LAW,
    AblationTable,
    ablation_cases,
    ablation_table,
    gait_cases,
)
from humanoids2016._beyond import HELD_OUT, DelayMap, beyond_cases, delay_map, drive_cases
from humanoids2016._central_damping import SplitDamping, split_claim, split_damping
from humanoids2016._claims import Claim, Verdict
from humanoids2016._concordance import ROWS
from humanoids2016._figure4 import (
    CertifiedVariant,
    Figure4,
    figure_4,
    figure_4_claims,
    simulated_motion,
)
from humanoids2016._figure5 import TorqueTrace, figure_5, figure_5_claims, measured_lag
from humanoids2016._findings import QUICK, Findings, StudySize
from humanoids2016._leg_loop import Fed, Leg, LegRun, Push, TankSetting, run_leg
from humanoids2016._levels import LevelTable, level_claim, level_table
from humanoids2016._live import LiveLeg, live_leg
from humanoids2016._one_joint import OneJointGrid, one_joint_claim, one_joint_grids
from humanoids2016._paper_page import write_paper_page
from humanoids2016._ports import PortRow, TankRow, port_claims, port_table, stance_legs, tank_table
from humanoids2016._printed_task import printed_rows
from humanoids2016._progress import Progress, waits_for
from humanoids2016._random_plants import SeaPlant, random_sea_plant
from humanoids2016._random_table import (
    PlantComparison,
    RandomPlantTable,
    compare_plant,
    random_plant_table,
)
from humanoids2016._rotors import CoupledRotors, RotorRow, RotorTable, rotor_table
from humanoids2016._slow_model import SlowModel, held_legs, slow_models
from humanoids2016._study import planned_walk, reproduce, study
from humanoids2016._task_terms import ReferenceRow, TaskTerms, reference_rows, task_terms
from humanoids2016._torque_rate import TorqueRateRow, torque_rate_rows
from humanoids2016._tuned_walk import TunedWalk, tuned_claim, tuned_walk
from humanoids2016._unsafe import UnsafeExample, delayed_margin, unsafe_examples
from humanoids2016._walk import Walk, WalkCase, at_delay_scale, simulate_walk, walking_of
from humanoids2016._walk_errors import NoisySensors, SensorNoise, wrong_robot, wrong_springs
from humanoids2016._walk_table import (
    WalkRow,
    gain_cases,
    robustness_cases,
    rough_grounds,
    walk_claim,
    walk_success,
)

__all__ = [
    "HELD_OUT",
    "PUBLISHED_LAW",
    "QUICK",
    "ROWS",
    "AblationTable",
    "CertifiedVariant",
    "Claim",
    "CoupledRotors",
    "DelayMap",
    "Fed",
    "Figure4",
    "Findings",
    "Leg",
    "LegRun",
    "LevelTable",
    "LiveLeg",
    "NoisySensors",
    "OneJointGrid",
    "PlantComparison",
    "PortRow",
    "Progress",
    "Push",
    "RandomPlantTable",
    "ReferenceRow",
    "RotorRow",
    "RotorTable",
    "SeaPlant",
    "SensorNoise",
    "SlowModel",
    "SplitDamping",
    "StudySize",
    "TankRow",
    "TankSetting",
    "TaskTerms",
    "TorqueRateRow",
    "TorqueTrace",
    "TunedWalk",
    "UnsafeExample",
    "Verdict",
    "Walk",
    "WalkCase",
    "WalkRow",
    "ablation_cases",
    "ablation_table",
    "at_delay_scale",
    "beyond_cases",
    "compare_plant",
    "delay_map",
    "delayed_margin",
    "drive_cases",
    "figure_4",
    "figure_4_claims",
    "figure_5",
    "figure_5_claims",
    "gain_cases",
    "gait_cases",
    "held_legs",
    "level_claim",
    "level_table",
    "live_leg",
    "measured_lag",
    "one_joint_claim",
    "one_joint_grids",
    "planned_walk",
    "port_claims",
    "port_table",
    "printed_rows",
    "random_plant_table",
    "random_sea_plant",
    "reference_rows",
    "reproduce",
    "robustness_cases",
    "rotor_table",
    "rough_grounds",
    "run_leg",
    "simulate_walk",
    "simulated_motion",
    "slow_models",
    "split_claim",
    "split_damping",
    "stance_legs",
    "study",
    "tank_table",
    "task_terms",
    "torque_rate_rows",
    "tuned_claim",
    "tuned_walk",
    "unsafe_examples",
    "waits_for",
    "walk_claim",
    "walk_success",
    "walking_of",
    "write_paper_page",
    "wrong_robot",
    "wrong_springs",
]
