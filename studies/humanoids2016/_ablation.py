"""Ablation of the walking controller: each means left out, over springs, α, β and delays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from humanoids2016._walk import WalkCase, at_delay_scale, walking_of
from humanoids2016._walk_table import walk_success
from sealag.design import load
from sealag.typing import IntArray
from sealag.walking import Ground, Walking

PUBLISHED_LAW = "published law"

LEFT_OUT: Mapping[str, Mapping[str, Any]] = {
    "everything": {},
    "no preview": {"preview": False},
    "prediction: constant velocity": {"prediction": "velocity"},
    "no prediction": {"prediction": "none"},
    "no velocity feedforward": {"velocity_feedforward": False},
    "no lead": {"lead": False},
    "no acceleration feedforward": {"acceleration_feedforward": False},
    "no position term in the planned velocity": {"position_rate": 0.0},
    "no torque feedback": {"torque_feedback": 0.0},
    "no task damping": {"task_damping": 0.0},
    "footsteps by CoM velocity": {"momentum_placement": False},
    "no correction of constant errors": {"bias_gain": 0.0},
    "no averaging of the placement": {"placement_time": 0.0},
    "no early touchdown": {"early_contact": False},
}

_TRIAL: Mapping[str, Any] = {
    "prediction": "velocity",
    "momentum_placement": False,
    "task_damping": 0.0,
    "torque_feedback": 0.0,
    "bias_gain": 0.0,
    "placement_time": 0.0,
    "position_rate": 0.0,
}
_MODEL = "prediction with the model"
_MOMENTUM = "footsteps by angular momentum"
_SUPPLIED: Mapping[str, tuple[str, ...]] = {
    "pendulum, constant velocity": (),
    _MODEL: ("prediction",),
    _MOMENTUM: ("momentum_placement",),
    f"{_MODEL}, {_MOMENTUM}": ("prediction", "momentum_placement"),
}


def ablation_cases(walking: Walking) -> dict[str, WalkCase]:
    """Return a walk with each means left out, and with the published law.

    Args:
        walking: The walk, with all means.
    """
    whole, options = WalkCase(walking=walking), walking.options
    cases = {
        name: whole.walks(options=replace(options, **change)) for name, change in LEFT_OUT.items()
    }
    cases["no weight transfer"] = whole.walks(gait=replace(walking.gait, transfer_time=1e-3))
    printed = whole.walks(options=options.published())
    cases[PUBLISHED_LAW] = printed
    cases[f"{PUBLISHED_LAW}, link-side feedback"] = whole.walks(
        options=options.published(feedback="joint")
    )
    cases[f"{PUBLISHED_LAW}, no delay"] = replace(printed, delay_scale=0.0)
    return cases


def gait_cases(walking: Walking) -> dict[str, WalkCase]:
    """Return walks that tell what makes the walk a gait, with two spring stiffnesses.

    They begin with the few means that suffice not to fall (preview at constant velocity, footsteps
    by the pendulum's CoM velocity, feedforward, lead) and get the model's prediction and the
    placement by angular momentum, one at a time and both.

    Args:
        walking: The walk.
    """
    cases = {}
    for K in (1000.0, 350.0):
        for name, supplied in _SUPPLIED.items():
            change = {key: value for key, value in _TRIAL.items() if key not in supplied}
            case = WalkCase(walking=walking, spring_stiffness=K)
            cases[f"K = {K:g} Nm/rad: {name}"] = case.walks(
                options=replace(walking.options, **change)
            )
    return cases


@dataclass(frozen=True, slots=True, kw_only=True)
class AblationTable:
    """Each means left out under each condition.

    Attributes:
        means: (M,) what was left out.
        conditions: (C,) what was varied.
        terrains: number of grounds at each point.
        walked: (M, C) how many were walked without a fall.
        gaits: (M, C) how many walks were gaits.
    """

    means: tuple[str, ...]
    conditions: tuple[str, ...]
    terrains: int
    walked: IntArray
    gaits: IntArray


def ablation_table(
    grounds: Sequence[Ground],
    *,
    project: str = "bundled:hume",
    most: int | None = None,
    jobs: int = 1,
) -> AblationTable:
    """Leave out each means over spring stiffness, α, β and delay scale.

    Args:
        grounds: the grounds.
        project: the project file, with a [walking] section.
        most: how many means and conditions at most; None for all.
        jobs: number of processes.
    """
    system = load(project)
    conditions: dict[str, dict[str, float]] = {
        "K = 200": {"spring_stiffness": 200.0},
        "K = 1000": {"spring_stiffness": 1000.0},
        "α = 0.3": {"damping_scale": 0.3},
        "α = 2": {"damping_scale": 2.0},
        "β = 0.1": {"inertia_shaping": 0.1},
        "β = 2": {"inertia_shaping": 2.0},
        "no delay": {"delay_scale": 0.0},
        "delays × 2": {"delay_scale": 2.0},
    }
    means = ablation_cases(walking_of(system))
    means = {name: case for name, case in means.items() if not name.startswith(f"{PUBLISHED_LAW},")}
    means, conditions = dict(islice(means.items(), most)), dict(islice(conditions.items(), most))
    cases = {}
    for name, case in means.items():
        for condition, change in conditions.items():
            varied, scale = replace(case, **change), change.get("delay_scale", 1.0)
            cases[f"{name}, {condition}"] = at_delay_scale(varied, system.delays, scale)
    rows = walk_success(cases, grounds, project=project, jobs=jobs)
    shape = (len(means), len(conditions))
    return AblationTable(
        means=tuple(means),
        conditions=tuple(conditions),
        terrains=len(grounds),
        walked=np.array([row.walked for row in rows]).reshape(shape),
        gaits=np.array([row.gaits for row in rows]).reshape(shape),
    )
