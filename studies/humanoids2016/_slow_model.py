"""Fig. 2: a kinematics and dynamics model that is updated more slowly than the controller ticks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._figure4 import stance_columns
from humanoids2016._live import stance_masses
from humanoids2016._unsafe import delayed_margin
from sealag.design import System, simulate
from sealag.passivity import Instant, Problem, solve
from sealag.robot import Motion, load_robot
from sealag.simulation import Run
from sealag.typing import Array
from sealag.whole_body import MotorAngles, StiffnessForm, Task, TaskKind

PERIODS = (0.0, 0.005, 0.02, 0.05, 0.1, 0.2)
"""s between two updates; 0 is one at every tick."""
MARGINS = 40
"""Instants whose exact margins are computed."""
SWING = {"scenario": "track", "track_amplitude": 0.15, "track_frequency_hz": 1.0}
SWING_TIME = 3.0  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowModel:
    """What one period does.

    Attributes:
        period: s between two updates.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖ of F = J*_uᵀ S_u J* along the walk, u the last
            update, while the feet of the update stand.
        stale_asymmetry: the same once the support has changed and no update followed yet; NaN if
            that never is.
        bound_s: smallest bound of (29) along the walk while the feet of the update stand, s.
        unstable: of the instants tried, at how many the stance leg, its torso held, is unstable
            without delay.
        margin_s: smallest exact margin of that leg at the others, s.
        stale: of the instants tried, at how many the support has changed since the update.
        away_rad: RMS deviation of the joints of a swinging leg from the same swing with a model of
            every tick, rad.
        torque_nm: largest deviation of its spring torques, Nm.
        outcome: how the swing ended.
    """

    period: float
    asymmetry: float
    stale_asymmetry: float
    bound_s: float
    unstable: int
    margin_s: float
    stale: int
    away_rad: float
    torque_nm: float
    outcome: str


def slow_models(
    system: System, motion: Motion, *, periods: Sequence[float] = PERIODS
) -> tuple[SlowModel, ...]:
    """Hold J* and S between updates, along the planned walk and in the simulator.

    Args:
        system: Hume with the paper's gains.
        motion: the planned walk.
        periods: s between two updates; the first one is the reference of the simulation.
    """
    law = replace(system.law, signal=MotorAngles(), stiffness_form=StiffnessForm.SYMMETRIC)
    design = replace(system, law=law)
    spaces, robot = design.spaces(motion), system.robot
    columns = stance_columns(robot, motion)
    pick = np.unique(np.linspace(0, len(motion) - 1, MARGINS).astype(int)).tolist()
    masses = stance_masses(robot, motion, pick)
    first = _swing(system, 0.0)
    found = []
    for period in periods:
        held = _last_update(motion.time, period)
        standing = motion.contact_index[held] == motion.contact_index
        J_u, S_u = spaces.J_star[held], spaces.stiffness[held]
        F = np.swapaxes(J_u, 1, 2) @ S_u @ spaces.J_star
        asymmetry = _norm(F - np.swapaxes(F, 1, 2)) / _norm(F + np.swapaxes(F, 1, 2))
        problem = Problem.of_stiffness(F[standing], system.actuators.motor_damping)
        margins = np.array([
            _leg_margin(system, M, F[k], columns[k].tolist())
            for M, k in zip(masses, pick, strict=True)
        ])  # fmt: skip
        run = first if period == 0.0 else _swing(system, period)
        rows = min(len(run.time), len(first.time))
        away = run.q[:rows] - first.q[:rows]
        found.append(
            SlowModel(
                period=period,
                asymmetry=float(asymmetry[standing].max()),
                stale_asymmetry=float(asymmetry[~standing].max(initial=-np.inf)),
                bound_s=float(solve(problem, share=Instant()).delay.min()),
                unstable=int((margins == 0.0).sum()),
                margin_s=float(margins[margins > 0.0].min(initial=np.inf)),
                stale=int((~standing[pick]).sum()),
                away_rad=float(np.sqrt(np.mean(away**2))),
                torque_nm=float(np.abs(run.tau_sea[:rows] - first.tau_sea[:rows]).max()),
                outcome=run.outcome.value,
            )
        )
    return tuple(found)


def _leg_margin(system: System, M: Array, F: Array, columns: Sequence[int]) -> float:
    """Exact margin of the stance leg with its torso held, s."""
    drives, leg = system.actuators, list(columns)
    return delayed_margin(
        M, drives.spring_stiffness[leg], drives.shaped_inertia[leg],
        D=drives.motor_damping[leg], F=F[np.ix_(leg, leg)],
    ).delay  # fmt: skip


def _norm(matrices: Array) -> Array:
    return np.linalg.norm(matrices, axis=(1, 2))


def _last_update(time: Array, period: float) -> Array:
    """Index of the last instant at which an update fell due, for each instant (N,)."""
    if period <= 0.0:
        return np.arange(len(time))
    due = np.floor((time - time[0]) / period + 1e-9)
    return np.searchsorted(due, due, "left")


def _swing(system: System, period: float) -> Run:
    """The right foot swings forth and back."""
    held = held_legs(system)
    setting = held.simulation.model_copy(update={**SWING, "model_period_ms": period * 1e3})
    return simulate(replace(held, simulation=setting), duration=SWING_TIME)


def held_legs(system: System) -> System:
    """Return Hume's legs with the torso held, both feet in the air and placed by the paper's law.

    Args:
        system: Hume.
    """
    robot = load_robot(system.robot.urdf_path, floating_base=False, actuated=system.robot.joints)
    gain = np.array(100.0)
    tasks = tuple(
        Task(name=foot, kind=TaskKind.POSITION, frame=foot, stiffness=gain)
        for foot in ("right_foot", "left_foot")
    )
    law = replace(
        system.law, tasks=tasks, signal=MotorAngles(), stiffness_form=StiffnessForm.SYMMETRIC
    )
    posture = system.posture[-robot.n :]
    return replace(system, robot=robot, posture=posture, contacts=(), law=law, walking=None)
