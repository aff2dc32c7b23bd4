"""Designs of which none beats another in delay, stiffness, damping and transparency at once
(docs/theory section 16.8)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import SolverError
from sealag.tune._answer import Tuned
from sealag.tune._findings import Point
from sealag.tune._passive import EASE, Knobs, damped
from sealag.tune._question import Aim, Limit, Question
from sealag.tune._room import Room, room_of

_DELAYS = (1.0, 1.5, 2.0, 3.0)
"""Multiples of the required delay."""
_BANDWIDTHS = 6
"""Limits of the bandwidth, from half of what the design has to twice, in equal ratios."""
_SHARES = (1.0, 0.7, 0.5, 0.35)
"""Shares of the largest stiffness at such a limit."""
_SAME = 1e-6
"""Relative distance within which two designs count as equal in a quantity."""


def front_of(question: Question) -> Tuned:
    """Return the design with the points of its front; `Tuned.pick` chooses one.

    For each delay and each limit of the bandwidth: the largest common stiffness with all damping
    that the limit leaves, shares of it, and for each of these the least damping, or drag along a
    motion. Points that another one reaches or beats in all four quantities are left out.

    Args:
        question: its design, motion, least delay and limits.
    """
    own = float(question.system.actuators.transparency().bandwidth.min())
    low = question.limits.get(Limit.BANDWIDTH, own / 2.0)
    found = []
    for bandwidth in np.geomspace(low, max(2.0 * own, 2.0 * low), _BANDWIDTHS):
        limited = replace(question, limits={**question.limits, Limit.BANDWIDTH: float(bandwidth)})
        room = room_of(limited)
        if room.closed().any():
            continue
        knobs = Knobs(limited, room.design(question.system))
        for delay in np.multiply(question.required, _DELAYS):
            largest = knobs.stiffest(delay * (1.0 + EASE))[0][0]
            for share in _SHARES if largest > 0.0 else ():
                scale = float(share * largest)
                design = knobs.design(np.array([scale]))
                point = _point(limited, design, room, float(delay), scale)
                found += [] if point is None else [point]
    kept = _undominated(found)
    if not kept:
        return Tuned.none(question, "no damping within the limits tolerates the delay")
    none = Tuned.none(question)
    return replace(none, front=kept, found=True, reached_s=kept[0].delay_s)


def _point(
    question: Question, design: System, room: Room, delay: float, scale: float
) -> Point | None:
    """The design with the least damping of its stiffness at a delay; None where there is none."""
    aim = Aim.DRAG if question.moves else Aim.DAMPING
    asked = replace(question, system=design, aim=aim)
    try:
        least = damped(asked, delay * (1.0 + EASE), room)
    except SolverError:
        return None
    if isinstance(least, str):
        return None
    system, cost = least
    return Point(
        number=0,
        delay_s=delay,
        scale=scale,
        cost=cost,
        bandwidth_hz=float(system.actuators.transparency().bandwidth.min()),
        system=system,
    )


def _undominated(points: Sequence[Point]) -> tuple[Point, ...]:
    """The points that no other one reaches in all quantities, by delay and stiffness."""
    ordered = sorted(points, key=lambda p: (p.delay_s, p.scale, p.cost, -p.bandwidth_hz))
    gains = np.array([[p.delay_s, p.scale, 1.0 / p.cost, p.bandwidth_hz] for p in ordered])
    kept: list[int] = []
    for i in range(len(ordered)):
        others = [k for k in range(len(ordered)) if k != i]
        reached = (gains[others] >= gains[i] * (1.0 - _SAME)).all(axis=1)
        better = (gains[others] > gains[i] * (1.0 + _SAME)).any(axis=1)
        twin = any((np.abs(gains[k] / gains[i] - 1.0) <= _SAME).all() for k in kept)
        if not (twin or (reached & better).any()):
            kept.append(i)
    return tuple(replace(ordered[i], number=k) for k, i in enumerate(kept, start=1))
