"""sealag: how much network delay a robot with springs in its joints tolerates.

Importing this package is cheap: names below are loaded when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "load": "sealag.design",
    "certify": "sealag.design",
    "simulate": "sealag.design",
    "Controller": "sealag.whole_body",
    "SealagError": "sealag.errors",
}

__all__ = ["Controller", "SealagError", "__version__", "certify", "load", "simulate"]

if TYPE_CHECKING:
    from sealag.design import certify, load, simulate
    from sealag.errors import SealagError
    from sealag.whole_body import Controller


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'sealag' has no attribute {name!r}")
