"""The paper's page from start to end."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import sealag
from sealag.design import load, save_motion
from sealag.locomotion import paper_terrain, plan_walk, walk_motion
from sealag.paper import figure_4, figure_4_claims, random_plant_table, unsafe_examples
from sealag.report import write_paper_page


def make_paper(out: Path, *, progress: Callable[[str], None]) -> dict[str, Any]:
    """Compute everything and write the page, its CSVs and the walk as a motion file."""
    system = load("bundled:hume")
    progress("[1/4] planning 7 steps and their whole-body motion at 1 kHz")
    motion = walk_motion(system.robot, plan_walk(paper_terrain(), steps=7))
    save_motion(motion, system.robot, out / "walk.csv")
    progress(f"[2/4] Fig. 4 over {len(motion)} instants")
    figure = figure_4(system.robot, motion, system=system)
    claims = figure_4_claims(figure)
    progress("[3/4] published and certified criterion against the exact delay margin")
    unsafe, table = unsafe_examples(), random_plant_table()
    progress("[4/4] writing the page")
    page = write_paper_page(
        out, figure, claims, unsafe=unsafe, table=table, version=sealag.__version__
    )
    return {
        "page": str(page),
        "instants": len(motion),
        "claims": {claim.key: claim.verdict.value for claim in claims},
        "unsafe_published": table.published_longer,
        "unsafe_certified": table.certified_longer,
    }
