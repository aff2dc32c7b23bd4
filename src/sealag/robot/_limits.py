"""Which configurations a robot can take."""

import math

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike, BoolArray

_ROUNDING = 1e-3  # rad, m: how far a position with a few digits may lie outside its limits
_MOST_ANGLE = 4.0 * math.pi  # rad, of a joint without limits
_MOST_LENGTH = 1e3  # m, of a sliding joint without limits
_FARTHEST = 1e4  # m, of the base from the origin


def refuse_outside(
    q: ArrayLike,
    joints: tuple[str, ...],
    *,
    lower: Array,
    upper: Array,
    sliding: BoolArray,
    floating: bool,
) -> None:
    """Refuse configurations outside position limits, or far outside any range.

    Args:
        q: (nq,) or (N, nq) rad and m.
        joints: (n,) names.
        lower: (n,) limits, -inf where there is none.
        upper: (n,) limits, inf where there is none.
        sliding: (n,) whether a joint is prismatic.
        floating: whether the first entries are the base's.

    Raises:
        InputError: a position lies outside; the message names joint, row, value and limits.
    """
    rows = np.atleast_2d(np.asarray(q, dtype=float))
    most = np.where(sliding, _MOST_LENGTH, _MOST_ANGLE)
    lower = np.where(np.isinf(lower), -most, lower)
    upper = np.where(np.isinf(upper), most, upper)
    positions = rows[:, rows.shape[1] - len(joints) :]
    bad = (positions < lower - _ROUNDING) | (positions > upper + _ROUNDING)
    if bad.any():
        row, k = np.argwhere(bad)[0]
        value, unit = float(positions[row, k]), "m" if sliding[k] else "rad"
        where = f" in row {row + 1}" if np.ndim(q) == 2 else ""
        angle = math.radians(value)
        fits = unit == "rad" and lower[k] <= angle <= upper[k]
        hint = f"; were {value:g} degrees meant? Then write {angle:.4g}" if fits else ""
        raise InputError(
            f"{joints[k]} is {value:g} {unit}{where}, outside its limits {lower[k]:.4g} … "
            f"{upper[k]:.4g} {unit}{hint}."
        )
    if floating and (np.abs(rows[:, :3]) > _FARTHEST).any():
        row, k = np.argwhere(np.abs(rows[:, :3]) > _FARTHEST)[0]
        raise InputError(
            f"base_{'xyz'[k]} is {rows[row, k]:g} m in row {row + 1}; the base is within "
            f"{_FARTHEST:g} m of the origin."
        )
