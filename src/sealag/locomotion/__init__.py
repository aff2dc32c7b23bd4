"""Walking over rough terrain: ground, phase-space plan, whole-body motion."""

from sealag.locomotion._planner import Stance, WalkPlan, plan_walk
from sealag.locomotion._terrain import (
    FlatTerrain,
    ProfileTerrain,
    Terrain,
    paper_terrain,
    rough_terrain,
    stairs,
)
from sealag.locomotion._walk_motion import walk_motion

__all__ = [
    "FlatTerrain",
    "ProfileTerrain",
    "Stance",
    "Terrain",
    "WalkPlan",
    "paper_terrain",
    "plan_walk",
    "rough_terrain",
    "stairs",
    "walk_motion",
]
