"""The largest stiffness at each instant of a motion that changes at a bounded rate (docs/theory
section 16.9)."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sealag.design import certify
from sealag.passivity import Certificate, Criterion, Status
from sealag.robot import Motion
from sealag.tune._answer import Binding, Tuned
from sealag.tune._gains import floored
from sealag.tune._passive import EASE, Knobs
from sealag.tune._question import Limit, Question
from sealag.typing import Array
from sealag.units import time_text

_TRIES = 8
"""Certificates of a schedule that is scaled down to what polytopes prove; one to four are enough
where the motion is finely sampled."""
_NEAR = 2e-4
"""Share of the delay by which a schedule may stay below its boundary: 0.1 % more is beyond it."""


class _Tried(NamedTuple):
    """A schedule scaled by a share: its least factor, motion, certificate and delay."""

    share: float
    least: float
    motion: Motion
    certificate: Certificate
    reached: float

    @property
    def certified(self) -> bool:
        return self.certificate.answer.status is Status.CERTIFIED


def scheduled(question: Question) -> Tuned:
    """Return the design with the motion whose gains are the largest at every instant.

    s(t) = min over τ of s_max(τ) exp(r |t − τ|) is the largest function below s_max whose logarithm
    changes by r a second at most: no schedule within both is stiffer anywhere. It is scaled until
    one multiplier proves it for matrices that move inside polytopes.

    Args:
        question: its design, motion, delay and rate.
    """
    motion, system, rate = question.motion, question.system, question.limits[Limit.RATE]
    assert motion is not None
    limits = Knobs(question).limits(question.required * (1.0 + EASE))
    A = limits.whitened()
    if A is None:
        return Tuned.none(question, "gravity compensation alone is stiffer than the delay allows")
    each = np.linalg.eigvalsh(A[0])[:, -1].reshape(-1, len(motion)).max(axis=0)
    with np.errstate(divide="ignore"):
        largest = np.where(each > 0.0, 1.0 / each, np.inf)
    if np.isinf(largest).all():
        return Tuned.none(question, "no delay limits the stiffness at any instant")
    log = _steady(np.log(largest), motion.time, rate)
    own = np.ones(len(motion)) if motion.stiffness is None else motion.stiffness

    def tried(share: float) -> _Tried:
        factors = floored(share * np.exp(log))
        followed = replace(motion, stiffness=factors * own)
        certificate = certify(
            system, followed, criterion=Criterion.CERTIFIED, time_varying=True
        ).confirmed()
        answer = certificate.answer
        reached = min(answer.max_delay_s, answer.time_varying_delay_s or 0.0)
        return _Tried(share, float(factors.min()), followed, certificate, reached)

    last = _at_the_boundary(tried, question.required)
    certificate, reached = last.certificate, last.reached
    answer = certificate.answer
    held = reached >= question.required
    reasons = () if answer.status is Status.CERTIFIED else answer.reasons
    if not held:
        reasons = (
            f"matrices that move along the schedule tolerate {time_text(reached)}, and "
            f"{time_text(question.required)} are required; give a motion with more instants",
        )
    worst = answer.worst
    binding = Binding(
        kind="delay",
        instant=worst.instant,
        time_s=worst.time_s,
        joint=max(worst.direction, key=lambda name: worst.direction[name]),
        joints=worst.direction,
        spring_share=0.0,
    )
    return Tuned(
        question=question,
        system=system,
        reached_s=reached,
        found=held and not reasons,
        scale=last.least,
        factors={},
        binding=binding,
        certificate=certificate,
        reasons=reasons,
        schedule=last.motion,
    )


def _at_the_boundary(tried: Callable[[float], _Tried], required: float) -> _Tried:
    """The stiffest share that reaches a delay, to `_NEAR`; the last one tried if none does.

    Springs and delays are in series, so that the delay is nearly linear in 1/share.
    """
    share, held, broken = 1.0, None, None
    for _ in range(_TRIES):
        one = tried(share)
        if one.reached < required:
            broken = one
        elif held is None or one.certified or not held.certified:
            held = one
        else:  # passive, but no longer stable
            break
        if held is None:
            if not one.reached > 0.0:
                break
            share = one.share * one.reached / required * (1.0 - EASE)
        elif broken is None or held.reached <= required * (1.0 + _NEAR):
            break
        else:
            wanted = required * (1.0 + 0.5 * _NEAR) - broken.reached
            part = wanted / (held.reached - broken.reached)
            share = 1.0 / ((1.0 - part) / broken.share + part / held.share)
    return held or one


def _steady(log: Array, time: Array, rate: float) -> Array:
    """The largest function below log (N,) that changes by the rate at most, one pass each way."""
    steady = log.copy()
    steps = rate * np.diff(time)
    for k in range(1, len(steady)):
        steady[k] = min(steady[k], steady[k - 1] + steps[k - 1])
    for k in range(len(steady) - 2, -1, -1):
        steady[k] = min(steady[k], steady[k + 1] + steps[k])
    return steady
