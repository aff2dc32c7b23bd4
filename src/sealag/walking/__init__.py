"""Walking: ground, phase-space plan and its whole-body motion, gait, placement, controller."""

from sealag.walking._controller import WalkStart, begin_walk
from sealag.walking._feet import Side
from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground, GroundProfile
from sealag.walking._motion import walk_motion
from sealag.walking._options import Prediction, WalkingOptions
from sealag.walking._planner import plan_walk
from sealag.walking._walk import Walking

__all__ = [
    "Ground",
    "GroundProfile",
    "Prediction",
    "Side",
    "WalkStart",
    "Walking",
    "WalkingGait",
    "WalkingOptions",
    "begin_walk",
    "plan_walk",
    "walk_motion",
]
