"""From a system and a motion to a certificate."""

import sys
from importlib.metadata import version
from typing import Any

import numpy as np

from sealag.design._assumptions import assumptions_of
from sealag.design._criteria import Bounds, asymmetry, certified_bounds, published_bounds
from sealag.design._evidence import (
    Common,
    Moving,
    common_multiplier,
    instant_proofs,
    moving_multiplier,
    refuted_delay,
    stated_loop,
    without,
    without_bounds,
    worst_motion,
)
from sealag.design._local import Local, local_of
from sealag.design._system import System
from sealag.errors import InputError, either
from sealag.passivity import (
    Certificate,
    Criterion,
    Critical,
    LocalLoop,
    Rest,
    Solver,
    Status,
    Worst,
)
from sealag.robot import Motion
from sealag.typing import Array
from sealag.units import time_text
from sealag.version import __version__
from sealag.whole_body import Rest as Equilibrium
from sealag.whole_body import Spaces

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

    Stability and local margin are decided over all instants, in the instant's configuration itself
    and where the loop that holds it rests.

    Args:
        system: the design.
        motion: the motion; the system's posture if None.
        criterion: certified (docs/theory section 6) or published ((29), (31) as printed); the
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
    kind = check_question(system, motion, criterion, time_varying=time_varying, proofs=proofs)
    motion = system.still() if motion is None else motion
    rest = system.rest(motion) if len(motion) == 1 else None
    spaces = system.spaces(motion)
    published = published_bounds(spaces, system, solver=solver)
    printed = kind is Criterion.PUBLISHED
    passive = certified_bounds(spaces, system, rest, motion)
    bounds = published if printed else passive
    shared = not printed and len(motion) > 1 and not bounds.reasons
    common = common_multiplier(system, bounds, solver=solver) if shared else None
    moving = None
    if shared and time_varying:
        moving = moving_multiplier(system, motion, bounds, solver=solver)
    held, missing = instant_proofs(
        system,
        spaces,
        bounds,
        kind=kind,
        count=proofs,
        binding=common.binding if common else (),
        solver=solver,
    )
    if missing:
        bounds, common, moving = without(bounds, missing), None, None
    decided = passive if kind is Criterion.CERTIFIED else without_bounds(passive)
    local = local_of(system, motion, spaces, decided, rest)
    return Certificate(
        **_answer(
            system,
            spaces,
            bounds,
            kind=kind,
            local=local,
            rest=rest,
            open_=_left_open(system, common, moving),
        ),
        **_at_worst(system, motion, bounds, local),
        **_over_motion(motion, local),
        **_shared(bounds, common, moving),
        **design_entries(system),
        instants=len(motion),
        equilibrium=None if rest is None else Rest(found=rest.found, moved_rad=rest.moved),
        published_max_delay_s=float((bounds if printed else published).delay.min()),
        assumptions=assumptions_of(system, motion, kind, local),
        time_s=motion.time.tolist(),
        bounds_s=bounds.delay.tolist(),
        proofs=held,
        versions={
            "sealag": __version__,
            "python": sys.version.split()[0],
            **{name: version(name) for name in ("numpy", "scipy", "numba", "pin")},
        },
    )


def check_question(
    system: System,
    motion: Motion | None,
    criterion: Criterion | str | None,
    *,
    time_varying: bool = False,
    proofs: int | None = PROOF_COUNT,
) -> Criterion:
    """Return the criterion that `certify` would use, if what it is asked has an answer.

    Args:
        system: the design.
        motion: the motion, or None.
        criterion: what is asked for, or None.
        time_varying: whether a bound for matrices that move is asked for.
        proofs: how many instants with their numbers; None for all.

    Raises:
        InputError: as `certify` raises it.
    """
    if not isinstance(motion, Motion | None):
        raise InputError(f"motion is {motion!r}; load_motion makes a Motion of a file.")
    if proofs is not None and not (isinstance(proofs, int) and proofs >= 1):
        raise InputError(f"proofs is {proofs!r}; it must be a whole number from 1 up, or None.")
    name = system.criterion if criterion is None else criterion
    if name not in set(Criterion):
        raise InputError(f"criterion is {name!r}; it must be {either(list(Criterion))}.")
    if time_varying and (name == Criterion.PUBLISHED or motion is None or len(motion) < 2):
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
    law, drives = system.law, system.actuators
    return {
        "delay_s": system.delays.d_1,
        "levels": law.levels(system.robot),
        "feedback": law.signal.name,
        "gravity": law.gravity.value,
        "stiffness_form": law.stiffness_form.value,
        "task_inertia": law.task_inertia.value,
        "joints": system.robot.joints,
        "D_theta": drives.motor_damping.tolist(),
        "spring_stiffness": drives.spring_stiffness.tolist(),
        "spring_damping": drives.spring_damping.tolist(),
        "viscous_friction": drives.viscous_friction.tolist(),
        "motor_inertia": drives.shaped_inertia.tolist(),
        "rotor_inertia": drives.rotor_inertia.tolist(),
        "torque_bandwidth": [_finite(value) for value in drives.torque_bandwidth],
        "hashes": {
            "urdf": system.robot.urdf_sha256,
            "project": system.sha256,
        },
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _left_open(system: System, common: Common | None, moving: Moving | None) -> tuple[str, ...]:
    """Bounds over the whole motion of which it is not known whether they cover the delay."""
    parts = (("one multiplier", common), ("matrices that move", moving))
    return tuple(
        f"it is open whether the design's delay is proven with {what}: {found.left_open}"
        for what, found in parts
        if found and found.left_open and found.delay < system.delays.d_1
    )


def _answer(
    system: System,
    spaces: Spaces,
    bounds: Bounds,
    *,
    kind: Criterion,
    local: Local,
    rest: Equilibrium | None,
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
    if rest is not None and not rest.found:
        reasons.append(f"the loop that holds the posture has no equilibrium: {rest.reason}")
    if kind is Criterion.CERTIFIED and not reasons:
        reasons += _undercut(local, bounds.delay)
    return {
        "status": Status.NOT_CERTIFIED if reasons else Status.CERTIFIED,
        "criterion": kind,
        "max_delay_s": max_delay_s,
        "asymmetry": _finite(np.max(asymmetry(spaces, bounds, kind))),
        "contraction": _finite(spaces.contraction.max()),
        "reasons": tuple(reasons),
    }


def _undercut(local: Local, bounds: Array) -> list[str]:
    """Where the law that runs loses a stability that it has, before its bound."""
    lost = [k for k in local.undercut(bounds) if local.instants[k].delay > 0.0]
    if not lost:
        return []
    k = min(lost, key=lambda at: local.instants[at].delay)
    return [
        f"the law that runs loses its stability at {time_text(local.instants[k].delay)} at instant "
        f"{k}, before its bound of {time_text(float(bounds[k]))}: its matrices change where it "
        "rests with an error, or it answers to motions of the base, and no bound covers that"
    ]


def _at_worst(system: System, motion: Motion, bounds: Bounds, local: Local) -> dict[str, Any]:
    """The instant of the smallest bound: which, and its limiting direction."""
    worst = int(np.argmin(bounds.delay))
    y = worst_motion(system, bounds, worst)
    power = system.actuators.motor_damping * np.abs(y) ** 2
    margin, bound, upper = local.margin_s, float(bounds.delay[worst]), float(bounds.upper[worst])
    if 0.0 < bound < np.inf:
        upper = float(refuted_delay(system, bounds, worst, y)) * (1.0 + 1e-13)
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


def _over_motion(motion: Motion, local: Local) -> dict[str, Any]:
    """Stability and local margin over all instants."""
    at = local.critical
    return {
        "critical": Critical(instant=at, time_s=float(motion.time[at])),
        "stable": local.stable,
        "local_margin_s": local.margin_s,
        "first_crossing_s": local.first_crossing_s,
        "unstable_modes": local.unstable_modes,
        "instant_margins_s": [None if np.isnan(one.delay) else one.delay for one in local.instants],
        "instant_basis": [one.basis for one in local.instants],
        "local_loop": _stated(local),
    }


def _stated(local: Local) -> LocalLoop | None:
    return None if local.loop is None else stated_loop(local.loop, local.margin, local.at)


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
