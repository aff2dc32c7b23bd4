"""`sealag margin`: the exact margin, and stable and unstable delays beyond it."""

import json
import re

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES

BAXTER = EXAMPLES / "baxter.toml"
CASE = EXAMPLES.parent / "tests" / "data" / "cases" / "s7_static_joint_gravity.toml"


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
        roots = frozen.roots(middle, count=12)
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


def test_a_horizon_beyond_counting_is_refused(tmp_path, cli):
    """A motor on a hard spring, hardly damped, whose roots cross hundreds of times a second."""
    fast, text = tmp_path / "fast.toml", CASE.read_text()
    for old, new in (
        ('"one.urdf"', f'"{CASE.parent}/one.urdf"'), ("=100.0", "=1e5"), ("=60.0", "=1.0"),
        ("=90.0", "=5000.0"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new, 1)
    fast.write_text(text)
    code, text, err = cli("margin", fast, "--horizon-ms", "1e6")
    assert (code, text, err.count("\n")) == (2, "", 1)
    short = re.search(r"--horizon-ms (\S+)\)", err)
    assert short is not None
    code, text, _ = cli("margin", fast, "--horizon-ms", short[1], "--json")
    assert code == 0
    assert 1_000 < len(json.loads(text)["intervals"]) <= 10_000


def test_a_rate_sweep_says_what_each_rate_tolerates(cli):
    code, text, err = cli("margin", BAXTER, "--rate-sweep")
    assert (code, err) == (0, "")
    assert re.search(r"50\.0 Hz +9\d\.\d+ ms +\d+\.\d+ ms +[\d.]+ ms, stable", text)
    assert text.splitlines()[-1].endswith("Hz: stable")
    code, text, err = cli("margin", BAXTER, "--rate-sweep", "--horizon-ms", "150")
    assert (code, text) == (2, "")
    assert "--rate-sweep" in err


def test_a_rate_sweep_in_json(cli):
    code, text, _ = cli("margin", BAXTER, "--rate-sweep", "--json")
    assert code == 0
    rates = json.loads(text)["rates"]
    assert [one["rate_hz"] for one in rates] == sorted(one["rate_hz"] for one in rates)
    for one in rates:
        known = one["largest_delay_s"] is not None
        assert one["proven_s"] <= (one["largest_delay_s"] if known else one["proven_s"])
        assert one["stable"] is True


def test_a_program_is_said_to_remember_and_to_bend(tmp_path, cli):
    """A PD with filtered rates, whose stiffness grows with its error."""
    (tmp_path / "soft.py").write_text(
        "import numpy as np\n\n\nclass Soft:\n"
        "    def __init__(self, system):\n"
        "        self.load = system.robot.gravity(system.posture)\n"
        "        joints = system.robot.joint_positions(system.posture)\n"
        "        self.target = joints + self.load / system.actuators.spring_stiffness\n\n"
        "    def reset(self, t, measurement):\n        self.rate = 0.0 * self.load\n\n"
        "    def tick(self, t, measurement, out):\n"
        "        away = self.target - measurement.theta\n"
        "        out[:] = self.load + 300.0 * away + 5e7 * away**3 - 2.0 * self.rate\n"
        "        self.rate += 0.3 * (measurement.theta_dot - self.rate)\n\n\n"
        "controller = Soft\n"
    )
    text = (EXAMPLES / "panda.toml").read_text()
    head, rest = text.split("[controller]")
    delays = rest[rest.index("[delays]") :]
    project = tmp_path / "p.toml"
    project.write_text(f'{head}[controller]\nkind = "python"\nfile = "soft.py"\n\n{delays}')
    code, text, err = cli("margin", project)
    assert (code, err) == (0, "")
    assert "one way varies, every delay below it" in text
    assert re.search(r"controller +7 states; bends by 0\.\d+ of its answers", text)
