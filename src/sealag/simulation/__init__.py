"""The delayed robot, simulated: plant, contact, links, closed loop and energy audit."""

from sealag.simulation._audit import Audit, Passivity
from sealag.simulation._delay_store import delay_store
from sealag.simulation._exchange import Ages, Exchanges
from sealag.simulation._gait import MeasuredGait, measure_gait
from sealag.simulation._ground import Foot
from sealag.simulation._hold import Hold, require_hold, static_hold, touching_posture
from sealag.simulation._loop import closed_loop
from sealag.simulation._network import Clock, Network
from sealag.simulation._outcome import EventKind, Outcome, PlantStop
from sealag.simulation._plant import ContactEvent, Plant, fastest_link
from sealag.simulation._run import Run
from sealag.simulation._scene import FallLimits, Push, Scene

__all__ = [
    "Ages",
    "Audit",
    "Clock",
    "ContactEvent",
    "EventKind",
    "Exchanges",
    "FallLimits",
    "Foot",
    "Hold",
    "MeasuredGait",
    "Network",
    "Outcome",
    "Passivity",
    "Plant",
    "PlantStop",
    "Push",
    "Run",
    "Scene",
    "closed_loop",
    "delay_store",
    "fastest_link",
    "measure_gait",
    "require_hold",
    "static_hold",
    "touching_posture",
]
