"""The largest delay that may vary as it likes, over all instants of a motion."""

from collections.abc import Iterator

import numpy as np

from sealag.design._along import Along
from sealag.design._local import Local
from sealag.errors import SolverError
from sealag.margin import jitter_margin
from sealag.passivity import Place
from sealag.typing import Array
from sealag.whole_body import FrozenLoop

_MOST = 200
"""Instants whose jitter margin is computed; the passive bound decides the others. Ten times more
take a minute on a walk, and gain the few percent by which both differ."""


def jitter_along(along: Along, bounds: Array, local: Local) -> float | None:
    """Largest delay at which every instant is stable however the delay varies below it, s.

    What is passive at a delay is so however it varies: an instant that is stable without delay
    tolerates at least its passive bound. The jitter margin (docs/theory section 7.4) is computed
    where that bound lies below the smallest answer so far.

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
    least = np.inf
    for turn, k in enumerate(np.argsort(bounds, kind="stable").tolist()):
        if bounds[k] >= least:
            break
        if turn == _MOST:
            return float(bounds[k]) or None
        try:
            found = min(_margin(loop) for loop in _loops(along, k, local))
        except SolverError:
            return None
        least = min(least, max(found, float(bounds[k])))
    return float(least)


def _margin(loop: FrozenLoop) -> float:
    return jitter_margin(
        loop.A_0,
        loop.B,
        loop.C,
        A_e=loop.A_e,
        embedded_delay=loop.embedded_delay,
        symmetries=loop.symmetries,
    ).delay


def _loops(along: Along, k: int, local: Local) -> Iterator[FrozenLoop]:
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
