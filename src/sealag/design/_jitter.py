"""The largest delay that may vary as it likes, over all instants of a motion."""

from collections.abc import Iterator

import numpy as np

from sealag.design._along import Along
from sealag.design._local import Local
from sealag.errors import SolverError
from sealag.passivity import Basis, Place
from sealag.typing import Array
from sealag.whole_body import FrozenLoop

_MOST = 100
"""Instants in a minimum of their potential whose jitter margin is computed; then the next passive
bound is the answer, less by the percents by which both differ. Ten times more take a minute."""


def jitter_along(along: Along, bounds: Array, local: Local) -> float | None:
    """Largest delay at which every instant is stable however the delay varies below it, s.

    What is passive at a delay is so however it varies: an instant in a minimum of its potential
    tolerates at least its passive bound. The jitter margin (docs/theory section 7.4) is computed
    at all other instants, and where that bound lies below the smallest answer so far.

    Args:
        along: the design and its motion.
        bounds: (N,) of the certified criterion, s; 0 where it decides nothing.
        local: stability over the same motion.

    Returns:
        The delay; 0 if an instant is unstable without delay, None if that is not known or the
        answer of an instant is left open.
    """
    if not local.stable:
        return None if local.stable is None else 0.0
    minimum = (local.basis == Basis.BOUND) | (local.basis == Basis.SEARCHED)
    covered = np.where(minimum, bounds, 0.0)
    least, searched = np.inf, 0
    for k in np.argsort(covered, kind="stable").tolist():
        if covered[k] >= least:
            break
        if searched == _MOST:
            return float(covered[k])
        searched += bool(covered[k])
        try:
            for loop in loops_at(along, k, local):
                longest = least if np.isfinite(least) else None
                least = min(least, loop.jitter_margin(at_most=longest).delay)
        except SolverError:
            return None
    return float(least)


def loops_at(along: Along, k: int, local: Local) -> Iterator[FrozenLoop]:
    """The loops of an instant: in its posture and, where the law sags, where it rests."""
    system, motion = along.system, along.motion
    posture = system.in_posture(motion, k)
    known = local.loop if k == local.critical else None
    if known is not None and local.at is Place.POSTURE:
        yield known
    else:
        yield system.frozen(motion, k, rest=posture)
    if system.law.rests_at_posture and posture.found:
        return
    if known is not None and local.at is Place.REST:
        yield known
    else:
        yield system.frozen(motion, k, rest=system.rest(motion, k))
