"""Corollary 1: whether priority levels shrink the range of delays, as the third conclusion says."""

from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._claims import Claim, Verdict
from sealag.design import System
from sealag.passivity import Instant, Problem, solve
from sealag.robot import Motion
from sealag.typing import Array, IntArray
from sealag.whole_body import StiffnessForm

LEVEL_INSTANTS = 60
"""Instants of the walk at which (31) is solved; some need a semidefinite program each."""

CLEAR = 1e-4
"""Relative difference of two bounds from which they count as different; brackets are 1e-6 wide."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelBounds:
    """Bounds of (31) along a walk for one order of the tasks.

    Attributes:
        name: which task comes first.
        delay_s: (N,) largest delay, s.
    """

    name: str
    delay_s: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelTable:
    """The same gains as one 6-D task (29) and on two priority levels (31).

    Attributes:
        time: (N,) s, of the walk.
        single: (N,) bound of (29), s.
        levels: bounds of (31) for both orders.
    """

    time: Array
    single: Array
    levels: tuple[LevelBounds, ...]


def level_table(system: System, motion: Motion, *, instants: int = LEVEL_INSTANTS) -> LevelTable:
    """Bound the printed law with the two tasks on one level and on two, all six joints.

    Args:
        system: Hume with the paper's gains: its first task is the CoM, its second the torso.
        motion: the walk.
        instants: how many of its instants.
    """
    pick = np.unique(np.linspace(0, len(motion) - 1, instants).astype(int))
    first, second = (task.name for task in system.law.tasks)
    orders = (
        ("one level", (1, 1)),
        (f"{first} before {second}", (1, 2)),
        (f"{second} before {first}", (2, 1)),
    )
    single, *levels = (
        LevelBounds(name=name, delay_s=_bound(system, motion, priorities, pick))
        for name, priorities in orders
    )
    return LevelTable(time=motion.time[pick], single=single.delay_s, levels=tuple(levels))


def _bound(system: System, motion: Motion, priorities: tuple[int, int], pick: IntArray) -> Array:
    tasks = tuple(
        replace(task, priority=priority)
        for task, priority in zip(system.law.tasks, priorities, strict=True)
    )
    law = replace(system.law, tasks=tasks, stiffness_form=StiffnessForm.PUBLISHED)
    spaces = replace(system, law=law).spaces(motion).at(pick.tolist())
    problem = Problem.of_tasks(
        spaces.J_star,
        spaces.Lambda,
        spaces.K_x,
        system.actuators.motor_damping,
        levels=spaces.levels,
        form=StiffnessForm.PUBLISHED,
    )
    return solve(problem, share=Instant()).delay


def level_claim(table: LevelTable) -> Claim:
    """Check that the multi-task criterion (31) has the smaller range.

    Args:
        table: both criteria along the walk.
    """
    ratios = [bound.delay_s / table.single - 1.0 for bound in table.levels]
    each = "; ".join(
        f"{bound.name}: {(ratio < -CLEAR).sum()} smaller, {(ratio > CLEAR).sum()} larger, from "
        f"{ratio.min():+.2%} to {ratio.max():+.2%}, smallest over the walk "
        f"{bound.delay_s.min() * 1e3:.2f} ms"
        for bound, ratio in zip(table.levels, ratios, strict=True)
    )
    return Claim(
        key="levels",
        source="Conclusions, 3; Corollary 1 (31)",
        published="The criterion for prioritized tasks (31) has a smaller solution range.",
        computed=(
            f"CoM and torso on one level against two, at {len(table.time)} instants of the walk "
            f"(one level: smallest {table.single.min() * 1e3:.2f} ms). {each}. Levels change the "
            "law as well as the criterion: the lower task acts only where the higher one leaves "
            "room."
        ),
        verdict=Verdict.of(np.concatenate(ratios) < CLEAR),
        tolerance=f"(31) not larger than (29) by more than {CLEAR:g} at every instant",
    )
