"""The user's project file, motions in and out, and the certificate of a design."""

from sealag.design._along import Along
from sealag.design._certify import certify, check_question
from sealag.design._criteria import certified_bounds
from sealag.design._local import local_of, margin_of
from sealag.design._margins import local_margins
from sealag.design._motion_file import load_motion, save_motion
from sealag.design._project import load, parse_project, resolve_project
from sealag.design._rates import rate_sweep
from sealag.design._recheck import verify_design
from sealag.design._simulate import scenario_duration, simulate
from sealag.design._starter import starter_project
from sealag.design._system import System

__all__ = [
    "Along",
    "System",
    "certified_bounds",
    "certify",
    "check_question",
    "load",
    "load_motion",
    "local_margins",
    "local_of",
    "margin_of",
    "parse_project",
    "rate_sweep",
    "resolve_project",
    "save_motion",
    "scenario_duration",
    "simulate",
    "starter_project",
    "verify_design",
]
