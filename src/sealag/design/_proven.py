"""The proof of a frozen loop's jitter margin that a certificate holds."""

import math

from sealag.errors import SolverError
from sealag.margin import DelayedLoop
from sealag.passivity import LocalLoop
from sealag.whole_body import FrozenLoop


def proven_jitter(stated: LocalLoop, loop: FrozenLoop) -> LocalLoop:
    """Return the loop with multipliers that prove its jitter margin; as it is where there are none.

    Args:
        stated: a loop that is stable without delay, as a certificate states it.
        loop: the same, with what the command is made of.
    """
    without = stated.without_symmetries()
    A_0, _, A_e = without.doubles()
    B, C = without.sides(loop.B, loop.C)
    late = bool(A_e.any())
    rows, embedded_rows = without.rows
    try:
        found = DelayedLoop(
            A_0=A_0,
            B=B,
            C=C,
            A_e=A_e if late else None,
            embedded_delay=stated.embedded_delay_s if late else 0.0,
        ).jitter_multipliers(rows, embedded_rows)
    except SolverError:
        return stated
    if found is None:
        return stated
    return stated.proven(found.delay, P=found.P, X=found.X, X_e=found.X_e) or stated


def stated_jitter(loop: LocalLoop | None, margin: float) -> float | None:
    """Return the jitter margin that a certificate states, s; None if none is proven.

    Args:
        loop: the frozen loop of the critical instant, with its proof; None if there is no loop.
        margin: the exact margin there, s; 0 where it is unstable without delay, NaN if open.
    """
    if margin == 0.0:
        return 0.0
    if loop is not None and loop.jitter is not None:
        return loop.jitter.delay_s
    free = loop is not None and not loop.A_1.any()
    return math.inf if free and margin == math.inf else None
