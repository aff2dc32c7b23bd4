"""Exact local margins along a motion."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sealag.design._along import Along
from sealag.design._criteria import bounds_along
from sealag.design._jitter import jitter_along
from sealag.design._local import local_of
from sealag.errors import ContractionError, InputError, SolverError
from sealag.margin import DelayMargin
from sealag.passivity import Basis, Criterion
from sealag.typing import Array
from sealag.whole_body import FrozenLoop


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMargins:
    """The smallest exact local margin over a motion.

    Attributes:
        delay_s: smallest margin, s; 0 where the loop is unstable without delay; None if an instant
            was left open and none is unstable.
        first_crossing_s: smallest delay at which one more pair of roots crosses, s; None if not
            known.
        passive_s: smallest passive bound over the instants, s: any passive robot and environment,
            every delay that varies as it likes below it; 0 where no bound covers the design.
        not_passive: why none does, in words; empty if one does.
        jitter_s: smallest jitter margin over the instants, s: stable for every delay that varies as
            it likes below it; 0 where the loop is unstable without delay, None if not known. Of a
            controller with memory the ways up and down both vary.
        jitter_channels_s: jitter margins at the critical instant, s, of "positions", "rates" and
            "command" alone, and of "all" at once, each with a delay of its own; empty if the loop
            is unstable without delay, or has one channel only.
        channels_s: exact margin at the critical instant if only the position signals, or only the
            rates, of the command are late, s; empty if it feeds back no rates.
        memory: states of the controller in the loop, that it moves at its ticks; 0 for a law.
        bend: share of a program's answers that changes at half the step: it is not linear by that
            much; 0 for a law and for matrices.
        frequency_rad_s: frequency of that pair, rad/s; None without one.
        mode: share of each joint's motor in that pair's motion.
        unstable_modes: roots with positive real part without delay, at that instant.
        falling: share of each joint's motor in the motion that grows fastest without delay; empty
            where none grows, or where late torque feedback decides.
        neutral: zero roots by symmetry at that instant.
        equilibrium: "found", or why the loop has none.
        instant: index of that instant.
        time_s: its time, s.
        instants: number of instants of the motion.
        exact: number of them that were decided exactly.
        bounded: number of them whose margin lies above their passive bound, decided by it.
        intervals: ranges of delay at that instant, shortest and longest, s, with their numbers of
            unstable roots, when a horizon was given; else empty.
    """

    delay_s: float | None
    first_crossing_s: float | None
    passive_s: float
    not_passive: str
    jitter_s: float | None
    jitter_channels_s: Mapping[str, float]
    channels_s: Mapping[str, float]
    memory: int
    bend: float
    frequency_rad_s: float | None
    mode: Mapping[str, float]
    unstable_modes: int
    falling: Mapping[str, float]
    neutral: int
    equilibrium: str
    instant: int
    time_s: float
    instants: int
    exact: int
    bounded: int
    intervals: tuple[tuple[float, float, int], ...]

    def summary(self) -> dict[str, Any]:
        """Return everything as JSON says it: "unbounded" for a time that no delay reaches, None for
        what is not known."""
        plain = {key: stated(value) for key, value in asdict(self).items()}
        for key in ("channels_s", "jitter_channels_s"):
            plain[key] = {name: stated(value) for name, value in plain[key].items()}
        plain["intervals"] = [
            {"from_s": shortest, "to_s": stated(longest), "unstable_roots": count}
            for shortest, longest, count in self.intervals
        ]
        return plain


def stated(value: Any) -> Any:
    """Return a time as JSON says it: "unbounded" where no delay is too long.

    Args:
        value: s, or anything else, which stays.
    """
    return "unbounded" if isinstance(value, float) and math.isinf(value) else value


def local_margins(along: Along, horizon: float | None) -> LocalMargins:
    """Decide what `System.local_margins` returns.

    Args:
        along: the design and its motion.
        horizon: longest delay of the ranges that are listed, s; None for none.
    """
    if horizon is not None and not (math.isfinite(horizon) and horizon > 0.0):
        raise InputError(f"horizon is {horizon} s; a positive time is needed.")
    system, motion = along.system, along.motion
    if system.program is not None:
        return _of_program(along, horizon)
    bound = bounds_along(along, Criterion.CERTIFIED, rest=along.rest).bound
    bounds = bound.delay
    local = local_of(along, bounds, along.rest)
    margin, loop, rest = local.margin, local.loop, local.rest
    if loop is None:
        raise ContractionError(local.problem)
    if margin is None:
        raise SolverError(local.problem)
    if horizon is not None:
        margin = loop.margin(horizon=horizon)
    return LocalMargins(
        delay_s=local.margin_s,
        first_crossing_s=local.first_crossing_s,
        passive_s=float(bounds.min()),
        not_passive="; ".join(bound.refusals),
        jitter_s=jitter_along(along, bounds, local),
        jitter_channels_s=_jitter_channels(loop, margin) if system.law.damped else {},
        channels_s=loop.channels() if system.law.damped else {},
        memory=loop.memory,
        bend=0.0 if system.program is None else loop.bend,
        frequency_rad_s=None if math.isnan(margin.frequency) else float(margin.frequency),
        mode=_shares(loop, margin, system.robot.joints),
        unstable_modes=margin.unstable_roots,
        falling=_falling(loop, margin, system.robot.joints),
        neutral=margin.neutral,
        equilibrium="found" if rest is not None and rest.found else local.problem,
        instant=local.critical,
        time_s=float(motion.time[local.critical]),
        instants=len(motion),
        exact=local.count(Basis.EXACT),
        bounded=local.count(Basis.BOUND),
        intervals=margin.intervals,
    )


def _of_program(along: Along, horizon: float | None) -> LocalMargins:
    """The margins of a controller that is no law, in its posture."""
    system = along.system
    if len(along.motion) > 1:
        raise InputError(
            f"The controller of {system.name} is {system.no_law}: it is frozen in the posture that "
            "it holds; leave the motion out."
        )
    loop = system.frozen()
    margin = loop.margin(horizon=horizon)
    jitter = _jitter_channels(loop, margin)
    first = None if math.isnan(margin.first_crossing) else float(margin.first_crossing)
    return LocalMargins(
        delay_s=float(margin.delay),
        first_crossing_s=first,
        passive_s=0.0,
        not_passive=f"the controller is {system.no_law}",
        jitter_s=jitter["both ways"] if jitter else 0.0,
        jitter_channels_s=jitter,
        channels_s=loop.channels(),
        memory=loop.memory,
        bend=0.0 if system.program is None else loop.bend,
        frequency_rad_s=None if math.isnan(margin.frequency) else float(margin.frequency),
        mode=_shares(loop, margin, system.robot.joints),
        unstable_modes=margin.unstable_roots,
        falling=_falling(loop, margin, system.robot.joints),
        neutral=margin.neutral,
        equilibrium="found",
        instant=0,
        time_s=float(along.motion.time[0]),
        instants=1,
        exact=1,
        bounded=0,
        intervals=margin.intervals,
    )


def _jitter_channels(loop: FrozenLoop, margin: DelayMargin) -> dict[str, float]:
    return {} if margin.unstable_roots else loop.jitter_channels()


def _shares(loop: FrozenLoop, margin: DelayMargin, joints: tuple[str, ...]) -> dict[str, float]:
    """Share of each joint's motor in the motion that crosses first."""
    mode = margin.mode if len(margin.mode) else np.zeros(len(loop.states))
    return _of_motors(loop, mode, joints)


def _falling(loop: FrozenLoop, margin: DelayMargin, joints: tuple[str, ...]) -> dict[str, float]:
    """Share of each joint's motor in the motion that grows fastest without delay."""
    if not margin.unstable_roots or loop.embedded_delay:
        return {}
    present = loop.A_0 + loop.A_1 + (0.0 if loop.A_e is None else np.asarray(loop.A_e))
    roots, modes = np.linalg.eig(present)
    growth = np.real(roots)
    fastest = int(growth.argmax())
    # A double root at zero, as of a symmetry, splits by the square root of rounding, 1e-8 of the
    # loop; less than 1e-6 1/s grows in days. Ten times more would name none that falls in hours.
    return _of_motors(loop, modes[:, fastest], joints) if growth[fastest] > 1e-6 else {}


def _of_motors(loop: FrozenLoop, mode: Array, joints: tuple[str, ...]) -> dict[str, float]:
    """Share of each joint's motor in a motion."""
    motors = [i for i, name in enumerate(loop.states) if name.startswith("theta:")]
    size = np.abs(mode[motors])
    shares = size / max(float(size.sum()), 1e-300)
    return dict(zip(joints, shares.tolist(), strict=True))
