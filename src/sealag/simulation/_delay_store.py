"""V_4, the energy that a delay stores, along a logged motion."""

import numpy as np

from sealag.store import blocks, release
from sealag.typing import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def delay_store(
    time: Array, theta: Array, theta_dot: Array, Y: Array, *, delay: float
) -> tuple[Array, float]:
    """Return V_4 = 1/(2d) ∫_{t−d}^{t} (ξ − t + d) θ̇(ξ)ᵀ Y θ̇(ξ) dξ (N,) and a bound of its error, J.

    Between rows the motor angles are the cubic through angles and speeds; before the first row the
    motors rest. The bound is what every second row alone would give otherwise, where the error is
    at most an eighth of that.

    Args:
        time: Instants (N,), s.
        theta: Motor angles (N, n), rad.
        theta_dot: Motor speeds (N, n), rad/s.
        Y: The multiplier (n, n).
        delay: d, s, positive.
    """
    stored = _store(time, theta, theta_dot, Y, delay, time)
    coarse = np.append(np.arange(0, len(time) - 1, 2), len(time) - 1)
    other = _store(time[coarse], theta[coarse], theta_dot[coarse], Y, delay, time)
    return stored, float(np.abs(stored - other).max())


def _store(time: Array, theta: Array, theta_dot: Array, Y: Array, delay: float, at: Array) -> Array:
    """V_4 at instants (A,): ∫(ξ − t + d) p dξ = d P(t) − PP(t) + PP(t − d), P = ∫p, PP = ∫P."""
    step = np.diff(time)
    P, PP, stored = np.zeros(len(time)), np.zeros(len(time)), np.zeros(len(at))
    for rows in blocks(len(step)):
        later = slice(rows.start + 1, rows.stop + 1)
        part = np.arange(rows.start, rows.stop)
        once, twice = _integrals(theta, theta_dot, Y, part, step[rows], step[rows])
        P[later] = P[rows.start] + np.cumsum(once)
        PP[later] = PP[rows.start] + np.cumsum(twice + P[rows] * step[rows])
        release(theta, theta_dot)

    def both(t: Array) -> tuple[Array, Array]:
        row = np.clip(np.searchsorted(time, t, "right") - 1, 0, len(step) - 1)
        part = np.clip(t - time[row], 0.0, None)
        once, twice = _integrals(theta, theta_dot, Y, row, step[row], part)
        return P[row] + once, PP[row] + P[row] * part + twice

    for rows in blocks(len(at)):
        (P_now, PP_now), (_, PP_before) = both(at[rows]), both(at[rows] - delay)
        stored[rows] = (delay * P_now - PP_now + PP_before) / (2.0 * delay)
        release(theta, theta_dot)
    return stored


def _integrals(
    theta: Array, theta_dot: Array, Y: Array, row: Array, step: Array, part: Array
) -> tuple[Array, Array]:
    """∫p and ∫∫p over a part of the intervals that begin at rows (R,); Gauss is exact for both."""
    first, last = theta_dot[row], theta_dot[row + 1]
    mean = (theta[row + 1] - theta[row]) / step[:, None]
    once, twice = np.zeros(len(row)), np.zeros(len(row))
    for node, weight in zip(0.5 * (1.0 + _NODES), 0.5 * _WEIGHTS):
        s = (node * part / step)[:, None]
        rate = first * (1 - s) * (1 - 3 * s) + last * s * (3 * s - 2) + 6 * mean * s * (1 - s)
        power = np.einsum("ri,ij,rj->r", rate, Y, rate)
        once += weight * part * power
        twice += weight * part * power * part * (1.0 - node)
    return once, twice
