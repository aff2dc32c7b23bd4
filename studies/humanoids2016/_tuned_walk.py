"""Future work (iii): gains that fit the walk and its delay, found by `sealag.tune`."""

from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._claims import Claim, Verdict
from humanoids2016._figure4 import simulated_motion
from humanoids2016._walk import Walk, simulate_walk
from sealag.design import System
from sealag.robot import Motion
from sealag.tune import tune
from sealag.typing import Array

EVERY = 20
"""Ticks between the instants of the walk for which gains are found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TunedWalk:
    """The printed damping and the one with the least drag, over the walk at its worst delay.

    Attributes:
        delay_s: d_1 at its largest, s.
        bound_s: what the printed gains tolerate by the passive bound, s.
        drag_j: Σ D_θ ∫θ̇² dt of the printed damping, J.
        damping: (n,) tuned for K_x as printed, Nms/rad.
        tuned_drag_j: its drag, J.
        stiffness: largest factor of K_x with the printed damping.
        tuned_stiffness: with the tuned shape of D_θ, scaled to the printed drag.
        walked: whether the walk with the tuned damping is a gait.
    """

    delay_s: float
    bound_s: float
    drag_j: float
    damping: Array
    tuned_drag_j: float
    stiffness: float
    tuned_stiffness: float
    walked: bool


def tuned_walk(system: System, walk: Walk) -> TunedWalk:
    """Find the damping with the least drag, and walk with it.

    x(θ) is fed back, so that F_θ = F_q grows with K_x as D_θ does: at the printed drag the tuned
    shape carries K_x times the ratio of both drags.

    Args:
        system: Hume with the paper's gains.
        walk: its simulated walk.
    """
    whole = simulated_motion(walk.run)
    motion = whole.at(slice(None, None, EVERY))
    least = tune(system, motion, aim="drag")
    damping = least.system.actuators.motor_damping
    printed, own = _drag(system, motion), _drag(least.system, motion)
    bound = system.certified_bounds(system.spaces(motion), None, motion).delay.min()
    again = replace(system, actuators=replace(system.actuators, motor_damping=damping))
    return TunedWalk(
        delay_s=system.delays.d_1,
        bound_s=float(bound),
        drag_j=printed,
        damping=damping,
        tuned_drag_j=own,
        stiffness=float(bound) / system.delays.d_1,
        tuned_stiffness=printed / own,
        walked=bool(simulate_walk(again, walk.case).gait.is_gait),
    )


def _drag(system: System, motion: Motion) -> float:
    """Σ D_θ ∫θ̇² dt along a motion, J."""
    rates = motion.v[:, system.robot.nv_base :]
    moved = np.trapezoid(rates**2, motion.time, axis=0)
    return float(system.actuators.motor_damping @ moved)


def tuned_claim(found: TunedWalk, joints: tuple[str, ...]) -> Claim:
    """Check that damping fitted to the walk is worth twice the printed one.

    Args:
        found: what was found.
        joints: the robot's.
    """
    values = ", ".join(f"{name} {value:.3g}" for name, value in zip(joints, found.damping))
    more = found.tuned_stiffness / found.stiffness
    return Claim(
        key="tuned gains",
        source="Section VI, future work (iii)",
        published="An optimal controller and a mapping between damping gains are yet to be found.",
        computed=(
            f"Over the simulated walk, K_x as printed, at the largest delay of "
            f"{found.delay_s * 1e3:.1f} ms: the printed D_θ tolerates {found.bound_s * 1e3:.1f} ms "
            f"and takes {found.drag_j:.0f} J; the D_θ of least drag ({values} Nms/rad) tolerates "
            f"the delay and takes {found.tuned_drag_j:.0f} J. At the printed drag it carries "
            f"{found.tuned_stiffness:.2f} K_x, the printed one {found.stiffness:.2f} K_x: "
            f"{more:.1f} times as much. The walk with it is "
            f"{'a gait' if found.walked else 'no gait'}."
        ),
        verdict=Verdict.of([more >= 2.0 and found.walked]),
        tolerance="at least twice the stiffness at equal drag and delay, and a gait",
    )
