"""The numbers that a certificate holds so that others can check it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from sealag.design._criteria import PROOF_SHARE, Bounds, task_stiffness
from sealag.design._system import System
from sealag.errors import SolverError
from sealag.margin import DelayMargin
from sealag.passivity import (
    Criterion,
    LocalLoop,
    Place,
    Proof,
    Solver,
    Window,
    joint_multiplier,
    max_delay_common_from_stiffness,
    max_delay_polytope_from_stiffness,
    task_multipliers,
)
from sealag.robot import Motion
from sealag.typing import Array
from sealag.whole_body import FrozenLoop, Spaces

POLYTOPE_WINDOW = 20
"""Intervals between instants in one window of the time-varying bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Common:
    """One multiplier for the whole motion.

    Attributes:
        delay: s.
        W: (n, n) in joint coordinates; None if nothing was proven.
        binding: instants that it was computed from.
        left_open: why a solver proved no longer delay; empty if it did its part.
    """

    delay: float
    W: Array | None
    binding: tuple[int, ...]
    left_open: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Moving:
    """One multiplier for stiffnesses that vary inside polytopes around the motion.

    Attributes:
        delay: s.
        W: (n, n) in joint coordinates; None if nothing was proven.
        windows: the polytopes.
        left_open: why no longer delay, or none, was proven; empty if the solver did its part.
    """

    delay: float
    W: Array | None
    windows: tuple[Window, ...]
    left_open: str


def common_multiplier(system: System, bounds: Bounds, *, solver: Solver | None) -> Common:
    """Bound with one multiplier for the whole motion.

    Args:
        system: the design.
        bounds: of the certified criterion.
        solver: where multipliers come from.
    """
    D = system.actuators.motor_damping
    found = max_delay_common_from_stiffness(bounds.F, D, solver=solver)
    return Common(
        delay=PROOF_SHARE * found.delay,
        W=_eased(found.W),
        binding=found.binding,
        left_open=found.reason,
    )


def moving_multiplier(
    system: System, motion: Motion, bounds: Bounds, *, solver: Solver | None
) -> Moving:
    """Bound for stiffnesses that vary inside polytopes around the motion, window by window.

    Args:
        system: the design.
        motion: its instants.
        bounds: of the certified criterion.
        solver: where multipliers come from.
    """
    D = system.actuators.motor_damping
    found = max_delay_polytope_from_stiffness(
        bounds.F,
        D,
        window=POLYTOPE_WINDOW,
        breaks=(np.flatnonzero(np.diff(motion.contact_index)) + 1).tolist(),
        solver=solver,
    )
    if found.W is None or not np.isfinite(found.delay):
        return Moving(delay=found.delay, W=None, windows=(), left_open=found.reason)
    sets = np.sqrt(D)[:, None] * found.boxes.M
    windows = []
    for k, (first, last) in enumerate(found.windows):
        centre, *axes = sets[found.box_window == k]
        windows.append(
            Window(
                first=first,
                last=last,
                centre=centre.tolist(),
                axes=[axis.tolist() for axis in axes if axis.any()],
                radius=float(found.ball[k]),
            )
        )
    return Moving(
        delay=PROOF_SHARE * found.delay,
        W=_eased(found.W),
        windows=tuple(windows),
        left_open=found.reason,
    )


def _eased(W: Array | None) -> Array | None:
    """A multiplier of d for PROOF_SHARE d, where it leaves room in every direction.

    ‖[JᵀC, d M C^-ᵀ]‖₂ ≤ √2 with s d and √s W, W = C Cᵀ, is smaller by s^¼ at least.
    """
    return None if W is None else math.sqrt(PROOF_SHARE) * W


def worst_motion(system: System, bounds: Bounds, instant: int) -> Array:
    """Motor velocities y in the motion that first turns the delayed loop active, (n,) complex.

    y = D^-½ x with the eigenvector x of λ_max(cos φ S + i sin φ T), S + T = D^-½ F D^-½ its
    symmetric and skew parts, at the φ where the numerical radius is reached.

    Args:
        system: the design.
        bounds: of the criterion.
        instant: the worst one.
    """
    root = 1.0 / np.sqrt(system.actuators.motor_damping)
    A, phi = root[:, None] * bounds.F[instant] * root, float(bounds.angle[instant])
    for _ in range(100):
        H = np.cos(phi) * (A + A.T) / 2.0 + 0.5j * np.sin(phi) * (A - A.T)
        x = np.linalg.eigh(H)[1][:, -1]
        before, phi = phi, -float(np.angle(x.conj() @ A @ x))
        if abs(phi - before) <= 1e-14:
            break
    return root * x


def refuted_delay(system: System, bounds: Bounds, instant: int, motion: Array) -> float:
    """Delay above which a motion turns the delayed loop active, y* D_θ y / |y* F y|, s.

    Args:
        system: the design.
        bounds: of the criterion.
        instant: the worst one.
        motion: (n,) complex motor velocities y.
    """
    power = float(system.actuators.motor_damping @ np.abs(motion) ** 2)
    return power / max(abs(motion.conj() @ bounds.F[instant] @ motion), 1e-300)


def stated_loop(loop: FrozenLoop, margin: DelayMargin | None, at: Place) -> LocalLoop:
    """Return a frozen loop as a certificate states it.

    Args:
        loop: the loop.
        margin: its margin; None if it could not be decided.
        at: where it is frozen.
    """
    crosses = margin is not None and math.isfinite(margin.frequency)
    late = bool(loop.A_e.any()) and loop.embedded_delay > 0.0
    size = np.linalg.norm(loop.symmetries, axis=0)
    return LocalLoop(
        A_0=(loop.A_0 if late else loop.A_0 + loop.A_e).tolist(),
        A_1=loop.A_1.tolist(),
        A_e=loop.A_e.tolist() if late else None,
        embedded_delay_s=loop.embedded_delay if late else 0.0,
        symmetries=(loop.symmetries / size).tolist() if len(size) else [],
        states=list(loop.states),
        at=at,
        frequency_rad_s=float(margin.frequency) if margin is not None and crosses else None,
    )


def instant_proofs(
    system: System,
    spaces: Spaces,
    bounds: Bounds,
    *,
    kind: Criterion,
    count: int | None,
    binding: tuple[int, ...],
    solver: Solver | None,
) -> tuple[tuple[Proof, ...], dict[int, str]]:
    """Numbers to check for the instants with the smallest bounds, and for those that bind.

    Args:
        system: the design.
        spaces: the law's matrices.
        bounds: of the criterion.
        kind: which criterion.
        count: how many of the smallest bounds; None for all.
        binding: instants that bind the common multiplier.
        solver: where multipliers of several levels come from.

    Returns:
        The proofs, and why there is none, by instant, where none was found.
    """
    usable = (bounds.delay > 0.0) & np.isfinite(bounds.delay)
    order = np.argsort(bounds.delay, kind="stable")
    order = order[usable[order]]
    extra = [k for k in binding if usable[k] and k not in set(order[:count].tolist())]
    proofs, missing = [], {}
    for k in (*order[:count].tolist(), *extra):
        try:
            proofs.append(_proof(system, spaces, bounds, kind=kind, instant=k, solver=solver))
        except SolverError as error:
            missing[k] = str(error)
    return tuple(proofs), missing


def without_bounds(bounds: Bounds) -> Bounds:
    """Return the same with no bound at any instant, as under the published criterion, whose bounds
    decide no stability.

    Args:
        bounds: of the certified criterion.
    """
    return replace(bounds, delay=np.zeros_like(bounds.delay))


def without(bounds: Bounds, missing: dict[int, str]) -> Bounds:
    """Withdraw bounds that nothing proves.

    Args:
        bounds: of the criterion.
        missing: why an instant has no proof.
    """
    delay, upper, at = bounds.delay.copy(), bounds.upper.copy(), list(missing)
    delay[at] = upper[at] = 0.0
    first = min(at)
    words = f"{len(at)} of {len(delay)} bounds have no proof, instant {first}: {missing[first]}"
    return replace(bounds, delay=delay, upper=upper, reasons=(*bounds.reasons, words))


def _proof(
    system: System,
    spaces: Spaces,
    bounds: Bounds,
    *,
    kind: Criterion,
    instant: int,
    solver: Solver | None,
) -> Proof:
    D, d, F = system.actuators.motor_damping, float(bounds.delay[instant]), bounds.F[instant]
    if kind is Criterion.PUBLISHED:
        levels = [spaces.level(k) for k in range(len(spaces.levels) - 1)]
        tasks = [(J[instant], Lambda[instant], K_x) for J, Lambda, K_x in levels]
        found = task_multipliers(
            tasks, D, delay=d, form=system.law.stiffness_form.printed, solver=solver
        )
        W = [(one.W + one.W.T) / 2.0 for one in found]
    else:
        W = [joint_multiplier(F, D, d)]
    return Proof(
        instant=instant,
        delay_s=d,
        J_star=spaces.J_star[instant].tolist(),
        stiffness=task_stiffness(spaces, system, kind)[instant].tolist(),
        F_gravity=spaces.F_gravity[instant].tolist(),
        F=F.tolist(),
        W=[block.tolist() for block in W],
        Q=[(block / d).tolist() for block in W],
    )
