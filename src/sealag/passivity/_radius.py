"""The numerical radius, as a bracket of the largest delay."""

from typing import NamedTuple

import numpy as np

from sealag.errors import InputError
from sealag.passivity._problem import EPS
from sealag.typing import Array


class Bracket(NamedTuple):
    """Delays between which 1/w(A) lies, and the angle at which w(A) is reached."""

    delay: Array
    upper: Array
    angle: Array


def bracket(A: Array, error: Array, *, tolerance: float) -> Bracket:
    """Bracket 1/w(A), w the numerical radius max |z* A z| over unit z.

    Args:
        A: (…, n, n) D^-½ F D^-½, 1/s.
        error: (…) norm-wise error of A, 1/s.
        tolerance: relative width at which refinement stops.

    Raises:
        InputError: A is not finite, or the tolerance is out of range.
    """
    from sealag.kernels.numerical_radius import numerical_radii

    if not 1e-12 <= tolerance <= 0.1:
        raise InputError(f"tolerance is {tolerance:g}; it must lie in 1e-12 … 0.1.")
    if not np.isfinite(A).all():
        raise InputError("The scaled stiffness overflows; check the units of K_x and D_theta.")
    shape, n = A.shape[:-2], A.shape[-1]
    flat = np.ascontiguousarray(A).reshape(-1, n, n)
    spread = np.array(np.broadcast_to(error, shape), dtype=float).reshape(-1)
    lower, upper, angle = (np.empty(len(flat)) for _ in range(3))
    numerical_radii(flat, spread, 0.5 * tolerance, lower, upper, angle)
    with np.errstate(divide="ignore"):
        delay = (1.0 - 4.0 * EPS) / upper
        longest = (1.0 + 4.0 * EPS) / lower
    return Bracket(
        delay=delay.reshape(shape), upper=longest.reshape(shape), angle=angle.reshape(shape)
    )
