"""P and X of the matrix inequality that proves a jitter margin."""

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from sealag.margin._channels import Channels, weighed
from sealag.margin._jitter import Broken
from sealag.margin._loop import Loop, roots_at_once
from sealag.typing import Array, BoolArray

_BACK_OFF = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
"""Relative distances from the supremum, where no P has room for rounding, in the order tried."""

_ROOMS = (1e-2, 1e-4, 1e-6)
"""Shares of the back-off by which the Riccati equation asks more than the inequality does: slow
modes take up more of the back-off than others, and a smaller share leaves less for rounding."""

_SOFTEST = 1e-7
"""Share of its largest value below which X⁻¹ is not let: directions without a command have any."""


class Multipliers(NamedTuple):
    """With ẏ = R A x + R L w and X = diag(X_d, X_e), b = diag(d, e),

        [[P A + Aᵀ P, P L], [⋆, −X]] + [R A, R L]ᵀ b X b [R A, R L] ≺ 0 ,   P ≻ 0, X ≻ 0.

    L picks the rows in which A_1 and A_e are not 0, R is these rows.

    Attributes:
        delay: d, s.
        P: (n, n).
        X: (r, r) of the rows of A_1.
        X_e: (e, e) of those of A_e.
    """

    delay: float
    P: Array
    X: Array
    X_e: Array


def multipliers(
    loop: Loop, broken: Broken, rows: BoolArray, embedded_rows: BoolArray
) -> Multipliers | None:
    """Return multipliers that prove the jitter margin less its back-off; None if rounding hides it.

    Args:
        loop: the prepared loop, whose states are the user's but for their scale.
        broken: it, broken where it is late.
        rows: (n,) in which A_1 is not 0.
        embedded_rows: (n,) in which A_e is not 0.
    """
    channels, e = Channels.of_broken(broken, loop.embedded_delay), loop.embedded_delay
    A = channels.A
    if not rows.any() or roots_at_once(A)[0]:
        return None
    found = weighed(channels)
    if not 0.0 < found.delay < math.inf:
        return None
    places = np.concatenate([np.flatnonzero(rows), np.flatnonzero(embedded_rows)])
    split = int(rows.sum())
    signals = np.vstack([loop.A_1[rows], loop.A_e[embedded_rows]])
    root, inverse_root = np.zeros((2, len(places), len(places)))
    blocks = (slice(0, split), slice(split, len(places)))
    for k, at in enumerate(blocks):
        if at.start < at.stop:
            L = broken.left[places[at]][:, channels.block == k]
            root[at, at], inverse_root[at, at] = _roots(L @ L.T / found.weights[k])
    L = np.eye(len(A))[:, places] @ root
    bound = np.where(np.arange(len(places)) < split, 1.0, e)
    for back_off in _BACK_OFF:
        delay = found.delay * (1.0 - back_off)
        R = (bound * np.where(np.arange(len(places)) < split, delay, 1.0))[:, None] * (
            inverse_root @ signals
        )
        tried = (_storage(A, L, R, room=share * back_off) for share in _ROOMS)
        P = next((one for one in tried if one is not None), None)
        if P is None:
            continue
        own = 1.0 / np.diagonal(loop.lift)  # from the user's states to the balanced ones
        X = inverse_root @ inverse_root * np.outer(own[places], own[places])
        return Multipliers(
            delay=delay,
            P=_even(P * np.outer(own, own)),
            X=_even(X[blocks[0], blocks[0]]),
            X_e=_even(X[blocks[1], blocks[1]]),
        )
    return None


def _storage(A: Array, L: Array, R: Array, *, room: float) -> Array | None:
    """P of [[P A + Aᵀ P, P L], [⋆, −I]] + [R A, R L]ᵀ [R A, R L] ≺ 0, by its Riccati equation."""
    from scipy.linalg import solve_continuous_are

    C, D = R @ A, R @ L
    inner = np.eye(L.shape[1]) - D.T @ D
    Q = C.T @ C
    Q = Q + room * float(np.linalg.norm(Q, 2)) * np.eye(len(A))
    with suppress(np.linalg.LinAlgError, ValueError):
        P = _even(solve_continuous_are(A, L, Q, -inner, s=C.T @ D))
        side = -P @ L - C.T @ D
        whole = np.block([[-(P @ A + A.T @ P) - C.T @ C, side], [side.T, inner]])
        lowest = min(np.linalg.eigvalsh(one)[0] for one in (_near_one(whole), _near_one(P)))
        if lowest > 0.0:
            return P
    return None


def _near_one(M: Array) -> Array:
    """A matrix scaled to a diagonal of 1; NaN where that is not positive."""
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = 1.0 / np.sqrt(np.diagonal(M))
    return M * np.outer(scale, scale)


def _roots(square: Array) -> tuple[Array, Array]:
    """X^-½ and X^½ of X⁻¹."""
    values, vectors = np.linalg.eigh(square)
    root = np.sqrt(np.maximum(values, _SOFTEST * values[-1]))
    return (vectors * root) @ vectors.T, (vectors / root) @ vectors.T


def _even(M: Array) -> Array:
    return (M + M.T) / 2.0
