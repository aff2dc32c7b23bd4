"""`sealag.simulate`: a design, or its project file, in the simulator."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from sealag.design._project import loaded
from sealag.design._system import System

if TYPE_CHECKING:
    from sealag.simulation import Run


def simulate(
    project: System | str | Path,
    *,
    scenario: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    delay_scale: float = 1.0,
    log_period: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> "Run":
    """Run a design's whole-body controller on the delayed robot, with contacts and energy audit.

    Scenarios: `regulate` holds the posture while the project's pushes act; `balance` does so with
    a push of 5 % of the weight for 0.1 s if the project has none, or, if the project has a
    [walking] section, by stepping on the spot on flat ground, since a biped on point feet cannot
    stand; `track` moves the first task's first row as a sinusoid; `drop` begins above the ground,
    or, with a fixed base, with springs that do not yet carry the joints; `walk` takes the steps of
    the project's [walking] section.

    Args:
        project: the design, or its project file.
        scenario: one of the five; the project's if None.
        duration: s; the project's, or the walk's, if None.
        seed: of jitter and losses; the project's if None.
        delay_scale: factor on both round trips.
        log_period: time between two logged instants, s; the project's, or the controller's period,
            if None.
        progress: called with the simulated time.

    Returns:
        The run; a fall or divergence is its named outcome.

    Raises:
        InputError: the scenario is unknown, duration, seed or delay_scale cannot be, the recording
            would not fit into the temporary folder, a push does not act during the run, a foot
            begins inside the ground, or the torque limits cannot hold the posture.
        FileError: the project file cannot be read.
    """
    from sealag.design._simulate import run_design

    return run_design(
        loaded(project),
        scenario=scenario,
        duration=duration,
        seed=seed,
        delay_scale=delay_scale,
        log_period=log_period,
        progress=progress,
    )
