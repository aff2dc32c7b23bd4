"""Exact local margins along a motion."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sealag.design._system import System
from sealag.errors import ContractionError
from sealag.margin import DelayMargin, Interval, delay_margin
from sealag.robot import Motion
from sealag.whole_body import Linearisation

LARGEST_SAMPLE = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMargins:
    """The smallest exact local margin over a motion.

    Attributes:
        delay_s: smallest margin, s; 0 where the loop is unstable without delay.
        first_crossing_s: smallest delay at which one more pair of roots crosses, s.
        frequency_rad_s: frequency of that pair, rad/s.
        mode: share of each joint's motor in that pair's motion.
        unstable_modes: roots with positive real part without delay, at that instant.
        neutral: structural zero roots there.
        instant: index of that instant.
        time_s: its time, s.
        instants: number of instants of the motion.
        evaluated: number of them that were evaluated, evenly spaced.
        intervals: ranges of delay at that instant with their numbers of unstable roots, when a
            horizon was given; else empty.
    """

    delay_s: float
    first_crossing_s: float
    frequency_rad_s: float
    mode: Mapping[str, float]
    unstable_modes: int
    neutral: int
    instant: int
    time_s: float
    instants: int
    evaluated: int
    intervals: tuple[Interval, ...]

    def summary(self) -> dict[str, Any]:
        """Return everything, with None for what is not finite: no delay is too long."""
        plain = {key: _number(value) for key, value in asdict(self).items()}
        plain["intervals"] = [
            {"from_s": low, "to_s": _number(high), "unstable_roots": count}
            for low, high, count in self.intervals
        ]
        return plain


def _number(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def local_margins(
    system: System, motion: Motion | None = None, *, horizon: float | None = None
) -> LocalMargins:
    """Compute the exact local margin of the law that is run, along a motion.

    Necessary and sufficient for local stability at constant delay with frozen coefficients. The
    delay is d_1, the sum of all ways around the loop, however it is split: a stiffness is all that
    is fed back, and d_2 moves no root (`sealag.margin.delay_margin` says where this ends). Embedded
    torque feedback that the design delays is taken as immediate.

    Args:
        system: the design.
        motion: the motion; the system's posture if None. Of long ones, 200 evenly spaced
            instants are evaluated.
        horizon: longest delay up to which the ranges of stable and unstable delay are listed, s.

    Raises:
        InputError: the horizon is not a positive time.
        ContractionError: q̄(θ) is fed back and has no contraction.
    """
    motion = system.still() if motion is None else motion
    sample = np.unique(np.linspace(0, len(motion) - 1, LARGEST_SAMPLE).astype(int))
    part = Motion(
        time=motion.time[sample],
        q=motion.q[sample],
        v=motion.v[sample],
        contact_sets=motion.contact_sets,
        contact_index=motion.contact_index[sample],
    )
    stack = system.evaluate(part)
    if not np.isfinite(stack.F_theta).all():
        raise ContractionError(
            f"q̄(θ) is fed back but is no contraction (factor {stack.contraction.max():.2f}): the "
            "task is stiffer than the springs, so there is no loop to analyse."
        )
    found: list[tuple[DelayMargin, Linearisation]] = []
    for k in range(len(part)):
        frozen = system.frozen(part, stack, k)
        found.append((delay_margin(frozen.A_0, frozen.A_1, symmetries=frozen.symmetries), frozen))
    at = min(range(len(found)), key=lambda k: (found[k][0].delay, found[k][0].first_crossing))
    margin, frozen = found[at]
    if horizon is not None:
        margin = delay_margin(frozen.A_0, frozen.A_1, symmetries=frozen.symmetries, horizon=horizon)
    n, k = system.robot.n, frozen.Z.shape[1]
    size = np.abs(margin.mode[k : k + n]) if len(margin.mode) else np.zeros(n)
    shares = size / max(float(size.sum()), 1e-300)
    return LocalMargins(
        delay_s=float(margin.delay),
        first_crossing_s=float(margin.first_crossing),
        frequency_rad_s=float(margin.frequency),
        mode=dict(zip(system.robot.joints, shares.tolist(), strict=True)),
        unstable_modes=margin.unstable_roots,
        neutral=margin.neutral,
        instant=int(sample[at]),
        time_s=float(part.time[at]),
        instants=len(motion),
        evaluated=len(part),
        intervals=margin.intervals,
    )
