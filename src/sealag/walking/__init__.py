"""Walking: ground, phase-space plan and its whole-body motion, gait, placement, controller."""

from sealag.walking._gait import WalkingGait
from sealag.walking._ground import Ground, GroundProfile
from sealag.walking._options import WalkingOptions
from sealag.walking._planner import WalkPlan
from sealag.walking._walk import Walking

__all__ = [
    "Ground",
    "GroundProfile",
    "WalkPlan",
    "Walking",
    "WalkingGait",
    "WalkingOptions",
]
