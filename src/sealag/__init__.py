"""sealag: how much network delay a robot with springs in its joints tolerates.

Importing this package is cheap: names below are loaded when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from sealag.version import __version__

_HOME = {
    "System": "sealag.design",
    "certify": "sealag.design",
    "load": "sealag.design",
    "simulate": "sealag.design",
    "verify_design": "sealag.design",
    "Controller": "sealag.whole_body",
    "freeze": "sealag.whole_body",
    "Law": "sealag.whole_body",
    "LinkAngles": "sealag.whole_body",
    "Measurement": "sealag.whole_body",
    "MotorAngles": "sealag.whole_body",
    "StaticJoint": "sealag.whole_body",
    "Tank": "sealag.whole_body",
    "Task": "sealag.whole_body",
    "Contact": "sealag.robot",
    "Motion": "sealag.robot",
    "load_robot": "sealag.robot",
    "Actuators": "sealag.actuation",
    "Certificate": "sealag.passivity",
    "Link": "sealag.delay",
    "RoundTrip": "sealag.delay",
    "Constant": "sealag.delay",
    "Delays": "sealag.delay",
    "Sinusoid": "sealag.delay",
    "SealagError": "sealag.errors",
}

_ROOMS = (
    "actuation", "delay", "design", "errors", "export", "margin", "passivity", "report", "robot",
    "simulation", "sweep", "tune", "walking", "whole_body",
)  # fmt: skip

__all__ = [
    "Actuators",
    "Certificate",
    "Constant",
    "Contact",
    "Controller",
    "Delays",
    "Law",
    "Link",
    "LinkAngles",
    "Measurement",
    "Motion",
    "MotorAngles",
    "RoundTrip",
    "SealagError",
    "Sinusoid",
    "StaticJoint",
    "System",
    "Tank",
    "Task",
    "__version__",
    "certify",
    "freeze",
    "load",
    "load_robot",
    "simulate",
    "verify_design",
]

if TYPE_CHECKING:
    from sealag.actuation import Actuators
    from sealag.delay import Constant, Delays, Link, RoundTrip, Sinusoid
    from sealag.design import System, certify, load, simulate, verify_design
    from sealag.errors import SealagError
    from sealag.passivity import Certificate
    from sealag.robot import Contact, Motion, load_robot
    from sealag.whole_body import (
        Controller,
        Law,
        LinkAngles,
        Measurement,
        MotorAngles,
        StaticJoint,
        Tank,
        Task,
        freeze,
    )


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name in _ROOMS:
        return import_module(f"sealag.{name}")
    raise AttributeError(f"module 'sealag' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_ROOMS})
