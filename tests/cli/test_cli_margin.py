"""`sealag margin`: the exact margin, and stable and unstable delays beyond it."""

import json
import re

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES

BAXTER = EXAMPLES / "baxter.toml"
CASE = EXAMPLES.parent / "tests" / "data" / "cases" / "s7_static_joint_gravity.toml"

ARM = """
[robot]
urdf = "arm.urdf"
base = "fixed"
actuated = ["shoulder", "elbow"]
[posture.joints]
shoulder = 0.0
elbow = 0.0
[actuators.default]
spring_stiffness = 3000.0
rotor_inertia = 0.1
inertia_shaping = 1.0
motor_damping = 20.0
[controller]
kind = "joint_pd"
gravity = "planned"
damping_at = "drive"
[controller.kp]
shoulder = 400.0
elbow = 2.0
[controller.kd]
shoulder = 1.0
elbow = 1.0
[delays]
central_round_trip = { kind = "constant", value_ms = 4.0 }
embedded_round_trip = { kind = "constant", value_ms = 1.0 }
"""
LINK = """
<link name="{name}"><inertial><origin xyz="0 0 0.3"/><mass value="2"/>
<inertia ixx="0.03" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{name}"/>
<origin xyz="0 0 {up}"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
"""


def two_links():
    """An upright arm of two links."""
    upper = LINK.format(name="upper", joint="shoulder", parent="base", up=0.0)
    lower = LINK.format(name="lower", joint="elbow", parent="upper", up=0.6)
    return f'<robot name="arm"><link name="base"/>{upper}{lower}</robot>'


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
    assert "both ways vary, every delay below it" in text
    assert re.search(r"controller +7 states; nonlinear by 0\.\d+ of its answers", text)


def test_the_joint_that_falls_without_delay_is_named(tmp_path, cli):
    """Gravity grows out of the elbow; what would cross first at a delay is another motion."""
    project = tmp_path / "arm.toml"
    project.write_text(ARM)
    (tmp_path / "arm.urdf").write_text(two_links())
    code, text, err = cli("margin", project)
    assert (code, err) == (0, "")
    assert re.search(r"unstable roots +1 without delay\n  grows without delay +elbow (\d+)%", text)
    answer = json.loads(cli("margin", project, "--json")[1])
    assert sum(answer["falling"].values()) == pytest.approx(1.0)
    assert answer["falling"]["elbow"] > 0.9
    project.write_text(ARM.replace("elbow = 2.0", "elbow = 200.0"))
    answer = json.loads(cli("margin", project, "--json")[1])
    assert (answer["unstable_modes"], answer["falling"]) == (0, {})


def test_the_gait_s_margin_needs_a_walk_and_stands_alone(cli):
    code, text, err = cli("margin", BAXTER, "--gait")
    assert (code, text) == (2, "")
    assert "[walking]" in err
    code, _, err = cli("margin", "bundled:hume", "--gait", "--rate-sweep")
    assert code == 2
    assert "two questions" in err
    code, _, err = cli("margin", "bundled:hume", "--gait", "--horizon-ms", "20")
    assert code == 2
    assert "--gait is of the project's [walking] section" in err
