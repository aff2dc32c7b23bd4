"""All that is computed of a design and a motion, and the certificates that it comes to."""

import re
import sys
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from typing import Self

import numpy as np
from threadpoolctl import threadpool_info

from sealag.delay import Delays
from sealag.design._along import Along
from sealag.design._assumptions import assumptions_of
from sealag.design._criteria import (
    bounds_along,
    common_bound,
    delayed_stiffness,
    prove_instants,
    time_varying_bound,
)
from sealag.design._design import Design
from sealag.design._local import MOST_EXACT, Local, local_of
from sealag.errors import InputError
from sealag.passivity import (
    Answer,
    Basis,
    Bound,
    Certificate,
    Criterion,
    Critical,
    Evidence,
    InstantProof,
    Question,
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


@dataclass(frozen=True, kw_only=True)
class Findings:
    """All that was computed of a design for its certificate. Nothing but the verdict depends on the
    delays of both connections, so that one computation serves designs that differ in these.

    Attributes:
        system: the design.
        motion: its instants.
        kind: the criterion.
        asymmetry: largest relative asymmetry of the criterion's stiffness.
        contraction: largest contraction factor of q̄(θ).
        F: (n, n) delayed stiffness of the criterion at the worst instant, Nm/rad.
        bound: of each instant by the criterion, as far as it is proven.
        published: smallest bound by (29) or (31), s; NaN if it takes a semidefinite program that
            was not asked for.
        common: with one multiplier for the whole motion; None if it was not asked for.
        time_varying: inside polytopes; None if it was not asked for.
        proofs: of instants.
        local: stability and local margin.
        rest: where the loop rests; None for a motion.
    """

    system: Design
    motion: Motion
    kind: Criterion
    asymmetry: float
    contraction: float
    F: Array
    bound: Bound
    published: float
    common: Bound | None
    time_varying: Bound | None
    proofs: tuple[InstantProof, ...]
    local: Local
    rest: Equilibrium | None

    @classmethod
    def of(
        cls,
        system: Design,
        motion: Motion,
        *,
        kind: Criterion,
        time_varying: bool,
        proofs: int | None,
        solver: Solver | None,
    ) -> Self:
        """Compute what `sealag.certify` is asked for.

        Args:
            system: the design.
            motion: its instants.
            kind: the criterion.
            time_varying: whether matrices that move are bounded too.
            proofs: how many of the smallest bounds are proven; None for all.
            solver: where multipliers come from; Clarabel's own interface if None.
        """
        along = Along.of(system, motion)
        rest = along.rest
        bounds = bounds_along(along, kind, rest=rest, published=True, solver=solver)
        printed = kind is Criterion.PUBLISHED
        bound, common, moving = bounds.bound, None, None
        if not printed and len(motion) > 1 and not bound.refusals:
            common = common_bound(bound, solver=solver)
            moving = time_varying_bound(bound, motion, solver=solver) if time_varying else None
        proven, held = prove_instants(
            along,
            bound,
            kind=kind,
            count=proofs,
            binding=common.binding if common else (),
            solver=solver,
        )
        withdrawn = proven is not bound
        decided = np.zeros(len(motion)) if printed else bound.delay
        local = local_of(along, decided, rest)
        if (
            rest is not None and rest.found and local.loop is None
        ):  # a law that cannot run rests nowhere
            rest = replace(rest, found=False, reason=local.problem)
        worst = delayed_stiffness(along.at([int(np.argmin(proven.delay))]), system, kind)
        return cls(
            system=system,
            motion=motion,
            kind=kind,
            asymmetry=bounds.asymmetry,
            contraction=bounds.contraction,
            F=worst[0],
            bound=proven,
            published=float(proven.delay.min()) if printed else bounds.published,
            common=None if withdrawn else common,
            time_varying=None if withdrawn else moving,
            proofs=held,
            local=local,
            rest=rest,
        )

    @property
    def worst(self) -> int:
        """The instant with the smallest bound."""
        return int(np.argmin(self.bound.delay))

    @property
    def max_delay(self) -> float:
        """The smallest bound, s."""
        return float(self.bound.delay[self.worst])

    @property
    def worst_motion(self) -> Array:
        """Motor velocities y in the motion that first turns the delayed loop active, (n,) complex;
        y* D_θ y = 1.
        """
        x = self.bound.worst_motion(self.worst)
        return x / np.sqrt(self.system.actuators.motor_damping)

    @property
    def max_delay_upper(self) -> float:
        """Delay above which the worst motion turns the loop active, y* D_θ y / |y* F y|, s."""
        if not 0.0 < self.max_delay < np.inf:
            return float(self.bound.upper[self.worst])
        y = self.worst_motion
        power = float(self.system.actuators.motor_damping @ np.abs(y) ** 2)
        passed = max(float(abs(y.conj() @ self.F @ y)), 1e-300)
        return power / passed * (1.0 + 1e-13)

    def certificate(self, delays: Delays | None = None) -> Certificate:
        """Return the certificate of the design, or of the same one with other delays.

        Args:
            delays: both connections' delays; the design's own if None.

        Raises:
            InputError: the drives' torque feedback would be late by another time, which all that
                was computed depends on.
        """
        own = self._own
        if delays is None or delays is self.system.delays:
            return own
        other = self._with(delays)
        status, reasons = _judged(other)
        assumptions = assumptions_of(other.system, self.motion, self.kind, self.local)
        answer = replace(own.answer, status=status, reasons=reasons, assumptions=assumptions)
        return replace(own, question=_question(other), answer=answer)

    def confirmed(self, delays: Delays | None = None) -> Certificate:
        """Return the certificate that the verifier confirms; see `Certificate.confirmed`.

        Proofs and frozen loop hold at any delay: they are checked once.

        Args:
            delays: both connections' delays; the design's own if None.

        Raises:
            InputError: as `certificate` raises it.
            SolverError: something could not be confirmed.
        """
        own = self._confirmed
        if delays is None or delays is self.system.delays:
            return own
        return self.certificate(delays).confirmed(proven=own is self._own)

    @cached_property
    def _own(self) -> Certificate:
        return Certificate(question=_question(self), answer=_answer(self), evidence=_evidence(self))

    @cached_property
    def _confirmed(self) -> Certificate:
        return self._own.confirmed()

    def _with(self, delays: Delays) -> Self:
        """The same with other delays of a design that is no longer the project file's."""
        system = replace(self.system, delays=delays, source=None)
        if system.delays.torque_feedback_delay != self.system.delays.torque_feedback_delay:
            raise InputError(
                "delays let the drives' torque feedback come late by another time; compute the "
                "findings of that design anew."
            )
        return replace(self, system=system)


def _question(case: Findings) -> Question:
    system, law, drives = case.system, case.system.law, case.system.actuators
    return Question(
        criterion=case.kind,
        delay_s=system.delays.d_1,
        joints=system.robot.joints,
        instants=len(case.motion),
        levels=tuple(law.levels(system.robot)),
        feedback=law.signal.name,
        gravity=law.gravity.value,
        stiffness_form=law.stiffness_form.value,
        task_inertia=law.task_inertia.value,
        D_theta=drives.motor_damping,
        spring_stiffness=drives.spring_stiffness,
        spring_damping=drives.spring_damping,
        viscous_friction=drives.viscous_friction,
        motor_inertia=drives.shaped_inertia,
        rotor_inertia=drives.rotor_inertia,
        torque_bandwidth=tuple(_finite(value) for value in drives.torque_bandwidth),
        hashes={"urdf": system.robot.urdf_sha256, "project": system.sha256},
    )


def _answer(case: Findings) -> Answer:
    system, local, rest, worst = case.system, case.local, case.rest, case.worst
    status, reasons = _judged(case)
    power = system.actuators.motor_damping * np.abs(case.worst_motion) ** 2
    shares = (power / power.sum()).tolist()
    return Answer(
        status=status,
        reasons=reasons,
        max_delay_s=case.max_delay,
        max_delay_upper_s=case.max_delay_upper,
        worst=Worst(
            instant=worst,
            time_s=float(case.motion.time[worst]),
            direction=dict(zip(system.robot.joints, shares, strict=True)),
        ),
        asymmetry=_finite(case.asymmetry),
        contraction=_finite(case.contraction),
        published_max_delay_s=None if np.isnan(case.published) else case.published,
        common_multiplier_delay_s=float(case.common.delay) if case.common else None,
        time_varying_delay_s=float(case.time_varying.delay) if case.time_varying else None,
        left_open=_left_open(case),
        stable=local.stable,
        unstable_modes=local.unstable_modes,
        local_margin_s=local.margin_s,
        critical=Critical(instant=local.critical, time_s=float(case.motion.time[local.critical])),
        first_crossing_s=local.first_crossing_s,
        equilibrium=None if rest is None else Rest(found=rest.found, moved_rad=rest.moved),
        conservatism=_conservatism(local.margin_s, case.max_delay),
        assumptions=assumptions_of(system, case.motion, case.kind, local),
        versions={
            "sealag": __version__,
            "python": sys.version.split()[0],
            **{name: version(name) for name in ("numpy", "scipy", "numba", "pin")},
            "blas": _blas(),
        },
    )


def _judged(case: Findings) -> tuple[Status, tuple[str, ...]]:
    """The verdict and its reasons."""
    failing, unstable, rest = _reasons(case), _unstable(case), case.rest
    status = Status.PASSIVE_ONLY if unstable else Status.CERTIFIED
    if failing and (rest is None or rest.found):  # `stable` says it beside a bound that fails
        unstable = []
    return Status.NOT_CERTIFIED if failing else status, (*failing, *unstable)


_LONGEST_VERSION = 256
"""Characters of a version. A process that has loaded three linear algebras needs 80."""


def _blas() -> str:
    """What the last bits of all numbers depend on: the linear algebra's library, the processor that
    its kernels are for, and its threads."""
    kinds = {
        "-".join(str(part) for part in (lib["internal_api"], lib.get("architecture")) if part)
        + f"-{lib['num_threads']}threads"
        for lib in threadpool_info()
        if lib["user_api"] == "blas"
    }
    named = re.sub(r"[^0-9A-Za-z.+_-]", "_", "+".join(sorted(kinds)))
    return named[:_LONGEST_VERSION] or "unknown"


def _evidence(case: Findings) -> Evidence:
    y, moving = case.worst_motion, case.time_varying
    W_moving = _stated_multiplier(moving)
    windows = ()
    if moving is not None and W_moving is not None:
        windows = moving.stated_windows(case.system.actuators.motor_damping)
    return Evidence(
        time_s=case.motion.time,
        bounds_s=tuple(case.bound.delay.tolist()),
        instant_margins_s=tuple(
            None if np.isnan(delay) else delay for delay in case.local.delay.tolist()
        ),
        instant_basis=tuple(case.local.basis),
        worst_motion=np.array([y.real, y.imag]),
        proofs=case.proofs,
        common_multiplier=_stated_multiplier(case.common),
        time_varying_multiplier=W_moving,
        time_varying_windows=windows,
        local_loop=case.local.stated_loop(),
    )


def _stated_multiplier(bound: Bound | None) -> Array | None:
    """The multiplier that proves a positive finite delay."""
    if bound is None or not 0.0 < bound.delay < np.inf:
        return None
    return bound.multiplier


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _conservatism(margin: float | None, bound: float) -> float | None:
    known = margin is not None and 0.0 < margin < np.inf and 0.0 < bound < np.inf
    return margin / bound if margin is not None and known else None


def _left_open(case: Findings) -> dict[str, str]:
    """Why a solver proved no longer delay, by the name of the bound."""
    bounds = {
        "max_delay_s": case.bound,
        "common_multiplier_delay_s": case.common,
        "time_varying_delay_s": case.time_varying,
    }
    return {name: bound.reason for name, bound in bounds.items() if bound and bound.reason}


def _reasons(case: Findings) -> list[str]:
    """Why a design is not passive or loses its stability: conditions that fail, delays that are
    too long, bounds that decide nothing."""
    bound, delay_s, largest = case.bound, case.system.delays.d_1, case.max_delay
    reasons = list(bound.refusals)
    if not reasons and (delay_s > largest or largest == 0.0):
        solver = f"; a longer one is open: {bound.reason}" if bound.reason else ""
        reasons.append(
            f"the design's delay of {time_text(delay_s)} exceeds the bound of "
            f"{time_text(largest)}{solver}"
        )
    shared = (("one multiplier", case.common), ("matrices that move", case.time_varying))
    reasons += [
        f"it is open whether the design's delay is proven with {what}: {found.reason}"
        for what, found in shared
        if found and found.reason and found.delay < delay_s
    ]
    if case.kind is Criterion.CERTIFIED and not reasons:
        reasons += _undercut(case)
    return reasons or _lost(case)


def _lost(case: Findings) -> list[str]:
    """Where a loop that is stable without delay is not so at the design's."""
    local, delay_s = case.local, case.system.delays.d_1
    exact = np.where(local.basis == Basis.EXACT, local.delay, np.inf)
    exact[exact == 0.0] = np.inf
    k = int(np.argmin(exact))
    if exact[k] > delay_s:
        return []
    return [
        f"the loop loses its stability at {time_text(float(exact[k]))} at instant {k}, before the "
        f"design's delay of {time_text(delay_s)}"
    ]


def _unstable(case: Findings) -> list[str]:
    """Why no equilibrium is stable without delay, or why that is not known; empty where one is."""
    local, count = case.local, len(case.motion)
    if case.rest is not None and not case.rest.found:
        return [f"the loop that holds the posture has no equilibrium: {case.rest.reason}"]
    if local.stable:
        return []
    if local.stable is None:
        found = local.count(Basis.OPEN)
        why = local.problem or f"at most {MOST_EXACT} instants are decided exactly"
        return [f"stability is left open at {found} of {count} instants: {why}"]
    found = int(((local.basis != Basis.OPEN) & (local.delay == 0.0)).sum())
    modes = local.unstable_modes
    roots = f"{modes} root{'s' * (modes != 1)} on or right of the axis"
    why = roots if modes else local.problem or "no loop holds it"
    return [
        f"no equilibrium is stable without delay at {found} of the {count} instants "
        f"(instant {local.critical}: {why})"
        if count > 1
        else f"the posture is no stable equilibrium without delay: {why}"
    ]


def _undercut(case: Findings) -> list[str]:
    """Where the law that runs loses a stability that it has, before its bound."""
    margins, bounds = case.local.delay, case.bound.delay
    lost = [k for k in case.local.undercut(bounds) if margins[k] > 0.0]
    if not lost:
        return []
    k = min(lost, key=lambda at: float(margins[at]))
    return [
        f"the law that runs loses its stability at {time_text(float(margins[k]))} at instant "
        f"{k}, before its bound of {time_text(float(bounds[k]))}: its matrices change where it "
        "rests with an error, or it answers to motions of the base, and no bound covers that"
    ]
