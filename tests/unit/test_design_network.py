"""The links that a project file describes are those that run, and its d_1 bounds what arrives."""

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from sealag.errors import ProjectError

BAXTER = (EXAMPLES / "baxter.toml").read_text()

NETWORKS = {
    "constant": """
central_round_trip = { kind = "constant", value_ms = 8.0 }
embedded_round_trip = { kind = "constant", value_ms = 2.0 }
""",
    "each way its own": """
central_up = { kind = "constant", value_ms = 2.0 }
embedded_up = { kind = "constant", value_ms = 4.0 }
embedded_down = { kind = "constant", value_ms = 1.0 }
delayed_torque_feedback = true
[delays.central_down]
kind = "sinusoid"
mean_ms = 5.0
amplitude_ms = 3.0
angular_frequency_rad_s = 20.0
""",
    "table, overtaking": """
embedded_round_trip = { kind = "constant", value_ms = 0.0 }
[delays.central_round_trip]
kind = "table"
time_s = [0.0, 0.1, 0.2]
delay_ms = [2.0, 20.0, 6.0]
jitter_ms = 5.0
order = "arrival"
""",
    "losses": """
embedded_round_trip = { kind = "constant", value_ms = 1.0, jitter_ms = 2.0, packet_loss = 0.2 }
[delays.central_round_trip]
kind = "constant"
value_ms = 4.0
packet_loss = 0.5
max_burst = 4
order = "newest"
""",
    "recorded": """
central_round_trip = { kind = "samples", file = "rtt.txt", period_s = 0.01 }
embedded_round_trip = { kind = "constant", value_ms = 1.0 }
""",
}  # fmt: skip
PERIODS = {
    "500 Hz, at once": "sample_time_ms = 2.0\n",
    "1 kHz": "sample_time_ms = 1.0\nembedded_period_ms = 1.0\n",
    "400 Hz over 2 kHz": "sample_time_ms = 2.5\nembedded_period_ms = 0.5\n",
}


def system(folder, network, periods):
    path = folder / "p.toml"
    path.write_text(BAXTER[: BAXTER.index("[delays]")] + f"[delays]\n{periods}{network}")
    rng = np.random.default_rng(3)
    (folder / "rtt.txt").write_text("\n".join(f"{v:.3f}" for v in rng.uniform(3, 12, 50)))
    return sealag.load(path)


@pytest.mark.parametrize("periods", PERIODS)
@pytest.mark.parametrize("network", NETWORKS)
def test_nothing_is_older_than_the_certificate_says(network, periods, tmp_path):
    design = system(tmp_path, NETWORKS[network], PERIODS[periods])
    assert sealag.certify(design).question.delay_s == design.delays.d_1
    run = sealag.simulate(design, scenario="track", duration=0.5)
    assert run.outcome == "completed"
    assert run.ages.total <= design.delays.d_1 + 1e-9
    assert run.ages.total > 0.5 * design.delays.d_1, "the bound must not be an empty one"
    if network == "constant" and "embedded" not in PERIODS[periods]:
        assert run.ages.total == pytest.approx(design.delays.d_1, abs=1e-9)
    started = run.time > design.delays.d_1 + 0.05
    assert run.measurement_age.max() <= run.ages.measurement + 1e-9
    assert run.command_age.max() <= run.ages.command + 1e-9
    ways = design.delays.central.up.delay
    assert run.measurement_age[started].min() >= min(ways.at(run.time)) - 1e-9


def test_rates_are_the_design_s_own(tmp_path):
    design = system(tmp_path, NETWORKS["constant"], PERIODS["400 Hz over 2 kHz"])
    run = sealag.simulate(design, scenario="track", duration=0.1)
    np.testing.assert_allclose(np.diff(run.time), 2.5e-3)
    design = system(tmp_path, NETWORKS["constant"], "")
    run = sealag.simulate(design, scenario="track", duration=0.1)
    np.testing.assert_allclose(np.diff(run.time), 1e-3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("central_round_trip", "central_up", ["delays.central_round_trip", "central_down"]),
        ("embedded_round", 'central_up = { kind = "constant", value_ms = 1.0 }\nembedded_round',
         ["besides"]),
        ("kind = \"constant\", value_ms = 8.0", "kind = \"constant\", value_ms = 8.0, loss = 0.1",
         ["loss", "spelling"]),
        ("value_ms = 8.0", "value_ms = 8.0, packet_loss = 0.1", ["period"]),
        ("value_ms = 8.0", "value_ms = 8.0, order = \"lifo\"", ["order", "lifo"]),
    ],
)  # fmt: skip
def test_a_network_that_cannot_be_is_named(old, new, words, tmp_path):
    assert old in NETWORKS["constant"]
    with pytest.raises(ProjectError) as problem:
        system(tmp_path, NETWORKS["constant"].replace(old, new, 1), "")
    for word in ["p.toml", *words]:
        assert word in str(problem.value)
