"""From a system and a motion to a certificate."""

import sys
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from sealag import __version__
from sealag.design._project import System
from sealag.errors import SolverError
from sealag.margin import DelayMargin, delay_margin
from sealag.passivity import (
    Certificate,
    Criterion,
    Proof,
    Status,
    Worst,
    joint_multiplier,
    limiting_direction,
    max_delay,
    max_delay_common_from_stiffness,
    max_delay_from_stiffness,
    max_delay_multitask,
    max_delay_polytope_from_stiffness,
)
from sealag.robot import Motion
from sealag.typing import Array
from sealag.whole_body import (
    Feedback,
    GravityCompensation,
    StiffnessForm,
    WholeBodyStack,
    evaluate,
    linearise,
)

ASYMMETRY_TOLERANCE = 1e-7
"""Relative asymmetry up to which a stiffness counts as symmetric: rounding, and the error of the
central differences behind the gradient of gravity compensation."""

PROOF_SHARE = 1.0 - 1e-7
POLYTOPE_WINDOW = 20
"""Delays are certified this far below their supremum, where a multiplier has room for rounding."""

PROOF_COUNT = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """A criterion's answer at every instant.

    Attributes:
        delay: (N,) s, 0 where a condition of the criterion fails.
        upper: (N,) s, upper end of the bracket.
        F: (N, n, n) the stiffness that the criterion uses, Nm/rad.
        angle: (N,) angle at which its numerical radius is reached, rad.
        reasons: which conditions fail, in words.
    """

    delay: Array
    upper: Array
    F: Array
    angle: Array
    reasons: tuple[str, ...]


def certify(
    system: System,
    motion: Motion | None = None,
    *,
    criterion: Criterion | str | None = None,
    time_varying: bool = False,
) -> Certificate:
    """Certify how much delay a design tolerates at every instant of a motion.

    Args:
        system: the design.
        motion: the motion; the system's posture if None.
        criterion: certified (THEORY section 6) or published ((29), (31) as printed); the
            system's own if None.
        time_varying: also bound the delay for matrices that move inside polytopes around the
            motion (about a second more); criterion certified only.

    Returns:
        The certificate; not certified is a result, not an error.

    Raises:
        RobotError: a mass matrix is not positive definite.
        UnknownNameError: a frame or joint does not exist.
    """
    motion = system.still() if motion is None else motion
    kind = system.criterion if criterion is None else Criterion(criterion)
    stack = evaluate(
        system.robot,
        system.hierarchy,
        system.actuators,
        motion=motion,
        feedback=system.feedback,
        gravity=system.gravity,
    )
    published = published_bounds(stack, system)
    bounds = published if kind is Criterion.PUBLISHED else certified_bounds(stack, system)
    worst = int(np.argmin(bounds.delay))
    shares = limiting_direction(
        bounds.F[worst], system.actuators.motor_damping, bounds.angle[worst]
    )
    margin, stable = _local(system, motion, stack, instant=worst)
    max_delay_s, delay_s = float(bounds.delay[worst]), system.delays.d_1
    reasons = list(bounds.reasons)
    if not reasons and delay_s > max_delay_s:
        reasons.append(
            f"the design's delay of {delay_s * 1e3:.3f} ms exceeds the bound of "
            f"{max_delay_s * 1e3:.3f} ms"
        )
    shared = kind is Criterion.CERTIFIED and len(motion) > 1 and not bounds.reasons
    common_s, common = _common(system, bounds) if shared else (None, None)
    varying_s, varying = (
        _time_varying(system, motion, bounds) if shared and time_varying else (None, None)
    )
    finite = margin is not None and 0.0 < margin.delay < np.inf and max_delay_s > 0.0
    return Certificate(
        status=Status.NOT_CERTIFIED if reasons else Status.CERTIFIED,
        criterion=kind,
        max_delay_s=max_delay_s,
        max_delay_upper_s=float(bounds.upper.min()),
        delay_s=delay_s,
        asymmetry=float(np.max(stack.asymmetry)),
        contraction=float(stack.contraction.max()),
        worst=Worst(
            instant=worst,
            time_s=float(motion.time[worst]),
            direction=dict(zip(system.robot.joints, shares.tolist(), strict=True)),
        ),
        instants=len(motion),
        feedback=system.feedback.value,
        gravity=system.gravity.value,
        stiffness_form=system.hierarchy.form.value,
        task_inertia=system.hierarchy.task_inertia.value,
        stable=stable,
        local_margin_s=float(margin.delay) if margin else None,
        first_crossing_s=float(margin.first_crossing) if margin else None,
        unstable_modes=margin.unstable_roots if margin else 0,
        conservatism=margin.delay / max_delay_s if margin and finite else None,
        common_multiplier_delay_s=common_s,
        common_multiplier=common,
        time_varying_delay_s=varying_s,
        time_varying_multiplier=varying,
        published_max_delay_s=float(published.delay.min()),
        reasons=tuple(reasons),
        assumptions=_assumptions(system, kind, motion),
        joints=system.robot.joints,
        D_theta=system.actuators.motor_damping.tolist(),
        spring_stiffness=system.actuators.spring_stiffness.tolist(),
        time_s=motion.time.tolist(),
        bounds_s=bounds.delay.tolist(),
        proofs=_proofs(system, stack, bounds, kind=kind),
        hashes={"urdf": system.robot.urdf_sha256, "project": system.sha256},
        versions={
            "sealag": __version__,
            "python": sys.version.split()[0],
            **{name: version(name) for name in ("numpy", "scipy", "numba", "pin")},
        },
    )


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
    if system.feedback is Feedback.STATIC_JOINT and (stack.contraction >= 1.0).any():
        bad = stack.contraction >= 1.0
        reasons.append(
            f"q̄(θ) is no contraction at {bad.sum()} of {len(bad)} instants (factor up to "
            f"{stack.contraction.max():.2f}): the task is stiffer than the springs"
        )
        good &= ~bad
    crooked = good & ~(stack.asymmetry <= ASYMMETRY_TOLERANCE)
    if crooked.any():
        source = (
            "fed-back gravity compensation where contacts or free motions make joints dependent"
            if system.hierarchy.form is not StiffnessForm.PUBLISHED
            else "the stiffness Λ K_x"
        )
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


def _semidefinite(F: Array) -> Array:
    values = np.linalg.eigvalsh((F + np.swapaxes(F, -1, -2)) / 2.0)
    return values[:, 0] >= -1e-9 * np.maximum(np.abs(values).max(axis=1), 1e-300)


def published_bounds(stack: WholeBodyStack, system: System) -> Bounds:
    """Bound of (29), or of (31) for several priority levels, as printed.

    Args:
        stack: the controller's matrices.
        system: the design.
    """
    D = system.actuators.motor_damping
    force = system.hierarchy.form is StiffnessForm.FORCE
    form = StiffnessForm.FORCE if force else StiffnessForm.PUBLISHED
    levels = [stack.level(k) for k in range(len(stack.levels) - 1)]
    S = stack.K_x if force else stack.Lambda @ stack.K_x
    F = np.swapaxes(stack.J_star, -1, -2) @ S @ stack.J_star
    whole = max_delay_from_stiffness(F, D)
    if len(levels) == 1:
        bound = max_delay(*levels[0], D, form=form)
        return Bounds(
            delay=PROOF_SHARE * bound.delay,
            upper=bound.upper,
            F=F,
            angle=bound.angle,
            reasons=(),
        )
    many = max_delay_multitask(levels, D, form=form, solve=False)
    delay, settled = np.array(many.delay), np.zeros(len(stack), dtype=bool)
    while not settled[k := int(np.argmin(delay))]:
        one = [(J[k], Lambda[k], K_x) for J, Lambda, K_x in levels]
        delay[k] = max(delay[k], float(max_delay_multitask(one, D, form=form).delay))
        settled[k] = True
    return Bounds(delay=PROOF_SHARE * delay, upper=many.upper, F=F, angle=whole.angle, reasons=())


def _common(system: System, bounds: Bounds) -> tuple[float, list[list[float]] | None]:
    """Bound with one multiplier for the whole motion, and the multiplier."""
    found = max_delay_common_from_stiffness(bounds.F, system.actuators.motor_damping)
    return PROOF_SHARE * found.delay, None if found.W is None else found.W.tolist()


def _time_varying(
    system: System, motion: Motion, bounds: Bounds
) -> tuple[float, list[list[float]] | None]:
    """Bound for stiffnesses that vary inside polytopes around the motion, and its multiplier."""
    found = max_delay_polytope_from_stiffness(
        bounds.F,
        system.actuators.motor_damping,
        window=POLYTOPE_WINDOW,
        breaks=(np.flatnonzero(np.diff(motion.contact_index)) + 1).tolist(),
    )
    return PROOF_SHARE * found.delay, None if found.W is None else found.W.tolist()


def _local(
    system: System, motion: Motion, stack: WholeBodyStack, *, instant: int
) -> tuple[DelayMargin | None, bool | None]:
    """Exact local margin at an instant (None if undecided), and whether its potential has a
    minimum."""
    F = stack.F_theta[instant]
    if not np.isfinite(F).all():
        return None, None
    frozen = linearise(
        system.robot,
        system.actuators,
        motion.q[instant],
        contacts=motion.contact_sets[motion.contact_index[instant]],
        F=F,
        feedback=system.feedback,
    )
    try:
        margin = delay_margin(frozen.A_0, frozen.A_1, symmetries=frozen.symmetries)
    except SolverError:
        margin = None
    symmetric = stack.asymmetry[instant] <= ASYMMETRY_TOLERANCE
    potential = symmetric and system.feedback is not Feedback.JOINT
    return margin, frozen.stable if potential else None


def _criterion_stiffness(system: System, stack: WholeBodyStack, kind: Criterion) -> Array:
    """The task stiffness that a criterion is about, (N, m, m)."""
    if kind is Criterion.CERTIFIED:
        return stack.stiffness
    force = system.hierarchy.form is StiffnessForm.FORCE
    return np.broadcast_to(stack.K_x, stack.Lambda.shape) if force else stack.Lambda @ stack.K_x


def _proofs(
    system: System, stack: WholeBodyStack, bounds: Bounds, *, kind: Criterion
) -> tuple[Proof, ...]:
    """Numbers to check for the instants with the smallest bounds."""
    usable = np.flatnonzero((bounds.delay > 0.0) & np.isfinite(bounds.delay))
    chosen = usable[np.argsort(bounds.delay[usable], kind="stable")][:PROOF_COUNT]
    D = system.actuators.motor_damping
    S = _criterion_stiffness(system, stack, kind)
    return tuple(
        Proof(
            instant=int(k),
            delay_s=float(bounds.delay[k]),
            J_star=stack.J_star[k].tolist(),
            stiffness=S[k].tolist(),
            F_gravity=stack.F_gravity[k].tolist(),
            F=bounds.F[k].tolist(),
            Y=joint_multiplier(bounds.F[k], D, float(bounds.delay[k])).tolist(),
        )
        for k in chosen
    )


def _assumptions(system: System, criterion: Criterion, motion: Motion) -> tuple[str, ...]:
    said = [
        "coefficients are frozen at each instant (quasi-static: the multiplier may differ from "
        "instant to instant; `common_multiplier_delay_s` is the bound with a single one)",
        "the embedded motor damping D_θ acts without delay",
        f"d_1 is at most {system.delays.d_1 * 1e3:.3f} ms; it may vary below that",
        "contacts neither slip nor lift off",
    ]
    if system.gravity is GravityCompensation.PLANNED:
        said.append("gravity compensation comes from the plan and has no feedback gradient")
    if system.feedback is Feedback.STATIC_JOINT_TANK:
        said.append("the energy tank pays for all that u does and never runs empty")
    if criterion is Criterion.PUBLISHED:
        said.append(
            "the criterion is (29)/(31) as printed: it takes Λ K_x for symmetric, x(θ) for what is "
            "fed back and gravity for not delayed, and can certify what is unstable"
        )
    else:
        said.append("passive is not stable: `stable` and the local margin are separate answers")
    if len(motion) > 1:
        said.append("the motion's instants are checked, not what lies between them")
    return tuple(said)
