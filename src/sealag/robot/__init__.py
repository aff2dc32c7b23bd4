"""Robots from URDF: configurations, dynamics, frames and contacts. The only room with Pinocchio."""

from sealag.robot._contact import Contact, ContactKind, Motion
from sealag.robot._limits import UNIT_TOLERANCE, require_within_limits
from sealag.robot._load import resolve_urdf
from sealag.robot._load_robot import load_robot
from sealag.robot._reference import ReferencePosture, reference_posture
from sealag.robot._robot import Robot
from sealag.robot._workspace import Workspace

__all__ = [
    "UNIT_TOLERANCE",
    "Contact",
    "ContactKind",
    "Motion",
    "ReferencePosture",
    "Robot",
    "Workspace",
    "load_robot",
    "reference_posture",
    "require_within_limits",
    "resolve_urdf",
]
