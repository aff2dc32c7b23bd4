"""V_4, the energy that a delay stores, along a logged motion."""

import numpy as np

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
    whole = _integrals(theta, theta_dot, Y, np.arange(len(step)), step, step)
    P = np.concatenate([[0.0], np.cumsum(whole[0])])
    PP = np.concatenate([[0.0], np.cumsum(whole[1] + P[:-1] * step)])

    def both(t: Array) -> tuple[Array, Array]:
        row = np.clip(np.searchsorted(time, t, "right") - 1, 0, len(step) - 1)
        part = np.clip(t - time[row], 0.0, None)
        more = _integrals(theta, theta_dot, Y, row, step[row], part)
        return P[row] + more[0], PP[row] + P[row] * part + more[1]

    now, before = both(at), both(at - delay)
    return (delay * now[0] - now[1] + before[1]) / (2.0 * delay)


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
