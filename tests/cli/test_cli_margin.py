"""`sealag margin`: the exact margin, and stable and unstable delays beyond it."""

import json

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from sealag.margin import rightmost_roots

BAXTER = EXAMPLES / "baxter.toml"


def test_intervals_agree_with_counted_roots(cli):
    code, text, err = cli("margin", BAXTER, "--horizon-ms", "150", "--json")
    answer = json.loads(text)
    assert (code, err) == (0, "")
    ranges = answer["intervals"]
    assert ranges[0]["to_s"] == pytest.approx(answer["delay_s"])
    assert ranges[-1]["to_s"] == pytest.approx(0.15)
    ends, begins = [a["to_s"] for a in ranges[:-1]], [b["from_s"] for b in ranges[1:]]
    np.testing.assert_allclose(ends, begins, rtol=1e-9)
    frozen = sealag.load(BAXTER).frozen()
    for part in ranges:
        middle = 0.5 * (part["from_s"] + part["to_s"])
        roots = rightmost_roots(frozen.A_0, frozen.A_1, middle, count=12)
        assert (roots.real > 0).sum() == part["unstable_roots"]
    assert np.unique([part["unstable_roots"] for part in ranges]).size > 1


def test_ranges_are_listed_in_words(cli):
    code, text, _ = cli("margin", BAXTER, "--horizon-ms", "150")
    assert code == 0
    assert "0 unstable roots" in text
    assert "4 unstable roots" in text
    code, text, err = cli("margin", BAXTER, "--horizon-ms", "0")
    assert (code, text) == (2, "")
    assert "horizon" in err
