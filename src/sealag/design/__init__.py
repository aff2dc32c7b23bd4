"""The user's project file, motions in and out, and the certificate of a design."""

from sealag.design._certify import certify
from sealag.design._project import load
from sealag.design._recheck import verify_design
from sealag.design._simulate import simulate
from sealag.design._starter import starter_project
from sealag.design._system import System

__all__ = [
    "System",
    "certify",
    "load",
    "simulate",
    "starter_project",
    "verify_design",
]
