"""Success tables of the walk: terrains, gains, delays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from humanoids2016._claims import Claim, Verdict
from humanoids2016._walk import Walk, WalkCase, at_delay_scale, simulate_walk
from humanoids2016._walk_errors import SensorNoise
from sealag.delay import Delays
from sealag.design import System, load
from sealag.walking import Ground, GroundProfile, Walking
from sealag.workers import in_parallel

ENOUGH = 0.95
"""Share of terrains that must be walked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkRow:
    """One row of a success table.

    Attributes:
        name: What was varied.
        terrains: Number of walks.
        steps: How many steps each should have.
        walked: How many took all steps without a fall.
        gaits: How many of them were gaits: apex speeds within 20 %, widths within 25 %.
        apex_speed: Mean of the apex speeds after the second step, m/s; NaN if there is none.
        step_width: Mean of the step widths after the second step, m; NaN if there is none.
        speed_deviation: Largest relative deviation of apex speeds among walks that did not fall.
        width_deviation: Largest relative deviation of step widths among these.
        mean_steps: Mean number of steps taken.
        causes: How the walks that failed ended.
    """

    name: str
    terrains: int
    steps: int
    walked: int
    gaits: int
    apex_speed: float
    step_width: float
    speed_deviation: float
    width_deviation: float
    mean_steps: float
    causes: tuple[str, ...]

    @classmethod
    def of(cls, name: str, walks: Sequence[Walk]) -> "WalkRow":
        """Summarise walks.

        Args:
            name: What was varied.
            walks: The walks.
        """
        gaits = [walk.gait for walk in walks]
        upright = [gait for gait in gaits if gait.walked]
        speeds = [speed for gait in gaits for speed in gait.settled_speed.tolist()]
        widths = [width for gait in gaits for width in gait.settled_width.tolist()]
        return cls(
            name=name,
            terrains=len(walks),
            steps=walks[0].case.walking.steps,
            walked=len(upright),
            gaits=sum(gait.is_gait for gait in gaits),
            apex_speed=float(np.mean(speeds)) if speeds else float("nan"),
            step_width=float(np.mean(widths)) if widths else float("nan"),
            speed_deviation=max((gait.speed_deviation for gait in upright), default=float("nan")),
            width_deviation=max((gait.width_deviation for gait in upright), default=float("nan")),
            mean_steps=float(np.mean([gait.steps for gait in gaits])),
            causes=tuple(gait.cause for gait in gaits if not gait.walked),
        )


def walk_success(
    cases: Mapping[str, WalkCase],
    grounds: Sequence[Ground] | None,
    *,
    project: str = "bundled:hume",
    jobs: int = 1,
) -> tuple[WalkRow, ...]:
    """Walk every case over every ground; the ground's number is the seed of its errors.

    Args:
        cases: What to vary; each case's own ground and seed are replaced.
        grounds: The grounds; None walks each case once, on its own.
        project: The project file; each process loads it.
        jobs: Number of processes.
    """
    work = [
        (project, case if ground is None else replace(case, seed=seed).walks(ground=ground))
        for case in cases.values()
        for seed, ground in enumerate([None] if grounds is None else grounds)
    ]
    walks: list[Any]
    if jobs == 1:
        system = load(project)
        walks = [simulate_walk(system, case).summary() for _, case in work]
    else:
        walks = list(in_parallel(_walk, work, jobs=jobs))
    count = 1 if grounds is None else len(grounds)
    rows = zip(cases, range(0, len(work), count))
    return tuple(WalkRow.of(name, walks[at : at + count]) for name, at in rows)


_SYSTEMS: dict[str, System] = {}


def _walk(project: str, case: WalkCase) -> Walk:
    if project not in _SYSTEMS:
        _SYSTEMS[project] = load(project)
    return simulate_walk(_SYSTEMS[project], case).summary()


def rough_grounds(
    count: int = 20, *, first: int = 0, amplitude: float = 0.05
) -> tuple[Ground, ...]:
    """Return random rough grounds.

    Args:
        count: How many.
        first: Seed of the first; gains and gait were chosen on seeds below 20.
        amplitude: Their heights lie in ± this, m.
    """
    return tuple(GroundProfile.rough(first + k, amplitude=amplitude) for k in range(count))


def robustness_cases(walking: Walking) -> dict[str, WalkCase]:
    """Return a walk with ideal and with ordinary sensors and models.

    Args:
        walking: The walk.
    """
    case = WalkCase(walking=walking)
    noise = SensorNoise()
    return {
        "ideal sensors, exact model": case,
        "encoder and IMU noise": replace(case, noise=noise),
        "5 % model error": replace(case, model_error=0.05),
        "noise and 5 % model error": replace(case, noise=noise, model_error=0.05),
    }


def gain_cases(walking: Walking, delays: Delays) -> dict[str, WalkCase]:
    """Return a walk over spring stiffness, α and β.

    Args:
        walking: The walk.
        delays: The project's.
    """
    case = WalkCase(walking=walking)
    cases = {}
    for K in (200.0, 350.0, 700.0, 1000.0, 3000.0):
        cases[f"K = {K:g} Nm/rad"] = replace(case, spring_stiffness=K)
    for alpha in (0.1, 0.3, 1.0, 2.0):
        cases[f"α = {alpha:g}"] = replace(case, damping_scale=alpha)
    for beta in (0.1, 0.5, 1.0, 2.0):
        cases[f"β = {beta:g}"] = replace(case, inertia_shaping=beta)
    cases["no delay"] = at_delay_scale(case, delays, 0.0)
    return cases


def walk_claim(robust: Sequence[WalkRow], published: WalkRow) -> Claim:
    """Check that Hume walks over rough terrain at the paper's delays.

    Args:
        robust: Success of the default project, with ideal and with ordinary sensors and models.
        published: Success of the law as printed.
    """
    walks = [row.gaits >= ENOUGH * row.terrains for row in robust]
    printed = published.walked >= ENOUGH * published.terrains
    counts = "; ".join(f"{row.name}: {row.gaits} of {row.terrains} gaits" for row in robust)
    return Claim(
        key="walk",
        source="Section V",
        published="Hume walks seven steps over rough terrain with T_H = 20 + 10 sin t ms and "
        "T_L = 3 + 2 sin t ms.",
        computed=(
            f"With the default project file, {counts}. With the law as printed "
            f"{published.walked} of {published.terrains} walk."
        ),
        verdict=Verdict.of([*walks, printed]),
        tolerance=f"at least {ENOUGH:.0%} of the terrains, each with a gait",
    )
