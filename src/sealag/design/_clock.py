"""Periods of a design's runs, and a physics step fine enough for its springs."""

import math

from sealag.design._design import Design
from sealag.errors import InputError
from sealag.simulation import Clock

LONGEST_STEP = 1e-3
"""Longest physics step, s."""
SHORTEST_STEP = 1e-5
"""Shortest physics step that is chosen where the project states none, s."""
STEPS_PER_SWING = 8
"""Least number of physics steps in a period of the fastest spring."""
FINER = 4
"""How many times finer a step may become to divide the delays."""


def clock_of(system: Design) -> Clock:
    """Return the design's own periods, and physics fine enough for springs and dampers.

    Where a step not much finer divides the constant delays too, no step has to be split for them.
    """
    delays = system.delays.sampled()
    central, embedded = delays.sample_time, delays.embedded_period
    if system.simulation.physics_step_ms is not None:
        step = system.simulation.physics_step_ms * 1e-3
        return Clock(physics=step, embedded=embedded, central=central)
    if embedded and abs(central / embedded - round(central / embedded)) > 1e-9:
        raise InputError(
            f"The central period of {central * 1e3:g} ms (delays.sample_time_ms) is no whole "
            f"multiple of the embedded one of {embedded * 1e3:g} ms (delays.embedded_period_ms), "
            "as a run needs it; change one of them."
        )
    rate, _ = system.actuators.fastest_link(system.robot, system.posture)
    longest = max(SHORTEST_STEP, 2.0 * math.pi / (STEPS_PER_SWING * rate))
    whole = embedded or central
    coarsest = math.ceil(whole / min(LONGEST_STEP, longest) - 1e-9)
    links = (delays.central.up, delays.central.down, delays.embedded.down)
    constant = [link.delay.upper_bound for link in links if link.constant]
    for count in range(coarsest, FINER * coarsest + 1):
        parts = [delay * count / whole for delay in constant]
        if all(abs(part - round(part)) < 1e-9 * max(1.0, part) for part in parts):
            return Clock(physics=whole / count, embedded=embedded, central=central)
    return Clock(physics=whole / coarsest, embedded=embedded, central=central)
