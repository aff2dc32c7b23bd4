"""The user's project file, motions in and out, and the certificate of a design."""

from typing import TYPE_CHECKING, Any

from sealag.design._certify import certify
from sealag.design._project import load
from sealag.design._recheck import verify_design
from sealag.design._starter import starter_project
from sealag.design._system import System

if TYPE_CHECKING:
    from sealag.design._simulate import simulate

__all__ = [
    "System",
    "certify",
    "load",
    "simulate",
    "starter_project",
    "verify_design",
]


def __getattr__(name: str) -> Any:
    """Load the simulator when it is asked for: a certificate needs none of it."""
    if name == "simulate":
        from sealag.design._simulate import simulate

        return simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
