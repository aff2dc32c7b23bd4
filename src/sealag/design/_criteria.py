"""Bounds along a motion and their proofs, by the certified criterion (docs/theory section 6) and by
the published one ((29), (31))."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sealag import passivity
from sealag.design._along import Along
from sealag.design._design import Design
from sealag.errors import SolverError
from sealag.passivity import Bound, Criterion, InstantProof, Problem, Solver, solve
from sealag.robot import Motion
from sealag.store import Store, release
from sealag.typing import Array, BoolArray
from sealag.units import time_text
from sealag.whole_body import Rest, Spaces, StiffnessForm, TaskError

ASYMMETRY_TOLERANCE = 1e-7
"""Relative asymmetry up to which a stiffness counts as symmetric: rounding, and the error of the
central differences behind the gradient of gravity compensation. Ten times less refuses honest
designs; ten times more is refused by `verify`."""

PROOF_SHARE = 1.0 - 1e-7
"""Delays are certified this far below their supremum, where a multiplier has room for rounding. Ten
times closer, `verify` without --exact is in doubt; ten times further costs 1e-6 of the delay."""

POLYTOPE_WIDTH = 20
"""Intervals between instants in one window of the time-varying bound."""

PUBLISHED_SHARE = 1.0 - 5e-7
"""The same for (29) and (31), whose multipliers grow without bound at the supremum where J* loses
rank."""


def certified_bounds(
    spaces: Spaces, system: Design, rest: Rest | None, motion: Motion | None
) -> Bound:
    """Bound every instant as `System.certified_bounds` says.

    Args:
        spaces: the law's matrices.
        system: the design.
        rest: where the loop rests in its posture; None for a motion.
        motion: whose speeds the motors must reach; None for a posture.
    """
    conditions = Conditions.room(system, len(spaces))
    conditions.put(slice(None), spaces)
    return conditions.refuse(_unconditional(spaces, system), rest, motion)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundsAlong:
    """What a criterion says of a motion.

    Attributes:
        bound: of each instant, 0 where a condition fails.
        published: smallest bound by (29) or (31), s; NaN if it was not asked for, or only a
            semidefinite program tells it and the criterion is another.
        asymmetry: largest relative asymmetry of the criterion's stiffness.
        contraction: largest contraction factor of q̄(θ).
    """

    bound: Bound
    published: float
    asymmetry: float
    contraction: float


def bounds_along(
    along: Along,
    kind: Criterion,
    *,
    rest: Rest | None = None,
    published: bool = False,
    solver: Solver | None = None,
) -> BoundsAlong:
    """Bound every instant of a motion, however long, as `certified_bounds` or `published_bounds`.

    Args:
        along: the design and its motion.
        kind: which of the two.
        rest: where the loop rests in its posture; None for a motion.
        published: whether to bound by (29) or (31) beside the certified criterion too.
        solver: where multipliers of several levels come from; Clarabel's own interface if None.
    """
    system, count, printed = along.system, len(along.motion), kind is Criterion.PUBLISHED
    conditions, whole = Conditions.room(system, count), Bound.by_parts(count)
    # (29) and (31) are of gains that stay.
    published = printed or (published and along.motion.stiffness is None)
    least, asymmetry = np.inf if published else np.nan, 0.0
    for rows, spaces in along.parts():
        told = _told(spaces, system, kind, solver) if published else None
        least = np.nan if told is None else np.minimum(least, told.delay.min())
        part = told if printed and told is not None else _unconditional(spaces, system)
        whole.add(rows, part)
        conditions.put(rows, spaces)
        F = delayed_stiffness(spaces, system, kind) if printed else None
        bent = spaces.asymmetry if F is None else Spaces.relative_asymmetry(F)
        asymmetry = np.maximum(asymmetry, bent.max())
    bound = whole.bound if printed else conditions.refuse(whole.bound, rest, along.motion)
    return BoundsAlong(
        bound=bound,
        published=float(least),
        asymmetry=float(asymmetry),
        contraction=float(conditions.contraction.max()),
    )


def _unconditional(spaces: Spaces, system: Design) -> Bound:
    """The bound of each instant if no condition failed."""
    F = delayed_stiffness(spaces, system, Criterion.CERTIFIED)
    problem = Problem.of_stiffness(F, system.actuators.motor_damping)
    return solve(problem, share=passivity.Instant()).eased(PROOF_SHARE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What the conditions of the certified criterion measure at N instants.

    Attributes:
        system: the design.
        contraction: (N,) contraction factor of q̄(θ).
        asymmetry: (N,) ‖F_θ − F_θᵀ‖ / ‖F_θ + F_θᵀ‖.
        singular: (N,) whether a contact or task loses a direction.
        indefinite: (N,) whether the task stiffness is.
        load: (N, n) torque that gravity needs, Nm.
    """

    system: Design
    contraction: Array
    asymmetry: Array
    singular: BoolArray
    indefinite: BoolArray
    load: Array

    @classmethod
    def room(cls, system: Design, count: int) -> "Conditions":
        """Return room for what is measured at some instants, to be filled by `put`.

        Args:
            system: the design.
            count: how many instants.
        """
        n = system.robot.n
        store = Store.of(count, n, what="A motion", remedy="certify fewer of its instants")
        return cls(
            system=system,
            contraction=np.zeros(count),
            asymmetry=np.zeros(count),
            singular=np.zeros(count, dtype=bool),
            indefinite=np.zeros(count, dtype=bool),
            load=store.zeros((count, n)),
        )

    def put(self, rows: slice, spaces: Spaces) -> None:
        """Measure the conditions at instants of a part of a motion.

        Args:
            rows: which instants these are.
            spaces: the law's matrices there.
        """
        self.contraction[rows], self.asymmetry[rows] = spaces.contraction, spaces.asymmetry
        self.singular[rows], self.load[rows] = spaces.singular, np.abs(spaces.gravity)
        self.indefinite[rows] = ~_semidefinite(spaces.F_task)
        release(self.load)

    def refuse(self, bound: Bound, rest: Rest | None, motion: Motion | None) -> Bound:
        """Return a bound with no delay where a condition fails.

        Args:
            bound: of each instant.
            rest: where the loop rests in its posture; None for a motion.
            motion: whose speeds the motors must reach; None for a posture.
        """
        for refused, words in self._refusals(rest, motion):
            if (refused & (bound.delay > 0.0)).any():
                bound = bound.refused(refused, words)
        release(self.load, None if motion is None else motion.v)
        return bound

    def _refusals(
        self, rest: Rest | None, motion: Motion | None
    ) -> Iterator[tuple[BoolArray, str]]:
        """Instants (N,) at which a condition fails, and which, in words."""
        system, count = self.system, len(self.singular)
        joints, drives = system.robot.joints, system.actuators
        signal = system.law.signal.refusal(self.contraction)
        if signal is not None:
            yield signal.instants, signal.reason
        if system.law.damped:
            yield (
                np.ones(count, dtype=bool),
                (
                    f"the controller computes the damping of task {system.law.damped} from rates "
                    "that come late: no passivity bound covers it; rely on the jitter margin, or "
                    "give the damping to the drives (motor_damping)"
                ),
            )
        for words in _drive_refusals(system):
            yield np.ones(count, dtype=bool), words
        for i, joint in enumerate(joints):
            load, limit = self.load[:, i], drives.torque_limit[i]
            if rest is not None:
                load = np.maximum(load, abs(float(rest.tau_sea[i])))
            yield (
                load > limit,
                (
                    f"the motor of {joint} gives at most {limit:g} Nm, and gravity needs "
                    f"{load.max():.3g} Nm at {(load > limit).sum()} of {count} instants"
                ),
            )
        for i, joint in enumerate(joints):
            limit = drives.velocity_limit[i]
            rate = np.zeros(count) if motion is None else motion.v[:, system.robot.nv_base + i]
            speed = np.abs(rate)
            yield (
                speed > limit,
                (
                    f"the motor of {joint} reaches at most {limit:g} rad/s or m/s, and the motion "
                    f"needs {speed.max():.3g} at {(speed > limit).sum()} of {count} instants"
                ),
            )
        yield (
            self.singular,
            (
                f"contacts or tasks lose a direction at {self.singular.sum()} of {count} instants, "
                "where the Jacobian is singular and the stiffness jumps; certify postures away "
                "from the singularity"
            ),
        )
        bent = ~(self.asymmetry <= ASYMMETRY_TOLERANCE)
        if bent.any():
            yield (
                bent,
                (
                    f"the fed-back stiffness is not symmetric at {bent.sum()} of {count} instants "
                    f"(asymmetry up to {self.asymmetry[bent].max():.2e}, from "
                    f"{_asymmetry_source(system)}), so that it has no potential"
                ),
            )
        yield (
            self.indefinite,
            f"the task stiffness is indefinite at {self.indefinite.sum()} of {count} instants",
        )


def _drive_refusals(system: Design) -> Iterator[str]:
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


def _asymmetry_source(system: Design) -> str:
    """What makes a stiffness asymmetric."""
    if system.law.stiffness_form is StiffnessForm.PUBLISHED:
        return "the stiffness Λ K_x"
    if system.law.task_error is TaskError.PLAIN and len(system.law.levels(system.robot)) > 2:
        return "lower tasks that feed back what higher ones move"
    return "fed-back gravity compensation where contacts or free motions make joints dependent"


def _semidefinite(F: Array) -> Array:
    values = np.linalg.eigvalsh((F + np.swapaxes(F, -1, -2)) / 2.0)
    return values[:, 0] >= -1e-9 * np.maximum(np.abs(values).max(axis=1), 1e-300)


def task_stiffness(spaces: Spaces, system: Design, kind: Criterion) -> Array:
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


def delayed_stiffness(spaces: Spaces, system: Design, kind: Criterion) -> Array:
    """Return the motor-side stiffness F that a criterion uses, (N, n, n), Nm/rad.

    Args:
        spaces: the law's matrices.
        system: the design.
        kind: certified takes that of the signal that is fed back, published J*ᵀ S J*.
    """
    if kind is Criterion.CERTIFIED:
        return np.where(np.isfinite(spaces.F_theta), spaces.F_theta, 0.0)
    S = task_stiffness(spaces, system, kind)
    return np.swapaxes(spaces.J_star, -1, -2) @ S @ spaces.J_star


def published_bounds(spaces: Spaces, system: Design, *, solver: Solver | None = None) -> Bound:
    """Bound every instant by (29), or by (31) for several priority levels, as printed.

    Args:
        spaces: the law's matrices.
        system: the design.
        solver: where multipliers of several levels come from; Clarabel's own interface if None.

    Returns:
        The bound of each instant; of several levels the smallest one is as large as the solver
        proves, and others at least 1/Σ w(A_i).
    """
    return _published(_printed_problem(spaces, system), solver)


def _told(spaces: Spaces, system: Design, kind: Criterion, solver: Solver | None) -> Bound | None:
    """The published bound; None where only a semidefinite program tells it, which takes minutes for
    large robots, and the criterion is another."""
    problem = _printed_problem(spaces, system)
    asked = kind is Criterion.PUBLISHED or problem.closed_form
    return _published(problem, solver) if asked else None


def _printed_problem(spaces: Spaces, system: Design) -> Problem:
    return Problem.of_tasks(
        spaces.J_star,
        spaces.Lambda,
        spaces.K_x,
        system.actuators.motor_damping,
        levels=spaces.levels,
        form=system.law.stiffness_form.printed,
    )


def _published(problem: Problem, solver: Solver | None) -> Bound:
    bound = solve(problem, share=passivity.Instant(every=False), solver=solver)
    return bound.eased(PUBLISHED_SHARE)


def common_bound(bound: Bound, *, solver: Solver | None = None) -> Bound:
    """Bound a motion with one multiplier for all its instants, as V_4 needs it.

    Args:
        bound: of the certified criterion.
        solver: where multipliers come from; Clarabel's own interface if None.
    """
    return solve(bound.problem, share=passivity.Motion(), solver=solver).eased(PROOF_SHARE)


def time_varying_bound(bound: Bound, motion: Motion, *, solver: Solver | None = None) -> Bound:
    """Bound stiffnesses that vary as they like inside polytopes around a motion.

    Args:
        bound: of the certified criterion.
        motion: its instants; no window reaches across a change of contacts.
        solver: where multipliers come from; Clarabel's own interface if None.
    """
    breaks = np.flatnonzero(np.diff(motion.contact_index)) + 1
    share = passivity.Windows(width=POLYTOPE_WIDTH, breaks=breaks.tolist())
    return solve(bound.problem, share=share, solver=solver).eased(PROOF_SHARE)


def prove_instants(
    along: Along,
    bound: Bound,
    *,
    kind: Criterion,
    count: int | None,
    binding: tuple[int, ...] = (),
    solver: Solver | None = None,
) -> tuple[Bound, tuple[InstantProof, ...]]:
    """Prove the smallest bounds, and those that bind a shared multiplier.

    Args:
        along: the design and its motion.
        bound: of the criterion.
        kind: which criterion.
        count: how many of the smallest bounds; None for all.
        binding: instants that bind the common multiplier.
        solver: where multipliers of several levels come from; Clarabel's own interface if None.

    Returns:
        The bound, withdrawn where no proof was found, and the proofs.
    """
    usable = (bound.delay > 0.0) & np.isfinite(bound.delay)
    order = np.argsort(bound.delay, kind="stable")
    smallest = order[usable[order]][:count].tolist()
    extra = [k for k in binding if usable[k] and k not in set(smallest)]
    chosen = (*smallest, *extra)
    spaces, system = along.at(chosen), along.system
    S, F = task_stiffness(spaces, system, kind), delayed_stiffness(spaces, system, kind)
    proofs, missing = [], dict[int, str]()
    for i, k in enumerate(chosen):
        try:
            W = bound.prove(k, solver=solver).blocks
        except SolverError as error:
            missing[k] = str(error)
            continue
        d = float(bound.delay[k])
        proofs.append(
            InstantProof(
                instant=k,
                delay_s=d,
                J_star=spaces.J_star[i],
                stiffness=S[i],
                F_gravity=spaces.F_gravity[i],
                F=F[i],
                W=W,
                Q=tuple(block / d for block in W),
            )
        )
    if missing:
        first = min(missing)
        words = f"{len(missing)} of {len(usable)} bounds have no proof, instant {first}: "
        bound = bound.refused(list(missing), words + missing[first])
    return bound, tuple(proofs)
