"""Walking over rough terrain: ground, phase-space plan, whole-body motion."""

from sealag.walking._planner import Stance, WalkPlan, plan_walk
from sealag.walking._terrain import (
    FlatTerrain,
    ProfileTerrain,
    Terrain,
    paper_terrain,
    rough_terrain,
    stairs,
)
from sealag.walking._walk_motion import walk_motion
from sealag.walking._walking import WalkingController, begin_walk
from sealag.walking._walking_options import Prediction, WalkingGait, WalkingOptions
from sealag.walking._walking_placement import PeriodicGait, periodic_gait
from sealag.walking._walking_start import walking_start

__all__ = [
    "FlatTerrain",
    "PeriodicGait",
    "Prediction",
    "ProfileTerrain",
    "Stance",
    "Terrain",
    "WalkPlan",
    "WalkingController",
    "WalkingGait",
    "WalkingOptions",
    "begin_walk",
    "paper_terrain",
    "periodic_gait",
    "plan_walk",
    "rough_terrain",
    "stairs",
    "walk_motion",
    "walking_start",
]
