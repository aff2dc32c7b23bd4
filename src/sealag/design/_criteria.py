"""The two criteria along a motion: certified (THEORY section 6) and published ((29), (31))."""

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
from sealag.typing import Array
from sealag.whole_body import (
    Feedback,
    StiffnessForm,
    TankFlow,
    TaskError,
    WholeBodyStack,
    relative_asymmetry,
)

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


def certified_bounds(stack: WholeBodyStack, system: System) -> Bounds:
    """Bound of THEORY section 6 for the law that is run.

    Sufficient for a passive controller side along the frozen motion: the whole delayed stiffness
    F_θ is symmetric, the task stiffness positive semidefinite, q̄(θ) a contraction where it is fed
    back, and d_1 ≤ 1 / w(D^-½ F_θ D^-½).

    Args:
        stack: the controller's matrices.
        system: the design.
    """
    reasons: list[str] = []
    good = np.ones(len(stack), dtype=bool)
    if system.feedback is Feedback.JOINT:
        reasons.append(
            "link angles are fed back, which is not collocated with the motors: no passivity "
            "bound covers it; rely on the local margin"
        )
        good[:] = False
    if system.feedback is Feedback.STATIC_JOINT_TANK and system.tank.flow is TankFlow.PUBLISHED:
        reasons.append(
            "the published flow of the energy tank does not pay for u's work on the spring "
            "potential; the corrected flow does"
        )
        good[:] = False
    if system.feedback is Feedback.STATIC_JOINT and (stack.contraction >= 1.0).any():
        bad = stack.contraction >= 1.0
        reasons.append(
            f"q̄(θ) is no contraction at {bad.sum()} of {len(bad)} instants (factor up to "
            f"{stack.contraction.max():.2f}): the task is stiffer than the springs"
        )
        good &= ~bad
    crooked = good & ~(stack.asymmetry <= ASYMMETRY_TOLERANCE)
    if crooked.any():
        source = _crooked_source(system)
        reasons.append(
            f"the fed-back stiffness is not symmetric at {crooked.sum()} of {len(good)} instants "
            f"(asymmetry up to {stack.asymmetry[crooked].max():.2e}, from {source}), so that no "
            "potential belongs to it"
        )
        good &= ~crooked
    negative = good & ~_semidefinite(stack.F_task)
    if negative.any():
        reasons.append(
            f"the task stiffness is indefinite at {negative.sum()} of {len(good)} instants"
        )
        good &= ~negative
    F = np.where(np.isnan(stack.F_theta), 0.0, stack.F_theta)
    bound = max_delay_from_stiffness(F, system.actuators.motor_damping)
    return Bounds(
        delay=np.where(good, PROOF_SHARE * bound.delay, 0.0),
        upper=np.where(good, bound.upper, 0.0),
        F=F,
        angle=bound.angle,
        reasons=tuple(reasons),
    )


def _crooked_source(system: System) -> str:
    """What makes a stiffness asymmetric."""
    if system.hierarchy.form is StiffnessForm.PUBLISHED:
        return "the stiffness Λ K_x"
    if system.task_error is TaskError.PLAIN and len(system.hierarchy.levels(system.robot)) > 2:
        return "lower tasks that feed back what higher ones move"
    return "fed-back gravity compensation where contacts or free motions make joints dependent"


def _semidefinite(F: Array) -> Array:
    values = np.linalg.eigvalsh((F + np.swapaxes(F, -1, -2)) / 2.0)
    return values[:, 0] >= -1e-9 * np.maximum(np.abs(values).max(axis=1), 1e-300)


def task_stiffness(stack: WholeBodyStack, system: System, kind: Criterion) -> Array:
    """Return the task stiffness S that a criterion uses, (N, m, m).

    Args:
        stack: the controller's matrices.
        system: the design.
        kind: published takes Λ K_x whatever is run, unless the stiffness has no Λ.
    """
    if kind is Criterion.CERTIFIED:
        return stack.stiffness
    if system.hierarchy.form is StiffnessForm.FORCE:
        return np.broadcast_to(stack.K_x, stack.stiffness.shape)
    return stack.Lambda @ stack.K_x


def asymmetry(stack: WholeBodyStack, bounds: Bounds, kind: Criterion) -> Array:
    """Return the relative asymmetry that a certificate states, (N,).

    Args:
        stack: the controller's matrices.
        bounds: of the criterion.
        kind: published states that of its own stiffness, certified that of what is fed back.
    """
    return relative_asymmetry(bounds.F) if kind is Criterion.PUBLISHED else stack.asymmetry


def published_bounds(
    stack: WholeBodyStack, system: System, *, solver: Solver | None = None
) -> Bounds:
    """Bound of (29), or of (31) for several priority levels, as printed.

    Args:
        stack: the controller's matrices.
        system: the design.
        solver: where multipliers of several levels come from; Clarabel's own interface if None.
    """
    D = system.actuators.motor_damping
    form = system.hierarchy.form.printed
    levels = [stack.level(k) for k in range(len(stack.levels) - 1)]
    S = task_stiffness(stack, system, Criterion.PUBLISHED)
    F = np.swapaxes(stack.J_star, -1, -2) @ S @ stack.J_star
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
