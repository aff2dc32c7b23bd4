"""Times for people."""

import math

import pytest

from sealag.errors import InputError
from sealag.units import bound_text, check_delay_s, seconds_from_ms, time_text


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
        (9.9996, "10.000 s"),
        (19.311953647, "19 s"),
        (729.916, "729 s"),
        (22213.0, "6 h"),
        (19_311_953.647, "223 days"),
        (4e8, "12 years"),
        (1e12, "more than 1000 years"),
        (math.inf, "unbounded"),
        (None, "not known"),
        (math.nan, "not known"),
    ],
)
def test_a_time_has_its_unit_and_digits_that_say_something(seconds, text):
    assert time_text(seconds) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.08056, "80.5 ms"),
        (0.066, "66 ms"),
        (0.0089659, "8.96 ms"),
        (1.7139, "1.71 s"),
        (4.999, "4.99 s"),
        (4.5e-7, "0.00045 ms"),
        (19.3, "more than 5 s"),
        (math.inf, "more than 5 s"),
        (0.0, "0 ms"),
    ],
)
def test_a_bound_is_rounded_down(seconds, text):
    assert bound_text(seconds) == text


def test_milliseconds_are_thousandths_of_a_second():
    assert seconds_from_ms(8.0) == pytest.approx(0.008)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (8.0, r"8000 ms \(8 s\), longer than 5000 ms; was another unit"),
        (-0.02, "-20 ms; .* negative"),
        (6.0, "ms"),
    ],
)
def test_a_delay_that_cannot_be_one_is_refused(value, words):
    """5 s is a satellite link; 8 s is 8 ms, written so."""
    assert check_delay_s(5.0, "The delay") == 5.0
    with pytest.raises(InputError, match=words):
        check_delay_s(value, "The delay")
