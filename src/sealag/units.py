"""Units at the boundary: SI inside, milliseconds and degrees only where a person writes them."""

import math

from sealag.errors import InputError

LONGEST_DELAY_S = 5.0
"""A longer network delay than this is taken for a mistaken unit, not for a robot."""


def seconds_from_ms(value_ms: float) -> float:
    """Convert milliseconds to seconds.

    Args:
        value_ms: a time in ms.

    Returns:
        The time in s.
    """
    return value_ms * 1e-3


def check_delay_s(value_s: float, name: str) -> float:
    """Return a delay in s if it can be one.

    Args:
        value_s: the delay in s.
        name: what the message calls it.

    Returns:
        The same value.

    Raises:
        InputError: it is not finite, negative, or longer than LONGEST_DELAY_S.
    """
    if not math.isfinite(value_s) or value_s < 0.0:
        raise InputError(f"{name} is {value_s} s; a delay must be finite and not negative.")
    if value_s > LONGEST_DELAY_S:
        raise InputError(
            f"{name} is {value_s:g} s, longer than {LONGEST_DELAY_S:g} s; "
            f"was {value_s:g} ms meant? Then write {value_s * 1e-3:g} s."
        )
    return value_s
