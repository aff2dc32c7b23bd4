"""The paper's page from start to end."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from humanoids2016._ablation import PUBLISHED_LAW, ablation_cases, ablation_table, gait_cases
from humanoids2016._beyond import HELD_OUT, delay_map, walk_beyond
from humanoids2016._bounds_page import beyond_section, figure_5_section, limits_section
from humanoids2016._figure4 import figure_4, figure_4_claims, simulated_motion
from humanoids2016._figure5 import figure_5, figure_5_claims
from humanoids2016._paper_page import write_paper_page
from humanoids2016._random_table import random_plant_table
from humanoids2016._unsafe import unsafe_examples
from humanoids2016._walk import simulate_walk
from humanoids2016._walk_page import energy_section, means_section, walk_section
from humanoids2016._walk_table import (
    gain_cases,
    robustness_cases,
    rough_terrains,
    walk_claim,
    walk_success,
)
from sealag import __version__ as VERSION
from sealag.design import certify, load, save_motion
from sealag.report import write_run
from sealag.walking import paper_terrain, plan_walk, walk_motion


def reproduce(out: Path, *, progress: Callable[[str], None]) -> dict[str, Any]:
    """Compute everything and write the page, its CSVs, the planned walk and the recording."""
    system = load("bundled:hume")
    progress("[1/7] planning 7 steps and their whole-body motion at 1 kHz")
    motion = walk_motion(system.robot, plan_walk(paper_terrain(), steps=7))
    save_motion(motion, system.robot, out / "walk.csv")
    progress(f"[2/7] Fig. 4 over {len(motion)} instants")
    figure = figure_4(system.robot, motion, system=system)
    progress("[3/7] published and certified criterion against the exact delay margin")
    unsafe, table = unsafe_examples(), random_plant_table()
    progress("[4/7] walking 7 steps in closed loop under delay")
    walk = simulate_walk(system)
    write_run(walk.run, system.robot, out / "walk.mcap", project=system.text, version=VERSION)
    progress("[5/7] walking over random terrains, with and without noise and model errors")
    robust = walk_success(robustness_cases(steps=7), rough_terrains(20), jobs=2)
    fresh = rough_terrains(20, first=HELD_OUT)
    held_out = walk_success(robustness_cases(steps=20), fresh, jobs=2)
    progress("[6/7] leaving out each means, varying gains and delays, stairs, pushes; Fig. 5")
    ablations = walk_success(ablation_cases(), rough_terrains(4), jobs=2)
    gait = walk_success(gait_cases(), rough_terrains(4), jobs=2)
    everywhere = ablation_table(rough_terrains(2), jobs=2)
    gains = walk_success(gain_cases(system.delays), rough_terrains(4), jobs=2)
    delays, beyond = delay_map(motion, jobs=2), walk_beyond(jobs=2)
    certificate = certify(system, motion, time_varying=True)
    simulated = figure_4(system.robot, simulated_motion(walk.run), system=system)
    traces = figure_5(jobs=2)
    claims = (
        *figure_4_claims(figure, table),
        *figure_5_claims(traces),
        walk_claim(robust, next(row for row in ablations if row.name == PUBLISHED_LAW)),
    )
    progress("[7/7] writing the page")
    extra = [
        walk_section(system, walk, robust, held_out),
        means_section(system, walk, ablations, everywhere, gait),
        energy_section(walk, certificate),
        limits_section(figure, simulated, gains, delays),
        figure_5_section(traces, system.robot.joints),
        beyond_section(beyond, certificate),
    ]
    page = write_paper_page(
        out,
        figure,
        claims,
        unsafe=unsafe,
        table=table,
        simulated=simulated,
        traces=traces,
        extra=extra,
        version=VERSION,
    )
    return {
        "page": str(page),
        "instants": len(motion),
        "claims": {claim.key: claim.verdict.value for claim in claims},
        "unsafe_published": table.published_longer,
        "unsafe_certified": table.certified_longer,
        "steps_walked": walk.steps,
        "walked": {row.name: f"{row.walked}/{row.terrains}" for row in robust},
        "gaits": {row.name: f"{row.gaits}/{row.terrains}" for row in robust},
        "walked_20_steps_on_new_ground": {
            row.name: f"{row.walked}/{row.terrains}" for row in held_out
        },
    }
