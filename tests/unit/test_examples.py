"""The example scripts run, and print what they promise."""

import runpy

import pytest

from helpers.source import ROOT

EXAMPLES = ROOT / "examples"
PRINTS = {
    "joint_pd": "40   1.0  drives  25.00 ms  25.00 ms  25.10 ms",
    "loop_margin": "margin 77.3",
    "packet_ages": "the certificate counts 19.50 ms",
    "recording": "/spring_power",
    "transparency": "damping ratio 0.89",
}


@pytest.mark.parametrize("name", PRINTS)
def test_an_example_runs(name, capsys):
    runpy.run_path(str(EXAMPLES / f"{name}.py"))
    assert PRINTS[name] in capsys.readouterr().out


def test_every_script_is_tried():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(PRINTS)
