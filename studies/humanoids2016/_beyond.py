"""Beyond the paper: stairs, pushes, more steps, and how much delay is walked against bounds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._walk import WalkCase, at_delay_scale, walking_of
from humanoids2016._walk_table import rough_grounds, walk_success
from sealag.design import System, certify, load
from sealag.robot import Motion
from sealag.simulation import Push
from sealag.typing import Array
from sealag.walking import GroundProfile, Walking
from sealag.whole_body import MotorAngles, StaticJoint

PUSH = 0.1  # s
PUSHED = 1.3  # s, in the fourth step
STIFFNESSES = (200.0, 350.0, 1000.0, 3000.0)
SCALES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
HELD_OUT = 100  # first seed of terrains on which nothing was chosen


def beyond_cases(walking: Walking) -> dict[str, WalkCase]:
    """Return walks over stairs, under pushes and over rougher ground.

    Args:
        walking: The walk; its ground and steps are replaced.
    """
    case, cases = WalkCase(walking=walking), {}
    for rise in (0.05, 0.10):
        for way, sign in (("up", 1.0), ("down", -1.0)):
            ground = GroundProfile.stairs([sign * rise] * 5)
            cases[f"stairs, {rise * 100:.0f} cm {way}"] = case.walks(steps=8, ground=ground)
    ground = GroundProfile.stairs([0.1] * 3 + [-0.1] * 3)
    cases["stairs, 3 × 10 cm up, then down"] = case.walks(steps=10, ground=ground)
    for amplitude in (0.09, 0.12):
        name = f"rough, ± {amplitude * 100:.0f} cm, 20 steps"
        ground = GroundProfile.rough(HELD_OUT, amplitude=amplitude)
        cases[name] = case.walks(steps=20, ground=ground)
    pushes = {"forward": (1.0, 0.0), "back": (-1.0, 0.0), "left": (0.0, 1.0), "right": (0.0, -1.0)}
    for force in (20.0, 60.0, 120.0):
        for name, (x, y) in pushes.items():
            push = Push(
                frame="torso", force=(force * x, force * y, 0.0), start=PUSHED, duration=PUSH
            )
            pushed = replace(case, pushes=(push,))
            cases[f"push {name}, {force:.0f} N for {PUSH:g} s"] = pushed.walks(
                steps=10, ground=GroundProfile.flat()
            )
    return cases


FRICTIONS = (0.5, 1.0, 2.0, 4.0)
"""Coulomb friction of every motor, Nm."""

BANDWIDTHS = (1000.0, 300.0, 100.0)
"""Bandwidths of every motor's torque loop, rad/s."""


def drive_cases(walking: Walking) -> dict[str, WalkCase]:
    """Return walks on drives that are not ideal, of which the controller knows nothing.

    Args:
        walking: The walk.
    """
    case = WalkCase(walking=walking)
    cases = {"ideal drives": case}
    for friction in FRICTIONS:
        name = f"Coulomb friction {friction:g} Nm at every motor"
        cases[name] = replace(case, coulomb_friction=friction)
    for bandwidth in BANDWIDTHS:
        name = f"torque bandwidth {bandwidth:g} rad/s at every motor"
        cases[name] = replace(case, torque_bandwidth=bandwidth)
    return cases


def bandwidth_refusal(system: System) -> str:
    """Return why a finite torque bandwidth is not certified.

    Args:
        system: the project.
    """
    lags = np.full(system.actuators.n, BANDWIDTHS[0])
    lagging = replace(system, actuators=replace(system.actuators, torque_bandwidth=lags))
    return "; ".join(certify(lagging).answer.reasons)


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayMap:
    """How much delay is walked with each spring stiffness, and what the bounds say.

    Attributes:
        stiffness: (K,) spring stiffness, Nm/rad.
        scale: (S,) factor on the paper's delays.
        d_1: (S,) largest total delay T_H + T_L / 2, s.
        terrains: number of grounds at each point.
        walked: (K, S) how many were walked without a fall.
        gaits: (K, S) how many walks were gaits.
        certified_motor: (K,) certified bound of the position loop with motor angles fed back, s.
        certified_static: (K,) the same with q̄(θ) fed back; 0 where it is refused.
        first_crossing: (K,) exact delay at which one more pair of roots of the position loop
            crosses; the loop's margin is 0, since a biped on one point foot is a pendulum, s.
    """

    stiffness: Array
    scale: Array
    d_1: Array
    terrains: int
    walked: Array
    gaits: Array
    certified_motor: Array
    certified_static: Array
    first_crossing: Array

    @property
    def longest_walked(self) -> Array:
        """Largest d_1 up to which every ground was walked, s (K,)."""
        return self._longest(self.walked)

    @property
    def longest_gait(self) -> Array:
        """Largest d_1 up to which every walk was a gait, s (K,)."""
        return self._longest(self.gaits)

    def _longest(self, count: Array) -> Array:
        good = np.cumprod(count == self.terrains, axis=1).sum(axis=1)
        return np.where(good > 0, self.d_1[np.maximum(good, 1) - 1], 0.0)


def delay_map(
    motion: Motion,
    *,
    project: str = "bundled:hume",
    stiffnesses: Sequence[float] = STIFFNESSES,
    scales: Sequence[float] = SCALES,
    terrains: int = 2,
    jobs: int = 1,
) -> DelayMap:
    """Walk with longer and longer delays until the robot falls, beside the bounds.

    The controller knows the mean of its command's way, as it does at the paper's delays.

    Args:
        motion: a walk with one stance foot at a time, on which the bounds are taken.
        project: the project file.
        stiffnesses: spring stiffnesses, Nm/rad.
        scales: factors on the project's delays, increasing.
        terrains: number of rough grounds, held out from all choices.
        jobs: number of processes.
    """
    system = load(project)
    walking = walking_of(system)
    cases = {
        f"{K:g} {scale:g}": at_delay_scale(
            WalkCase(walking=walking, spring_stiffness=K), system.delays, scale
        )
        for K in stiffnesses
        for scale in scales
    }
    grounds = rough_grounds(terrains, first=HELD_OUT)
    rows = walk_success(cases, grounds, project=project, jobs=jobs)
    shape = (len(stiffnesses), len(scales))
    bounds = np.array([_bounds(system, motion, K) for K in stiffnesses])
    return DelayMap(
        stiffness=np.array(stiffnesses),
        scale=np.array(scales),
        d_1=np.array(scales) * (system.delays.d_1 - system.delays.sample_time),
        terrains=terrains,
        walked=np.array([row.walked for row in rows]).reshape(shape),
        gaits=np.array([row.gaits for row in rows]).reshape(shape),
        certified_motor=bounds[:, 0],
        certified_static=bounds[:, 1],
        first_crossing=bounds[:, 2],
    )


LOOPS = 16
"""Instants of a walk whose frozen loops are computed for each stiffness."""


def _bounds(system: System, motion: Motion, stiffness: float) -> tuple[float, float, float]:
    springs = np.full(system.actuators.n, stiffness)
    design = replace(system, actuators=replace(system.actuators, spring_stiffness=springs))
    certified = []
    for signal in (MotorAngles(), StaticJoint()):
        variant = replace(design, law=replace(design.law, signal=signal))
        spaces = variant.spaces(motion)
        certified.append(float(variant.certified_bounds(spaces).delay.min()))
    sample = np.linspace(0, len(motion) - 1, LOOPS).astype(int)
    crossings = [design.frozen(motion, int(k)).margin().first_crossing for k in sample]
    return (*certified, float(min(crossings)))
