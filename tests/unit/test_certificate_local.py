"""The local margin of a certificate is checked from its frozen loop, by another method."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import sealag
from helpers.certificates import failures, made, plain
from sealag.margin import delay_margin, random_sea_plant, rightmost_roots
from sealag.passivity import verify
from sealag.passivity._local import _added, _roots


def as_first_order(loop):
    P, R, L = (np.array(loop[key]) for key in "PRL")
    zero, one = np.zeros_like(P), np.eye(len(P))
    return np.block([[zero, one], [-P, -R]]), np.block([[zero, zero], [-L, zero]])


def test_counts_of_roots_agree_with_collocation():
    """Below, between and beyond the crossings of random plants."""
    compared = 0
    for seed in range(6):
        plant = random_sea_plant(seed, joints=3, feedback="motor")
        A_0, A_1 = plant.A_0, plant.A_1
        margin = delay_margin(A_0, A_1, symmetries=plant.symmetries)
        unknown = not np.isfinite(margin.first_crossing) or margin.unstable_roots
        if unknown or plant.symmetries.size:
            continue
        h = len(A_0) // 2
        P, R, L = -A_0[h:, :h], -A_0[h:, h:], -A_1[h:, :h]
        roots, _ = _roots(P + L, R)
        for share in (0.5, 0.999, 1.001, 3.0):
            delay = share * margin.first_crossing
            added = _added(P, R, L, roots, delay=delay, omega=margin.frequency)
            right = rightmost_roots(A_0, A_1, delay, count=8)
            assert added == int((right.real > 0.0).sum()), (share, right)
            compared += 1
    assert compared >= 12


def test_every_example_has_a_loop_that_gives_its_margin():
    for design in ("baxter", "moving", "one foot"):
        data = made(design)
        margin = delay_margin(
            *as_first_order(data["local_loop"]),
            symmetries=np.vstack([V := np.array(data["local_loop"]["symmetries"]), 0.0 * V]),
        )
        assert margin.unstable_roots == data["unstable_modes"]
        assert margin.first_crossing == pytest.approx(data["first_crossing_s"], rel=1e-9)


def _crossing(d, factor):
    d["first_crossing_s"] *= factor
    if d["local_margin_s"]:
        d["local_margin_s"] *= factor
        d["conservatism"] = d["local_margin_s"] / d["max_delay_s"]


def _later(d):
    """A true crossing of the same root, one period after the first."""
    period = 2.0 * np.pi / d["local_loop"]["frequency_rad_s"]
    _crossing(d, 1.0 + period / d["first_crossing_s"])


def _links(d):
    loop = d["local_loop"]
    for row in loop["P"][: len(loop["P"]) - len(d["joints"])]:
        row[:] = [1.00001 * value for value in row]


def _entry(key, row, column, factor):
    def change(d):
        d["local_loop"][key][row][column] *= factor

    return change


CLAIMS = {
    "later": ("root on the axis", lambda d: _crossing(d, 1.0001)),
    "earlier": ("root on the axis", lambda d: _crossing(d, 0.9999)),
    "another crossing": ("no root crosses before", _later),
    "margin alone": ("local margin", lambda d: d.update(local_margin_s=1.0, conservatism=10.0)),
    "unstable": ("unstable modes", lambda d: d.update(unstable_modes=2)),
    "stable": (
        ("potential has a minimum", "stable without delay"),
        lambda d: d.update(stable=not d["stable"]),
    ),
    "no loop": ("local margin", lambda d: d.update(local_loop=None)),
    "delayed stiffness": ("frozen loop: motors", _entry("L", -1, -1, 1.001)),
    "springs": ("frozen loop: motors", _entry("P", -1, -1, 1.001)),
    "damping": ("frozen loop: motors", _entry("R", -1, -1, 1.001)),
    "links": ("root on the axis", _links),
}


@pytest.mark.parametrize("name", CLAIMS)
@pytest.mark.parametrize("design", ["baxter", "moving"])
def test_a_changed_claim_is_found_by_its_check(design, name):
    check, change = CLAIMS[name]
    data = made(design)
    change(data)
    assert any(failed.startswith(check) for failed in failures(data))


def test_a_symmetry_along_which_something_acts_is_found():
    data = made("one foot")
    assert failures(data) == []
    for row in data["local_loop"]["symmetries"]:
        row[0] += 0.1
    assert "frozen loop: symmetries" in failures(data)


def test_a_slack_crossing_is_not_hidden_by_leaving_it_out():
    """Null claims nothing; a margin that is claimed needs its crossing."""
    data = made("baxter")
    data["first_crossing_s"] = None
    assert "local margin" in failures(data)
    data.update(local_margin_s=None, conservatism=None)
    assert failures(data) == []


def test_files_stay_small():
    assert len(json.dumps(made("baxter"))) < 60_000
    assert len(json.dumps(made("moving"))) < 120_000


def test_a_loop_that_gains_stability_before_its_first_crossing_is_no_contradiction(tmp_path):
    """Without contacts ANYmal's base turns with its legs: two roots move left on the way."""
    text = Path("examples/anymal.toml").read_text()
    project = tmp_path / "floating.toml"
    project.write_text(re.sub(r'\[\[contacts\]\]\nframe = "\w+"\n', "", text))
    certificate = sealag.certify(sealag.load(project))
    data = plain(certificate)
    assert data["unstable_modes"] == 2
    count = [c for c in verify(data).checks if c.name == "no root crosses before"]
    assert count[0].ok
    assert "-2" in count[0].detail
    assert failures(data) == []
