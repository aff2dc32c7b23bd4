"""The delayed robot, simulated: plant, contact, links, closed loop and energy audit."""

from sealag.simulation._gait import MeasuredGait
from sealag.simulation._ground import Foot
from sealag.simulation._loop import closed_loop
from sealag.simulation._network import Clock, Network
from sealag.simulation._outcome import Outcome
from sealag.simulation._run import Run
from sealag.simulation._scene import Push, Scene

__all__ = [
    "Clock",
    "Foot",
    "MeasuredGait",
    "Network",
    "Outcome",
    "Push",
    "Run",
    "Scene",
    "closed_loop",
]
