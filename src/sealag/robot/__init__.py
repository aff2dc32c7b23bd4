"""Robots from URDF: configurations, dynamics, frames and contacts. The only room with Pinocchio."""

from sealag.robot._contact import Contact, ContactKind, Motion
from sealag.robot._load_robot import load_robot
from sealag.robot._robot import Robot
from sealag.robot._workspace import Workspace

__all__ = [
    "Contact",
    "ContactKind",
    "Motion",
    "Robot",
    "Workspace",
    "load_robot",
]
