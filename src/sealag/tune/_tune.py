"""Which gain should I use? Largest stiffness or bandwidth, least damping, for a delay."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import InputError, word
from sealag.robot import Motion
from sealag.tune._answer import Tuned
from sealag.tune._front import front_of
from sealag.tune._gains import rounded
from sealag.tune._joint_pd import joint_inertia, pd_design
from sealag.tune._mapping import mapped
from sealag.tune._numbers import number_of, passive_bound
from sealag.tune._optimal import optimal
from sealag.tune._passive import EASE, Knobs, damped
from sealag.tune._question import LARGEST_SAFETY, Aim, Limit, Number, Question, Share
from sealag.tune._room import closed_text, least_of, room_of
from sealag.tune._search import first_crossing
from sealag.tune._shaping import least_shaping
from sealag.typing import Array
from sealag.units import check_delay_s, time_text

_SCALES = (1e-3, 1e4)
"""Factors of the stiffness among which a margin is searched."""
_BANDWIDTHS = (0.1, 1e4)
"""rad/s: bandwidths that are searched."""
_LIMITS = (1e-6, 1e6)
"""Hz, Nm: limits that are taken."""
_SHARES = (1.0 - 1e-4, 1.0 - 1e-2, 0.95, 0.9, 0.8, 0.6, 0.4, 0.2, 0.1)
"""Shares of the passive limit that are tried where stability ends before."""
_WIDTH = 1e-4
"""Width to which such a share is bisected."""
_BELOW = 0.99
"""Share of the passive gain at which a margin surely holds, whatever rounding says."""
_BEYOND = 1.0 + 1e-3
"""Factor beyond a limit at which a loop is asked what stopped it."""


def tune(
    system: System,
    motion: Motion | None = None,
    *,
    aim: str = "stiffness",
    number: str = "passive",
    share: str = "common",
    safety: float = 1.0,
    delay: float | None = None,
    bandwidth: float | None = None,
    damping_ratio: float = 1.0,
    limits: Mapping[str, float] | None = None,
) -> Tuned:
    """Find gains for a delay, over a posture or all instants of a motion (docs/theory section 16).

    Args:
        system: the design whose gains are changed.
        motion: its instants; the posture if None.
        aim: stiffness, the largest K_x or K_p; bandwidth, the largest ω of joint PD, or what a
            given one tolerates; damping, the least trace D_θ; drag, the least energy that D_θ takes
            along the motion; shaping, the least β that loop rate and torque noise allow.
        number: the delay that must reach the required one: passive (closed form or a convex
            program, certified), jitter or constant (the first crossing from small gains up).
        share: what has a factor of its own: common (all tasks), task, or direction (of joint PD:
            joint); the latter two maximise the geometric mean of the factors.
        safety: factor on the delay, at least 1.
        delay: what is tolerated, s; the design's d_1 if None. A shorter one scales the ways of its
            connections.
        bandwidth: ω of joint PD, rad/s; the largest that the delay leaves if None.
        damping_ratio: ζ of joint PD.
        limits: of transparency, for stiffness, damping and drag: bandwidth, the least of the locked
            joints, Hz; rms, the largest of Γ_sea against its command along the motion, Nm. For the
            largest stiffness motor damping is set to the most that they leave. For shaping: noise,
            the largest gain |B / B_s − 1| of torque noise.

    Returns:
        The gains, or why there are none; no gain is a result, not an error.

    Raises:
        InputError: a word is none, a number is out of range, or the parts do not fit together.
        RobotError: a mass matrix is not positive definite.
        SolverError: a solver gives up.
    """
    _check("safety", safety, 1.0, LARGEST_SAFETY)
    _check("damping_ratio", damping_ratio, 0.0, 1e3)
    if bandwidth is not None:
        _check("bandwidth", bandwidth, *_BANDWIDTHS)
    if delay is not None:
        system = _delayed(system, delay)
    question = Question(
        system=system,
        motion=motion,
        aim=word(Aim, aim, what="aim"),
        number=word(Number, number, what="number"),
        share=word(Share, share, what="share"),
        required=safety * system.delays.d_1,
        bandwidth=bandwidth,
        damping_ratio=damping_ratio,
        limits=_limits(limits or {}),
    )
    if question.aim is Aim.BANDWIDTH:
        return _bandwidth(question)
    if question.aim is Aim.SHAPING:
        return least_shaping(question)
    if question.aim is Aim.MAPPING:
        return mapped(question)
    if question.aim is Aim.OPTIMAL:
        return optimal(question)
    if question.aim is Aim.FRONT:
        return front_of(question)
    if question.aim is not Aim.STIFFNESS:
        return _least_damping(question)
    if question.number is Number.PASSIVE:
        return _stiffest(question)
    return _stiffest_by_margin(question)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError(f"{name} is {value:g}; it must lie in {low:g} … {high:g}.")


def _limits(given: Mapping[str, float]) -> dict[Limit, float]:
    for name, value in given.items():
        _check(f"The limit {name}", value, *_LIMITS)
    return {word(Limit, name, what="limit"): value for name, value in given.items()}


def _delayed(system: System, delay: float) -> System:
    """The design with its ways scaled so that d_1 is a delay; periods stay."""
    check_delay_s(delay, "The delay")
    own, periods = system.delays.d_1, system.delays.scaled(0.0).d_1
    if delay < periods or (own == periods and delay != own):
        raise InputError(
            f"The delay is {time_text(delay)}, but the periods of the design's loops alone make "
            f"{time_text(periods)} of its {time_text(own)}; change [delays]."
        )
    if own == periods:
        return system
    scaled = system.delays.scaled((delay - periods) / (own - periods))
    return replace(system, delays=scaled)


def _stiffest(question: Question) -> Tuned:
    """Largest stiffness by the passive number: the closed form, or the fairest factors."""
    room = room_of(question)
    if room.closed().any():
        return Tuned.none(question, closed_text(question, room))
    knobs = Knobs(question, room.design(question.system))
    _, at_limit = knobs.stiffest(question.required)
    if at_limit.scale == 0.0:
        return Tuned.none(question, "gravity compensation alone is stiffer than the delay allows")
    factors, wall = knobs.stiffest(question.required * (1.0 + EASE))
    common = question.share is Share.COMMON
    limit = _limit(at_limit.scale) if common else _mean(knobs.stiffest(question.required)[0])

    stopper = "transparency" if question.limits else "delay"

    def at(share: float, kind: str = stopper) -> Tuned:
        gains = share * factors
        return Tuned.of(
            question,
            knobs.design(gains),
            kind=kind,
            factors={group.name: float(gain) for group, gain in zip(knobs.groups, gains)},
            scale=float(gains[0]) if common else None,
            limit=limit,
            spring_share=0.0 if kind == "stability" else wall.spring,
        )

    tuned = at(1.0)
    if tuned.found or (tuned.binding is None and not at(_SHARES[-1]).found):
        return tuned  # in the second case a condition fails whatever the gains
    share = _stable_share(lambda share: at(share).found)
    return tuned if share is None else at(share, "stability")


def _stable_share(holds: Callable[[float], bool]) -> float | None:
    """The largest share of gains at their passive limit with which the loop is stable; None if
    none is found.

    Beside the springs' limit q̄(θ) has no last digits, and a law whose matrices move with its error
    can lose its stability before it loses its passivity.
    """
    bad = 1.0
    for good in _SHARES:
        if holds(good):
            while bad - good > _WIDTH:
                middle = (good + bad) / 2.0
                good, bad = (middle, bad) if holds(middle) else (good, middle)
            return good
        bad = good
    return None


def _limit(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _mean(factors: Array) -> float:
    """The geometric mean."""
    return float(np.exp(np.log(factors).mean()))


def _least_damping(question: Question) -> Tuned:
    """Least damping by the passive number; a margin goes on from there in its direction."""
    room = room_of(question)
    if room.closed().any():
        return Tuned.none(question, closed_text(question, room))
    at_limit = damped(question, question.required, room)
    eased = damped(question, question.required * (1.0 + EASE), room)
    if isinstance(at_limit, str):
        return Tuned.none(question, at_limit)
    if isinstance(eased, str):
        return Tuned.none(question, eased)
    (_, cost), (design, _) = at_limit, eased
    if question.number is Number.PASSIVE:
        held = (design.actuators.motor_damping >= room.most * (1.0 - EASE)).any()
        return Tuned.of(question, design, kind="transparency" if held else "delay", limit=cost)
    drives, floor = design.actuators, least_of(question.system)

    def less(factor: float) -> System:
        damping = np.maximum(drives.motor_damping / factor, floor)
        return rounded(replace(design, actuators=replace(drives, motor_damping=damping)), up=True)

    most = float((drives.motor_damping / floor).max())  # beyond, nothing is left to take
    return _searched(question, less, low=_BELOW, high=min(most, _SCALES[1]))


def _stiffest_by_margin(question: Question) -> Tuned:
    """Largest common stiffness by the jitter or constant margin: the first crossing."""
    knobs = Knobs(question)
    low, high = _SCALES
    design = knobs.design
    # All factors below one whose passive bound is long enough have a margin of that length.
    passive, _ = knobs.stiffest(question.required * (1.0 + EASE))
    if passive_bound(question, design(passive)) >= question.required:
        low = _BELOW * float(passive[0])
        high = max(high, low * _SCALES[1])
    return _searched(question, lambda factor: design(np.array([factor])), low=low, high=high)


def _bandwidth(question: Question) -> Tuned:
    """Gains of joint PD for a bandwidth, or for the largest one."""
    inertia = joint_inertia(question.system, question.motion)

    def design(bandwidth: float) -> System:
        return pd_design(question.system, inertia, bandwidth, question.damping_ratio)

    if question.bandwidth is not None:
        return Tuned.of(question, design(question.bandwidth), bandwidth_rad_s=question.bandwidth)
    low, high = _BANDWIDTHS
    return _searched(question, design, low=low, high=high)


def _searched(
    question: Question, design: Callable[[float], System], *, low: float, high: float
) -> Tuned:
    """The first crossing of a number from small gains up."""
    required = question.required * (1.0 + EASE)

    def holds(x: float) -> bool:
        value, _ = number_of(question, design(x))
        return value is not None and value >= required

    x = first_crossing(holds, low=low, high=high)
    names = {Aim.BANDWIDTH: "bandwidth", Aim.STIFFNESS: "factor"}
    name = names.get(question.aim, "share of the passive damping, 1 /")
    if x is None:
        return Tuned.none(
            question,
            f"no {name} from {low:g} to {high:g} has the {question.number} number "
            f"{time_text(question.required)}",
        )
    _, kind = number_of(question, design(x * _BEYOND))
    return Tuned.of(
        question,
        design(x),
        kind=kind,
        limit=None if x >= high else x,
        scale=x if question.aim is Aim.STIFFNESS else None,
        bandwidth_rad_s=x if question.aim is Aim.BANDWIDTH else None,
    )
