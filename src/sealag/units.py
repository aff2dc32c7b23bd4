"""Units at the boundary: SI inside, milliseconds only in project files and on the terminal."""

import math
from numbers import Real

from sealag.errors import InputError

LONGEST_DELAY_S = 5.0
"""A longer network delay is refused as a mistaken unit: 8 ms written as 8. Ten times larger lets
that pass; ten times smaller refuses satellite links."""

_UNITS = ((1e9, "ns"), (1e6, "us"), (1e3, "ms"))
"""Factor from s and name of the units below it."""

_LONG_S, _LONGEST_S = 10.0, 1000.0 * 365.25 * 86400.0
_LONG_UNITS = ((365.25 * 86400.0, "years"), (86400.0, "days"), (3600.0, "h"), (1.0, "s"))
"""Between these seconds, units and names by decreasing size; each is used from three of it on."""


def seconds_from_ms(value_ms: float) -> float:
    """Convert milliseconds to seconds.

    Args:
        value_ms: a time in ms.

    Returns:
        The time in s.
    """
    return value_ms * 1e-3


def bound_text(value_s: float) -> str:
    """Say how long a delay may be, in three digits that are rounded down: never more than is known.

    Args:
        value_s: s, not negative; inf for a time that no delay reaches.
    """
    if value_s > LONGEST_DELAY_S:
        return f"more than {LONGEST_DELAY_S:g} s"
    value_ms = value_s * 1e3
    if value_ms <= 0.0:
        return "0 ms"
    step = 10.0 ** (math.floor(math.log10(value_ms)) - 2)
    down = math.floor(value_ms / step) * step
    return f"{down:.6g} ms" if down < 1e3 else f"{down * 1e-3:.6g} s"


def time_text(value_s: float | None) -> str:
    """Format a time in ns, us, ms or s with its significant digits.

    From ten seconds on it is a bound that no network reaches, in the unit that people use for it,
    rounded down.

    Args:
        value_s: s; inf for a time that no delay reaches, None for one that is not known.
    """
    if value_s is None or math.isnan(value_s):
        return "not known"
    if math.isinf(value_s):
        return "unbounded"
    if value_s == 0.0:
        return "0 ms"
    if value_s >= _LONGEST_S:
        return "more than 1000 years"
    if value_s >= _LONG_S:
        size, unit = next(pair for pair in _LONG_UNITS if value_s >= 3.0 * pair[0])
        return f"{math.floor(value_s / size)} {unit}"
    factor, unit = 1.0, "s"
    for smaller, name in _UNITS:
        if round(abs(value_s) * smaller, 3) < 1000.0:
            factor, unit = smaller, name
            break
    number = value_s * factor
    digits = f"{number:.3f}" if abs(number) >= 0.1 else f"{number:.4g}"
    return f"{digits} {unit}"


def in_ms(value_s: float) -> str:
    """Write a time in ms, as project files and options give it, with the digits that they have.

    Args:
        value_s: s.
    """
    return f"{value_s * 1e3:.9g} ms"


def number_of(text: str) -> float | None:
    """Return the number that a cell of a text file holds; None if it holds none.

    Digits are 0 to 9 and nothing stands between them: Python's own reading takes 0_3 and digits of
    other scripts for numbers.

    Args:
        text: the cell.
    """
    if not text.isascii() or "_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


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
    if not isinstance(value_s, Real) or isinstance(value_s, bool):
        raise InputError(f"{name} is {value_s!r}; it must be a number of seconds.")
    if not math.isfinite(value_s) or value_s < 0.0:
        raise InputError(f"{name} is {in_ms(value_s)}; it must be finite and not negative.")
    if value_s > LONGEST_DELAY_S:
        raise InputError(
            f"{name} is {in_ms(value_s)} ({value_s:g} s), longer than {in_ms(LONGEST_DELAY_S)}; "
            "was another unit meant?"
        )
    return value_s


__all__ = [
    "LONGEST_DELAY_S",
    "bound_text",
    "check_delay_s",
    "in_ms",
    "number_of",
    "seconds_from_ms",
    "time_text",
]
