"""From a system and a motion to a certificate."""

import sys
from importlib.metadata import version
from typing import Any

import numpy as np

from sealag import __version__
from sealag.design._criteria import Bounds, asymmetry, certified_bounds, published_bounds
from sealag.design._evidence import (
    Common,
    Local,
    Moving,
    common_multiplier,
    frozen_loop,
    instant_proofs,
    moving_multiplier,
    refuted_delay,
    without,
    worst_motion,
)
from sealag.design._system import System
from sealag.errors import InputError, either
from sealag.passivity import (
    Assumption,
    Basis,
    Certificate,
    Criterion,
    Critical,
    Rest,
    Solver,
    Status,
    Worst,
)
from sealag.robot import Motion
from sealag.units import time_text
from sealag.whole_body import (
    Feedback,
    GravityCompensation,
    TaskError,
    WholeBodyStack,
)

PROOF_COUNT = 12
"""Instants whose numbers a certificate holds if nothing else is asked for."""


def certify(
    system: System,
    motion: Motion | None = None,
    *,
    criterion: Criterion | str | None = None,
    time_varying: bool = False,
    proofs: int | None = PROOF_COUNT,
    solver: Solver | None = None,
) -> Certificate:
    """Certify how much delay a design tolerates at every instant of a motion.

    Args:
        system: the design.
        motion: the motion; the system's posture if None.
        criterion: certified (THEORY section 6) or published ((29), (31) as printed); the
            system's own if None.
        time_varying: also bound the delay for matrices that move inside polytopes around the
            motion (about a second more); criterion certified only.
        proofs: how many of the instants with the smallest bounds the certificate holds the numbers
            of; None for all. Those that bind the common multiplier are added.
        solver: where multipliers come from that have no closed form: of several levels, of a whole
            motion, of polytopes; Clarabel's own interface if None. What it says is measured; if it
            leaves open whether the design's delay is proven, the answer is not certified, with the
            solver's own words among the reasons.

    Returns:
        The certificate; not certified is a result, not an error.

    Raises:
        InputError: fewer than one proof is asked for, the criterion or the motion is none, or a
            time-varying bound is asked of one instant or of the published criterion.
        RobotError: a mass matrix is not positive definite.
        UnknownNameError: a frame or joint does not exist.
    """
    motion = system.still() if motion is None else motion
    kind = _criterion(system, motion, criterion, time_varying=time_varying, proofs=proofs)
    stack = system.evaluate(motion)
    published = published_bounds(stack, system, solver=solver)
    printed = kind is Criterion.PUBLISHED
    bounds = published if printed else certified_bounds(stack, system)
    shared = not printed and len(motion) > 1 and not bounds.reasons
    common = common_multiplier(system, bounds, solver=solver) if shared else None
    moving = None
    if shared and time_varying:
        moving = moving_multiplier(system, motion, bounds, solver=solver)
    held, missing = instant_proofs(
        system,
        stack,
        bounds,
        kind=kind,
        count=proofs,
        binding=common.binding if common else (),
        solver=solver,
    )
    if missing:
        bounds, common, moving = without(bounds, missing), None, None
    locals_ = [frozen_loop(system, motion, stack, instant=k) for k in range(len(motion))]
    at = min(range(len(locals_)), key=lambda k: _order(locals_[k]))
    local = locals_[at]
    return Certificate(
        **_answer(
            system, stack, bounds, kind=kind, local=local, open_=_left_open(system, common, moving)
        ),
        **_at_worst(system, motion, bounds, local),
        **_over_motion(motion, locals_, at),
        **_shared(bounds, common, moving),
        **design_entries(system),
        instants=len(motion),
        published_max_delay_s=float((bounds if printed else published).delay.min()),
        assumptions=_assumptions(system, kind, motion, local),
        time_s=motion.time.tolist(),
        bounds_s=bounds.delay.tolist(),
        proofs=held,
        versions={
            "sealag": __version__,
            "python": sys.version.split()[0],
            **{name: version(name) for name in ("numpy", "scipy", "numba", "pin")},
        },
    )


def _criterion(
    system: System,
    motion: Motion,
    criterion: Criterion | str | None,
    *,
    time_varying: bool,
    proofs: int | None,
) -> Criterion:
    """The criterion that is asked for, if the question has an answer."""
    if not isinstance(motion, Motion):
        raise InputError(f"motion is {motion!r}; load_motion makes a Motion of a file.")
    if proofs is not None and not (isinstance(proofs, int) and proofs >= 1):
        raise InputError(f"proofs is {proofs!r}; it must be a whole number from 1 up, or None.")
    name = system.criterion if criterion is None else criterion
    if name not in set(Criterion):
        raise InputError(f"criterion is {name!r}; it must be {either(list(Criterion))}.")
    if time_varying and (name == Criterion.PUBLISHED or len(motion) < 2):
        raise InputError(
            "A time-varying bound needs the certified criterion and a motion of more than one "
            "instant (--motion)."
        )
    return Criterion(name)


def design_entries(system: System) -> dict[str, Any]:
    """Return the entries of a certificate that come straight from the design.

    Args:
        system: the design.
    """
    return {
        "delay_s": system.delays.d_1,
        "levels": system.hierarchy.levels(system.robot),
        "feedback": system.feedback.value,
        "gravity": system.gravity.value,
        "stiffness_form": system.hierarchy.form.value,
        "task_inertia": system.hierarchy.task_inertia.value,
        "joints": system.robot.joints,
        "D_theta": system.actuators.motor_damping.tolist(),
        "spring_stiffness": system.actuators.spring_stiffness.tolist(),
        "spring_damping": system.actuators.spring_damping.tolist(),
        "viscous_friction": system.actuators.viscous_friction.tolist(),
        "motor_inertia": system.actuators.shaped_inertia.tolist(),
        "rotor_inertia": system.actuators.rotor_inertia.tolist(),
        "torque_bandwidth": [_finite(value) for value in system.actuators.torque_bandwidth],
        "hashes": {"urdf": system.robot.urdf_sha256, "project": system.sha256},
    }


def _left_open(system: System, common: Common | None, moving: Moving | None) -> tuple[str, ...]:
    """Bounds over the whole motion of which it is not known whether they cover the delay."""
    parts = (("one multiplier", common), ("matrices that move", moving))
    return tuple(
        f"it is open whether the design's delay is proven with {what}: {found.left_open}"
        for what, found in parts
        if found and found.left_open and found.delay < system.delays.d_1
    )


def _order(local: Local) -> tuple[float, int]:
    """By margin, what is not known last; among zeros the most unstable first."""
    return (np.inf if local.margin_s is None else local.margin_s), -local.unstable


def _over_motion(motion: Motion, locals_: list[Local], at: int) -> dict[str, Any]:
    """Stability and local margin at every instant."""
    margins = [local.margin_s for local in locals_]
    known = [margin for margin in margins if margin is not None]
    unstable = max(local.unstable for local in locals_)
    return {
        "critical": Critical(instant=at, time_s=float(motion.time[at])),
        "stable": False if unstable else (True if len(known) == len(margins) else None),
        "local_margin_s": min(known, default=None),
        "first_crossing_s": locals_[at].first_crossing_s,
        "unstable_modes": unstable,
        "instant_margins_s": margins,
        "instant_basis": [Basis.OPEN if m is None else Basis.EXACT for m in margins],
        "local_loop": locals_[at].loop,
        "equilibrium": Rest(found=True, moved_rad=0.0) if len(motion) == 1 else None,
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _answer(
    system: System,
    stack: WholeBodyStack,
    bounds: Bounds,
    *,
    kind: Criterion,
    local: Local,
    open_: tuple[str, ...],
) -> dict[str, Any]:
    """Status with its reasons, and what decides it."""
    worst = int(np.argmin(bounds.delay))
    max_delay_s, delay_s = float(bounds.delay[worst]), system.delays.d_1
    reasons = list(bounds.reasons)
    if not reasons and delay_s > max_delay_s:
        solver = f"; a longer one is open: {bounds.left_open}" if bounds.left_open else ""
        reasons.append(
            f"the design's delay of {time_text(delay_s)} exceeds the bound of "
            f"{time_text(max_delay_s)}{solver}"
        )
    reasons += open_
    certified, margin = kind is Criterion.CERTIFIED, local.margin_s
    if (
        certified
        and not reasons
        and not local.unstable
        and margin is not None
        and margin < max_delay_s
    ):
        reasons.append(
            f"the law that is run loses its stability at {time_text(margin)}, before its bound: "
            "it also answers to passive motions of the base, which no bound covers"
        )
    return {
        "status": Status.NOT_CERTIFIED if reasons else Status.CERTIFIED,
        "criterion": kind,
        "max_delay_s": max_delay_s,
        "asymmetry": _finite(np.max(asymmetry(stack, bounds, kind))),
        "contraction": _finite(stack.contraction.max()),
        "reasons": tuple(reasons),
    }


def _at_worst(system: System, motion: Motion, bounds: Bounds, local: Local) -> dict[str, Any]:
    """The worst instant: which, its limiting direction, and its frozen loop."""
    worst = int(np.argmin(bounds.delay))
    y = worst_motion(system, bounds, worst)
    power = system.actuators.motor_damping * np.abs(y) ** 2
    margin, bound, upper = local.margin_s, float(bounds.delay[worst]), float(bounds.upper[worst])
    if 0.0 < bound < np.inf:
        upper = refuted_delay(system, bounds, worst, y) * (1.0 + 1e-13)
    known = margin is not None and 0.0 < margin < np.inf and 0.0 < bound < np.inf
    return {
        "worst": Worst(
            instant=worst,
            time_s=float(motion.time[worst]),
            direction=dict(zip(system.robot.joints, (power / power.sum()).tolist(), strict=True)),
        ),
        "max_delay_upper_s": upper,
        "worst_motion": [y.real.tolist(), y.imag.tolist()],
        "conservatism": margin / bound if margin is not None and known else None,
    }


def _shared(bounds: Bounds, common: Common | None, moving: Moving | None) -> dict[str, Any]:
    """Multipliers for the whole motion, where they were asked for, and what solvers left open."""
    open_ = {
        "max_delay_s": bounds.left_open,
        "common_multiplier_delay_s": common.left_open if common else "",
        "time_varying_delay_s": moving.left_open if moving else "",
    }
    W_common = None if common is None or common.W is None else common.W.tolist()
    W_moving = None if moving is None or moving.W is None else moving.W.tolist()
    return {
        "common_multiplier_delay_s": common.delay if common else None,
        "common_multiplier": W_common,
        "time_varying_delay_s": moving.delay if moving else None,
        "time_varying_multiplier": W_moving,
        "time_varying_windows": moving.windows if moving else (),
        "left_open": {name: reason for name, reason in open_.items() if reason},
    }


def _assumptions(
    system: System, criterion: Criterion, motion: Motion, local: Local
) -> tuple[Assumption, ...]:
    said = {
        "frozen_coefficients": "coefficients are frozen at each instant (quasi-static: the "
        "multiplier may differ from instant to instant; `common_multiplier_delay_s` is the bound "
        "with a single one)",
        "embedded_damping": "the embedded motor damping D_θ acts without delay",
        "delay_bound": f"d_1 is at most {time_text(system.delays.d_1)}; it may vary "
        "below that; where no embedded period is given, packets are sent and taken at once",
        "one_delay": "the ways up and down count by their sum d_1 alone, since a "
        "stiffness is all that is fed back; d_2 delays the feedforward and moves no root",
        "contacts": "contacts neither slip nor lift off",
    }
    if system.delays.delayed_torque_feedback:
        said["torque_feedback"] = (
            "the embedded torque feedback acts without delay, though the design delays it"
        )
    if system.gravity is GravityCompensation.PLANNED:
        said["planned_gravity"] = (
            "gravity compensation comes from the plan and has no feedback gradient"
        )
    if system.feedback is Feedback.STATIC_JOINT_TANK:
        said["tank"] = "the energy tank pays for all that u does; u = 0 while it is empty"
    if len(system.hierarchy.levels(system.robot)) > 2:
        said["lower_tasks"] = (
            "a lower task's error is what the tasks above leave of it"
            if system.task_error is TaskError.CONSISTENT
            else "lower tasks feed back their whole errors, as printed"
        )
    if local.coupled:
        said["passive_base"] = (
            "motions of the base that the motors do not determine stand still: what they move of "
            "x is an input, not part of the delayed loop; the local margin includes them"
        )
    if criterion is Criterion.PUBLISHED:
        said["published_criterion"] = (
            "the criterion is (29)/(31) as printed: it takes Λ K_x for symmetric, x(θ) for what is "
            "fed back and gravity for not delayed, and can certify what is unstable"
        )
    else:
        said["passive_not_stable"] = (
            "passive is not stable: `stable` and the local margin are separate answers"
        )
    if len(motion) > 1:
        said["between_instants"] = "the motion's instants are checked, not what lies between them"
    return tuple(Assumption(key=key, text=text) for key, text in said.items())
