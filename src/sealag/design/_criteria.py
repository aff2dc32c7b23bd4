"""The two criteria along a motion: certified (docs/theory section 6) and published ((29), (31))."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sealag.design._system import System
from sealag.passivity import (
    Criterion,
    Solver,
    max_delay,
    max_delay_from_stiffness,
    max_delay_multitask,
)
from sealag.robot import Motion
from sealag.typing import Array, BoolArray
from sealag.units import time_text
from sealag.whole_body import Rest, Spaces, StiffnessForm, TaskError, relative_asymmetry

ASYMMETRY_TOLERANCE = 1e-7
"""Relative asymmetry up to which a stiffness counts as symmetric: rounding, and the error of the
central differences behind the gradient of gravity compensation."""

PROOF_SHARE = 1.0 - 1e-7
"""Delays are certified this far below their supremum, where a multiplier has room for rounding."""

PUBLISHED_SHARE = 1.0 - 5e-7
"""The same for (29) and (31), whose multipliers grow without end at the supremum where J* loses
rank."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """A criterion's answer at every instant.

    Attributes:
        delay: (N,) s, 0 where a condition of the criterion fails.
        upper: (N,) s, upper end of the bracket.
        F: (N, n, n) the stiffness that the criterion uses, Nm/rad.
        angle: (N,) angle at which its numerical radius is reached, rad.
        reasons: which conditions fail, in words.
        left_open: why a solver proved no longer delay at the worst instant; empty if it did its
            part.
    """

    delay: Array
    upper: Array
    F: Array
    angle: Array
    reasons: tuple[str, ...]
    left_open: str = ""


def certified_bounds(
    spaces: Spaces, system: System, rest: Rest | None = None, motion: Motion | None = None
) -> Bounds:
    """Bound of docs/theory section 6 for the law that is run.

    Sufficient for a passive controller side along the frozen motion: the signal is one that a
    potential can belong to, the drives are ideal, the motors carry the static load, no direction is
    lost that comes back beside the instant, the whole delayed stiffness F_θ is symmetric, the task
    stiffness positive semidefinite, and d_1 ≤ 1 / w(D^-½ F_θ D^-½).

    Args:
        spaces: the law's matrices.
        system: the design.
        rest: where the loop rests in its posture; None for a motion.
        motion: whose speeds the motors must reach; None for a posture.
    """
    good, reasons = np.ones(len(spaces), dtype=bool), list[str]()
    for refused, words in _refusals(spaces, system, rest, motion):
        if (good & refused).any():
            reasons.append(words)
            good &= ~refused
    F = np.where(np.isfinite(spaces.F_theta), spaces.F_theta, 0.0)
    bound = max_delay_from_stiffness(F, system.actuators.motor_damping)
    return Bounds(
        delay=np.where(good, PROOF_SHARE * bound.delay, 0.0),
        upper=np.where(good, bound.upper, 0.0),
        F=F,
        angle=bound.angle,
        reasons=tuple(reasons),
    )


def _refusals(
    spaces: Spaces, system: System, rest: Rest | None, motion: Motion | None
) -> Iterator[tuple[BoolArray, str]]:
    """Instants (N,) at which the criterion does not hold, and why, in words."""
    count, everywhere = len(spaces), np.ones(len(spaces), dtype=bool)
    signal = system.law.signal.refusal(spaces.contraction)
    if signal is not None:
        yield signal.instants, signal.reason
    for words in _drive_refusals(system):
        yield everywhere, words
    for i, joint in enumerate(system.robot.joints):
        load, limit = np.abs(spaces.gravity[:, i]), system.actuators.torque_limit[i]
        if rest is not None:
            load = np.maximum(load, abs(float(rest.tau_sea[i])))
        yield (
            load > limit,
            (
                f"the motor of {joint} gives at most {limit:g} Nm, and gravity asks for "
                f"{load.max():.3g} Nm at {(load > limit).sum()} of {count} instants"
            ),
        )
    for i, joint in enumerate(system.robot.joints):
        limit = system.actuators.velocity_limit[i]
        speed = np.abs(np.zeros(count) if motion is None else motion.v[:, system.robot.nv_base + i])
        yield (
            speed > limit,
            (
                f"the motor of {joint} reaches at most {limit:g} rad/s or m/s, and the motion asks "
                f"for {speed.max():.3g} at {(speed > limit).sum()} of {count} instants"
            ),
        )
    yield (
        spaces.singular,
        (
            f"contacts or tasks lose a direction at {spaces.singular.sum()} of {count} instants "
            "that they have beside it, where the stiffness jumps; certify postures away from the "
            "singularity"
        ),
    )
    bent = ~(spaces.asymmetry <= ASYMMETRY_TOLERANCE)
    if bent.any():
        yield (
            bent,
            (
                f"the fed-back stiffness is not symmetric at {bent.sum()} of {count} instants "
                f"(asymmetry up to {spaces.asymmetry[bent].max():.2e}, from "
                f"{_asymmetry_source(system)}), so that no potential belongs to it"
            ),
        )
    negative = ~_semidefinite(spaces.F_task)
    yield negative, f"the task stiffness is indefinite at {negative.sum()} of {count} instants"


def _drive_refusals(system: System) -> Iterator[str]:
    """Why drives that are late are covered by no passive bound (docs/theory section 14)."""
    slow = np.flatnonzero(np.isfinite(system.actuators.torque_bandwidth))
    if len(slow):
        joint, rate = system.robot.joints[slow[0]], system.actuators.torque_bandwidth[slow[0]]
        yield (
            f"the torque of {joint} follows its command with {rate:g} rad/s (torque_bandwidth), so "
            "that motor damping and torque feedback come late: no passivity bound covers it; rely "
            "on the local margin"
        )
    if system.late_joints:
        yield (
            f"the torque feedback of {system.late_joints[0]} is late by "
            f"{time_text(system.delays.torque_feedback_delay)} (delayed_torque_feedback, "
            "inertia_shaping other than 1): no passivity bound covers it; rely on the local margin"
        )


def _asymmetry_source(system: System) -> str:
    """What makes a stiffness asymmetric."""
    if system.law.stiffness_form is StiffnessForm.PUBLISHED:
        return "the stiffness Λ K_x"
    if system.law.task_error is TaskError.PLAIN and len(system.law.levels(system.robot)) > 2:
        return "lower tasks that feed back what higher ones move"
    return "fed-back gravity compensation where contacts or free motions make joints dependent"


def _semidefinite(F: Array) -> Array:
    values = np.linalg.eigvalsh((F + np.swapaxes(F, -1, -2)) / 2.0)
    return values[:, 0] >= -1e-9 * np.maximum(np.abs(values).max(axis=1), 1e-300)


def task_stiffness(spaces: Spaces, system: System, kind: Criterion) -> Array:
    """Return the task stiffness S that a criterion uses, (N, m, m).

    Args:
        spaces: the law's matrices.
        system: the design.
        kind: published takes Λ K_x whatever is run, unless the stiffness has no Λ.
    """
    if kind is Criterion.CERTIFIED:
        return spaces.stiffness
    if system.law.stiffness_form is StiffnessForm.FORCE:
        return np.broadcast_to(spaces.K_x, spaces.stiffness.shape)
    return spaces.Lambda @ spaces.K_x


def asymmetry(spaces: Spaces, bounds: Bounds, kind: Criterion) -> Array:
    """Return the relative asymmetry that a certificate states, (N,).

    Args:
        spaces: the law's matrices.
        bounds: of the criterion.
        kind: published states that of its own stiffness, certified that of what is fed back.
    """
    return relative_asymmetry(bounds.F) if kind is Criterion.PUBLISHED else spaces.asymmetry


def published_bounds(spaces: Spaces, system: System, *, solver: Solver | None = None) -> Bounds:
    """Bound of (29), or of (31) for several priority levels, as printed.

    Args:
        spaces: the law's matrices.
        system: the design.
        solver: where multipliers of several levels come from; Clarabel's own interface if None.
    """
    D = system.actuators.motor_damping
    form = system.law.stiffness_form.printed
    levels = [spaces.level(k) for k in range(len(spaces.levels) - 1)]
    S = task_stiffness(spaces, system, Criterion.PUBLISHED)
    F = np.swapaxes(spaces.J_star, -1, -2) @ S @ spaces.J_star
    whole = max_delay_from_stiffness(F, D)
    if len(levels) == 1:
        bound = max_delay(*levels[0], D, form=form)
        return Bounds(
            delay=PUBLISHED_SHARE * bound.delay,
            upper=bound.upper,
            F=F,
            angle=bound.angle,
            reasons=(),
        )
    many = max_delay_multitask(levels, D, form=form, solve=False)
    delay, settled = np.array(many.delay), dict[int, str]()
    while (k := int(np.argmin(delay))) not in settled:
        one = [(J[k], Lambda[k], K_x) for J, Lambda, K_x in levels]
        found = max_delay_multitask(one, D, form=form, solver=solver)
        delay[k], settled[k] = max(delay[k], float(found.delay)), found.reason
    return Bounds(
        delay=PUBLISHED_SHARE * delay,
        upper=many.upper,
        F=F,
        angle=whole.angle,
        reasons=(),
        left_open=settled[k],
    )
