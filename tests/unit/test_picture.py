"""Pictures: formats, units, greys, and the same bytes for the same answer."""

import re

import numpy as np
import pytest

from sealag.errors import InputError
from sealag.picture import Curve, Picture


def picture(**changes):
    """Three curves with a gap, a level and a mark."""
    x = np.linspace(1.0, 2.0, 30)
    given = {
        "title": "three", "x": "time (s)", "y": "delay (ms)", "levels": {"required": 5.0},
        "marks": {"found": 1.5},
        "curves": tuple(
            Curve(name=f"curve {k}", x=x, y=np.where(x < 1.2, np.inf, k + x)) for k in range(3)
        ),
    }  # fmt: skip
    return Picture(**{**given, **changes})


def strokes(path):
    """Colours and dashes of an SVG."""
    text = path.read_text()
    return set(re.findall(r"#[0-9a-f]{6}", text)), set(
        re.findall(r"stroke-dasharray: ([^;\"]+)", text)
    )


@pytest.mark.parametrize(
    ("ending", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"),
                           ("html", b"<!doctype html>")],
)  # fmt: skip
def test_each_format(tmp_path, ending, begins):
    path = tmp_path / f"p.{ending}"
    picture().write(path)
    first = path.read_bytes()
    assert first.startswith(begins)
    picture().write(path)
    assert path.read_bytes() == first


def test_names_units_and_values_stand_in_it(tmp_path):
    path = tmp_path / "p.svg"
    picture().write(path)
    text = path.read_text()
    for words in ("time (s)", "delay (ms)", "curve 0", "curve 2", "required: 5 ms", "found: 1.5 s"):
        assert words in text


def test_curves_differ_without_colour(tmp_path):
    path = tmp_path / "p.svg"
    picture().write(path)
    colours, dashes = strokes(path)
    assert all(one[1:3] == one[3:5] == one[5:7] for one in colours)
    assert len(dashes) >= 4  # two curves, level and mark; the third curve is solid


def test_a_third_quantity_is_a_bar_of_greys(tmp_path):
    x = np.array([1.0, 10.0, 15.0])
    points = Curve(
        name="points", x=x, y=x, labels=("a", "b", "c"), shades=np.array([1.0, 2.0, 9.0])
    )
    path = tmp_path / "p.svg"
    picture(curves=(points,), shade="bandwidth (Hz)", logarithmic=True).write(path)
    text, (colours, _) = path.read_text(), strokes(path)
    assert "bandwidth (Hz)" in text
    assert ">b<" in text
    assert ">10<" in text
    assert all(one[1:3] == one[3:5] == one[5:7] for one in colours)
    assert {"#000000", "#ffffff"} <= colours


def test_values_over_two_decades_are_on_a_logarithmic_axis(tmp_path):
    x = np.linspace(1.0, 2.0, 5)
    paths = []
    for top in (10.0, 1e5):
        paths.append(tmp_path / f"{top:g}.svg")
        curve = Curve(name="", x=x, y=np.geomspace(1.0, top, 5))
        picture(curves=(curve,), levels={}, marks={}).write(paths[-1])
    labels = [set(re.findall(r">([0-9.]+)<", path.read_text())) for path in paths]
    assert "100" not in labels[0]
    assert {"100", "1000"} <= labels[1]


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(InputError, match="its ending must be png, svg, pdf or html"):
        picture().write(tmp_path / "p.jpg")
    assert not (tmp_path / "p.jpg").exists()
