"""`sealag simulate`: scenarios, recordings, named ends."""

import json
import tomllib
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.delay import RoundTrip, Sinusoid
from sealag.design import load, simulate
from sealag.report import read_recording
from sealag.walking import WalkingGait, WalkingOptions


@pytest.mark.parametrize(
    ("robot", "scenario"),
    [
        ("baxter", "balance"),
        ("anymal", "drop"),
        ("anymal", "track"),
        ("talos", "regulate"),
        ("anymal_crawl", "balance"),
        ("hume_held", "drop"),
    ],
)
def test_scenario_completes_and_closes_the_first_law(robot, scenario, tmp_path, cli):
    out = tmp_path / "run.mcap"
    code, text, err = cli(
        "simulate", EXAMPLES / f"{robot}.toml", "--scenario", scenario, "--duration", "0.5",
        "--out", out, "--json",
    )  # fmt: skip
    answer = json.loads(text)
    assert (code, err) == (0, "")
    assert answer["outcome"] == "completed"
    assert answer["energy_residual_j"] <= 1e-4 * max(answer["energy_throughput_j"], 1e-3)
    assert answer["joint_side_passive"] is True
    stated = scenario != "track"  # a moving reference gives energy of its own
    assert answer["delay_side_passive"] is (True if stated else None)
    recording = read_recording(out)
    joints = recording.signals["/joint_states"]
    assert joints.time[-1] == pytest.approx(0.5, abs=2e-3)
    assert np.isfinite(joints.values).all()
    assert "[robot]" in recording.attachments["project.toml"].decode()
    assert recording.metadata["outcome"] == "completed"
    frames = {name.rsplit(":", 1)[0] for name in recording.signals["/tf"].names}
    assert frames == set(load(EXAMPLES / f"{robot}.toml").robot.link_names())
    topics = {"/tf", "/energy", "/work", "/power/port", "/torque/spring", "/delay"}
    assert topics <= set(recording.signals)
    fixed = robot in ("baxter", "hume_held")
    assert ("/contact" in recording.signals) != fixed
    works, energy = recording.signals["/work"], recording.signals["/energy"]
    rounding = 1e-12 * max(1.0, answer["energy_throughput_j"])
    assert (np.diff(works.column("damping_j")) >= -rounding).all()
    if stated:
        assert energy.column("delay_line_j").max() == pytest.approx(answer["delay_storage_j"])
        assert works.column("delay_side_slack_j")[-1] > -rounding
    power = recording.signals["/power/port"].values.sum(axis=1)
    steps = np.diff(works.time)
    port = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * steps)])
    given = works.column("port_j")
    assert np.abs(port - given).max() <= 0.02 * np.abs(given).max() + 1e-9


def test_walk_takes_its_steps(tmp_path, cli):
    """`--scenario walk` walks what the project describes, and says how the gait is."""
    text = load("bundled:hume").text
    path = tmp_path / "short.toml"
    path.write_text(text.replace("steps = 7", "steps = 3").replace('"paper" }', '"flat" }', 1))
    out = tmp_path / "w.mcap"
    code, text, err = cli("simulate", path, "--scenario", "walk", "--out", out, "--json")
    answer = json.loads(text)
    assert (code, err, answer["outcome"]) == (0, "", "completed")
    assert answer["steps"] >= 3
    assert answer["gait"] is True
    assert np.abs(np.array(answer["apex_speed_m_s"]) / 0.5 - 1.0).max() < 0.2
    assert read_recording(out).complete
    code, _, err = cli("simulate", EXAMPLES / "anymal.toml", "--scenario", "walk", "--out", out)
    assert code == 2
    assert "[walking]" in err


def test_the_bundled_walk_is_the_default_one():
    """The project file states every number of the gait and the means, and they are the defaults."""
    walking = load("bundled:hume").walking
    assert walking.gait == WalkingGait()
    assert walking.options == WalkingOptions()
    section = tomllib.loads(load("bundled:hume").text)["walking"]
    assert set(section["gait"]) == {field.name for field in fields(WalkingGait)}
    assert set(section["options"]) == {field.name for field in fields(WalkingOptions)}


def test_a_side_that_is_not_judged_says_why(tmp_path, cli):
    arguments = (EXAMPLES / "baxter.toml", "--duration", "0.01", "--out", tmp_path / "r.mcap")
    said = f"{'controller side':26} not judged: the reference moves\n"
    assert said in cli("simulate", *arguments, "--scenario", "track")[1]
    assert "not judged" not in cli("simulate", *arguments, "--scenario", "regulate")[1]


def test_same_seed_same_run(tmp_path, cli):
    text = (EXAMPLES / "baxter.toml").read_text()
    path = tmp_path / "noisy.toml"
    path.write_text(text.replace("value_ms", "jitter_ms = 3.0, packet_loss = 0.1, value_ms", 1))
    ages = []
    for seed in ("1", "1", "2"):
        out = tmp_path / "run.mcap"
        cli(
            "simulate",
            path,
            "--scenario",
            "track",
            "--duration",
            "0.1",
            "--seed",
            seed,
            "--out",
            out,
        )
        ages.append(read_recording(out).signals["/delay"].values)
    np.testing.assert_array_equal(ages[0], ages[1])
    assert not np.array_equal(ages[0], ages[2])


def test_a_biped_on_point_feet_balances_by_stepping(tmp_path, cli):
    code, text, _ = cli("simulate", "bundled:hume", "--scenario", "balance", "--duration", "3",
        "--out", tmp_path / "r.mcap", "--json",
    )  # fmt: skip
    answer = json.loads(text)
    assert code == 0
    assert answer["outcome"] == "completed"
    assert answer["touchdowns"] >= 7
    assert answer["joint_side_passive"] is True


def test_a_fall_is_a_named_result(tmp_path, cli):
    """Two point feet without a step: the pose is an inverted pendulum."""
    code, text, _ = cli(
        "simulate", "bundled:hume", "--scenario", "regulate", "--out", tmp_path / "r.mcap", "--json"
    )
    answer = json.loads(text)
    assert code == 1
    assert answer["outcome"] == "fell"
    assert "tilted" in answer["message"]
    arguments = ("--scenario", "regulate", "--out", tmp_path / "r.mcap")
    code, text, _ = cli("simulate", "bundled:hume", *arguments)
    assert code == 1
    assert text.splitlines()[0] == f"{'outcome':26} fell: {answer['message']}"
    assert read_recording(tmp_path / "r.mcap").complete


def test_ctrl_c_while_recording_keeps_the_one_before(tmp_path, cli, monkeypatch):
    out = tmp_path / "r.mcap"
    out.write_bytes(b"before")

    def interrupted(*_arguments, **_options):
        raise KeyboardInterrupt

    arguments = (EXAMPLES / "baxter.toml", "--duration", "0.01", "--out", out)
    with monkeypatch.context() as patch:
        patch.setattr("sealag.report.McapRecorder.note", interrupted)
        code, text, err = cli("simulate", *arguments)
    assert (code, text) == (130, "")
    assert "nothing was recorded" in err
    assert err.endswith("sealag: interrupted\n")
    assert out.read_bytes() == b"before"
    assert cli("simulate", *arguments)[0] == 0
    assert read_recording(out).metadata["outcome"] == "completed"


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--scenario", "dance"], "scenario"),
        (["--duration", "0"], "duration"),
        (["--duration", "nan"], "duration"),
        (["--delay-scale", "-1"], "--delay-scale"),
        (["--out", ""], "not a regular file"),
        (["--log-ms", "20.3"], "the log period of 20.3 ms"),
    ],
)
def test_bad_scenarios_are_named(arguments, word, tmp_path, cli):
    out = tmp_path / "r.mcap"
    code, text, err = cli("simulate", EXAMPLES / "anymal.toml", "--out", out, *arguments)
    assert (code, text) == (2, "")
    assert word in err
    assert err.count("\n") == 1
    assert not out.exists()


def test_torque_limits_that_cannot_hold(tmp_path, cli):
    text = (EXAMPLES / "anymal.toml").read_text()
    path = tmp_path / "weak.toml"
    path.write_text(text.replace("[[contacts]]", "torque_limit = 2.0\n\n[[contacts]]", 1))
    code, _, err = cli("simulate", path, "--out", tmp_path / "r.mcap")
    assert code == 2
    assert "cannot hold this posture" in err


@pytest.mark.parametrize("duration", ["0.2", "0.201"])
def test_the_largest_ages_are_the_certificate_s_wherever_it_ends(duration, cli, tmp_path):
    """ANYmal's links: 4 ms up, 5 ms down, and a hold of 2.5 ms that is no longer than that."""
    code, text, _ = cli("simulate", EXAMPLES / "anymal.toml", "--duration", duration, "--json",
        "--out", tmp_path / "run.mcap",
    )  # fmt: skip
    answer = json.loads(text)
    assert code == 0
    ages = [answer[f"{name}_age_s"] for name in ("measurement", "command", "total")]
    np.testing.assert_allclose(ages, [4e-3, 7.5e-3, 11.5e-3], rtol=0, atol=1e-12)


def test_the_largest_is_printed_and_not_the_mean_or_the_signed_maximum():
    """Delays that vary; and a law that takes more than it gives."""
    system = load(EXAMPLES / "baxter.toml")
    wave = Sinusoid(mean=6e-3, amplitude=5e-3, angular_frequency=40.0)
    result = simulate(
        replace(system, delays=replace(system.delays, central=RoundTrip.halved(wave))),
        scenario="balance",
        duration=0.3,
    )
    answer = result.summary(recording=Path("run.mcap"))
    assert answer["measurement_age_s"] == result.ages.measurement
    assert answer["measurement_age_s"] > 1.5 * result.measurement_age.mean()
    assert answer["command_age_s"] >= result.command_age.max()
    assert answer["total_age_s"] > answer["command_age_s"]
    law = -np.abs(result.audit.law_injection)
    turned = replace(result, audit=replace(result.audit, law_injection=law))
    assert turned.summary(recording=Path("run.mcap"))["law_injection_j"] == law.min() < 0.0
    assert answer["injection_error_j"] == result.audit.injection_error > 0.0
