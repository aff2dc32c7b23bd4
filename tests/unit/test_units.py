"""Times for people."""

import math

import pytest

from sealag.units import time_text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (45e-9, "45.000 ns"),
        (1.5e-6, "1.500 us"),
        (999.9996e-6, "1.000 ms"),
        (0.08054, "80.540 ms"),
        (0.0, "0 ms"),
        (1.25, "1.250 s"),
        (1e-15, "1e-06 ns"),
        (22213.0, "22213.000 s"),
        (1e12, "1e+12 s"),
        (math.inf, "unbounded"),
        (None, "not known"),
        (math.nan, "not known"),
    ],
)
def test_a_time_has_its_unit_and_digits_that_say_something(seconds, text):
    assert time_text(seconds) == text
