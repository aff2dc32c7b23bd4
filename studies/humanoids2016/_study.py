"""The study from start to end: compute, then write the page."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from humanoids2016._ablation import PUBLISHED_LAW, ablation_cases, ablation_table, gait_cases
from humanoids2016._beyond import (
    HELD_OUT,
    bandwidth_refusal,
    beyond_cases,
    delay_map,
    drive_cases,
)
from humanoids2016._central_damping import split_claim, split_damping
from humanoids2016._figure4 import LEG, figure_4, figure_4_claims, simulated_motion
from humanoids2016._figure5 import figure_5, figure_5_claims
from humanoids2016._findings import QUICK, Findings, StudySize
from humanoids2016._levels import level_claim, level_table
from humanoids2016._live import live_leg
from humanoids2016._one_joint import one_joint_claim, one_joint_grids
from humanoids2016._paper_page import write_paper_page
from humanoids2016._ports import port_claims, port_table, stance_legs, tank_table
from humanoids2016._printed_task import printed_rows
from humanoids2016._progress import Progress
from humanoids2016._random_table import random_plant_table
from humanoids2016._rotors import rotor_table
from humanoids2016._slow_model import slow_models
from humanoids2016._task_terms import reference_rows, task_terms
from humanoids2016._torque_rate import torque_rate_rows
from humanoids2016._tuned_walk import tuned_claim, tuned_walk
from humanoids2016._unsafe import unsafe_examples
from humanoids2016._walk import WalkCase, simulate_walk, walking_of
from humanoids2016._walk_table import (
    WalkRow,
    gain_cases,
    robustness_cases,
    rough_grounds,
    walk_claim,
    walk_success,
)
from sealag import __version__ as VERSION
from sealag.design import System, certify, load
from sealag.errors import InputError
from sealag.files import make_folder
from sealag.report import write_run
from sealag.robot import Motion
from sealag.walking import WalkPlan

STAGES: Mapping[str, float] = {
    "planning the walk and its whole-body motion": 4.0,
    "Fig. 4 at every instant of the plan": 10.0,
    "both criteria against the exact delay margin": 45.0,
    "each subsystem at its port, and the energy tank": 25.0,
    "the walk in closed loop under delay": 7.0,
    "what the paper leaves out: slow models, C(q), μ, F_c, x_d(q̄)": 22.0,
    "walks over random terrains, with and without noise and model errors": 50.0,
    "walks with each means left out, and the printed law on the printed task": 20.0,
    "Fig. 5: walks with several β, D_θ and K": 8.0,
    "priority levels, central damping, a certificate of the whole walk": 40.0,
    "each means left out over springs, α, β and delays": 40.0,
    "gains, delays, stairs, pushes and drives": 60.0,
}
"""What is computed, and how many seconds it takes on two idle processors."""


def reproduce(
    out: Path,
    *,
    progress: Callable[[str], None],
    project: str = "bundled:hume",
    quick: bool = False,
) -> dict[str, Any]:
    """Compute everything and write the page, its CSVs, the planned walk and the recording.

    Args:
        out: folder for all files; it is made once the project is known to be right.
        progress: called with a sentence before each part.
        project: a project file with Hume's joints and a [walking] section.
        quick: whether a few cases of each table are enough.

    Returns:
        The JSON answer of `sealag paper`.

    Raises:
        InputError: the project has no [walking] section, or its robot is not Hume.
        FileError: a file cannot be written.
    """
    _hume(project)
    make_folder(out)
    found = study(project, QUICK if quick else StudySize(), progress=progress)
    system, walk = found.system, found.walk
    system.save_motion(found.motion, out / "walk.csv")
    write_run(walk.run, system.robot, out / "walk.mcap", project=system.text, version=VERSION)
    page = write_paper_page(out, found, version=VERSION)
    return {
        "page": str(page),
        "instants": len(found.motion),
        "claims": {claim.key: claim.verdict.value for claim in found.claims},
        "unsafe_published": found.table.published_longer,
        "unsafe_certified": found.table.certified_longer,
        "steps_walked": walk.gait.steps,
        "walked": {row.name: f"{row.walked}/{row.terrains}" for row in found.robust},
        "gaits": {row.name: f"{row.gaits}/{row.terrains}" for row in found.robust},
        "walked_on_new_ground": {
            row.name: f"{row.walked}/{row.terrains}, {row.steps} steps" for row in found.held_out
        },
    }


def planned_walk(system: System, *, rate: float = 1000.0) -> Motion:
    """Return the planned walk: feet, ground, steps and CoM height of the project's [walking].

    Apex speeds and step lengths are those of `WalkPlan.over`, as the paper's plan has them.

    Args:
        system: the project.
        rate: instants per second.

    Raises:
        InputError: the project has no [walking] section.
        RobotError: a foothold is out of reach.
    """
    walking = walking_of(system)
    plan = WalkPlan.over(walking.ground, steps=walking.steps, com_height=walking.gait.com_height)
    return plan.motion(system.robot, rate=rate, feet=walking.feet)


def study(project: str, size: StudySize, *, progress: Callable[[str], None]) -> Findings:
    """Compute all that the page shows.

    Args:
        project: a project file with Hume's joints and a [walking] section.
        size: how much.
        progress: called with a sentence before each part.

    Raises:
        InputError: the project has no [walking] section, or its robot is not Hume.
    """
    system = _hume(project)
    walking, stages = walking_of(system), Progress(STAGES, progress)
    stages.begin("planning the walk and its whole-body motion")
    motion = planned_walk(system, rate=size.rate)
    live = live_leg(system, motion)
    stages.begin("Fig. 4 at every instant of the plan")
    figure = figure_4(system, motion)
    stages.begin("both criteria against the exact delay margin")
    unsafe, table = unsafe_examples(draws=size.draws), random_plant_table(size.plants)
    stages.begin("each subsystem at its port, and the energy tank")
    ports = port_table(live, duration=size.leg_time)
    tanks = tank_table(live, duration=size.leg_time)
    stages.begin("the walk in closed loop under delay")
    walk = simulate_walk(system)
    simulated = figure_4(system, simulated_motion(walk.run))
    stages.begin("what the paper leaves out: slow models, C(q), μ, F_c, x_d(q̄)")
    slow = slow_models(system, motion, periods=size.periods)
    rotors = rotor_table(system, walk, live, ratios=size.ratios, swing_time=size.swing_time)

    def tabulate(cases: Mapping[str, WalkCase], count: int, first: int = 0) -> tuple[WalkRow, ...]:
        grounds = rough_grounds(count, first=first)
        return walk_success(_some(cases, size), grounds, project=project, jobs=size.jobs)

    stages.begin("walks over random terrains, with and without noise and model errors")
    robust = tabulate(robustness_cases(walking), size.grounds)
    longer = replace(walking, steps=size.held_out_steps)
    held_out = tabulate(robustness_cases(longer), size.grounds, HELD_OUT)
    stages.begin("walks with each means left out, and the printed law on the printed task")
    ablations = tabulate(ablation_cases(walking), size.few_grounds)
    printed = printed_rows(rough_grounds(size.few_grounds), project=project, jobs=size.jobs)
    stages.begin("Fig. 5: walks with several β, D_θ and K")
    traces = figure_5(betas=size.betas, project=project, jobs=size.jobs)
    published = next(row for row in ablations if row.name == PUBLISHED_LAW)
    stages.begin("priority levels, central damping, a certificate of the whole walk")
    levels, damping = level_table(system, motion), split_damping(system)
    certificate = certify(system, motion, time_varying=True)
    few = (size.few_grounds + 1) // 2
    stages.begin("each means left out over springs, α, β and delays")
    everywhere = ablation_table(
        rough_grounds(few), project=project, most=size.cases, jobs=size.jobs
    )
    stages.begin("gains, delays, stairs, pushes and drives")
    return Findings(
        system=system,
        motion=motion,
        figure=figure,
        simulated=simulated,
        unsafe=unsafe,
        table=table,
        walk=walk,
        robust=robust,
        held_out=held_out,
        ablations=ablations,
        everywhere=everywhere,
        gait=tabulate(gait_cases(walking), size.few_grounds),
        gains=tabulate(gain_cases(walking, system.delays), size.few_grounds),
        delays=delay_map(
            motion,
            project=project,
            stiffnesses=size.stiffnesses,
            scales=size.scales,
            terrains=few,
            jobs=size.jobs,
        ),
        traces=traces,
        beyond=walk_success(
            _some(beyond_cases(walking), size), None, project=project, jobs=size.jobs
        ),
        drives=tabulate(drive_cases(walking), size.few_grounds, HELD_OUT),
        bandwidth_refusal=bandwidth_refusal(system),
        levels=levels,
        damping=damping,
        live=live,
        ports=ports,
        tanks=tanks,
        printed=printed,
        slow=slow,
        rotors=rotors,
        terms=task_terms(system, walk),
        references=reference_rows(live),
        torque_rates=torque_rate_rows(live),
        certificate=certificate,
        claims=(
            *figure_4_claims(figure, table),
            *port_claims(ports, tanks),
            *figure_5_claims(traces),
            level_claim(levels),
            split_claim(damping),
            tuned_claim(tuned_walk(system, walk), system.robot.joints),
            one_joint_claim(one_joint_grids(stance_legs(live)[0])),
            walk_claim(robust, published),
        ),
    )


def _hume(project: str) -> System:
    """Load a project; one without a walk, or without Hume's legs that figures show, is refused."""
    system = load(project)
    walking_of(system)
    names = [f"{side}_{part}" for side in ("left", "right") for part in LEG]
    missing = [name for name in names if name not in system.robot.joints]
    if missing:
        raise InputError(
            f"The study is about Hume; {system.name} has no joint {missing[0]}. Start from "
            "bundled:hume."
        )
    return system


def _some(cases: Mapping[str, WalkCase], size: StudySize) -> dict[str, WalkCase]:
    """The first cases of a table, and the published law, on which a claim rests."""
    most = len(cases) if size.cases is None else size.cases
    return {
        name: case
        for k, (name, case) in enumerate(cases.items())
        if k < most or name.startswith(PUBLISHED_LAW)
    }
