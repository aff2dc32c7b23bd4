"""What `sealag certify` answers for the bundled and example designs, and what files it writes."""

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES

ROOT = Path(__file__).resolve().parents[2]
FIELDS = {
    "status", "criterion", "max_delay_s", "delay_s", "asymmetry", "worst", "instants", "feedback",
    "stable", "local_margin_s", "first_crossing_s", "unstable_modes", "assumptions",
}  # fmt: skip
DESIGNS = ["bundled:hume", *(f"{ROOT}/examples/{n}.toml" for n in
           ("anymal", "anymal_crawl", "talos", "baxter", "hume_held"))]  # fmt: skip


@pytest.mark.parametrize("design", DESIGNS, ids=lambda d: Path(d).stem)
@pytest.mark.parametrize("criterion", ["certified", "published"])
def test_answers_with_the_contract(design, criterion, tmp_path, cli):
    out = tmp_path / "c.json"
    code, text, err = cli("certify", design, "--criterion", criterion, "--json", "--out", out)
    answer = json.loads(text)
    assert err == ""
    assert set(answer) >= FIELDS
    assert answer["criterion"] == criterion
    assert code == (0 if answer["status"] == "certified" else 1)
    assert (answer["delay_s"] <= answer["max_delay_s"]) == (answer["status"] != "not_certified")
    assert answer["status"] != "certified" or answer["stable"] is True
    assert sum(answer["worst"]["direction"].values()) == pytest.approx(1.0)
    assert answer["max_delay_s"] <= answer["max_delay_upper_s"]
    margin = answer["local_margin_s"]
    if answer["stable"] and criterion == "certified":
        assert margin is None or margin >= answer["max_delay_s"]
    code, text, _ = cli("verify", out, "--json")
    assert json.loads(text)["valid"] is True


def test_the_published_bound_is_null_where_only_a_program_tells_it(tmp_path, cli):
    """Baxter's hands have one gain for positions, and another for orientations."""
    out, design = tmp_path / "c.json", EXAMPLES / "baxter.toml"
    answers = {}
    for criterion in ("certified", "published"):
        _, text, _ = cli("certify", design, "--criterion", criterion, "--json", "--out", out)
        answers[criterion] = json.loads(text)
    assert answers["certified"]["published_max_delay_s"] is None
    assert answers["published"]["published_max_delay_s"] == answers["published"]["max_delay_s"]
    _, text, _ = cli("certify", design, "--out", out)
    assert "--criterion published tells" in text
    assert cli("verify", out)[0] == 0


def test_motion_of_many_instants(tmp_path, cli):
    from sealag.design import load
    from sealag.walking import GroundProfile, WalkPlan

    system = load("bundled:hume")
    motion = WalkPlan.over(GroundProfile.paper(), steps=1).motion(system.robot, rate=200.0)
    answers = []
    for ending in (".csv", ".npz", ".parquet"):
        path = tmp_path / f"walk{ending}"
        system.save_motion(motion, path)
        code, text, _ = cli(
            "certify", "bundled:hume", "--motion", path, "--json", "--out",
            tmp_path / "c.json",
        )  # fmt: skip
        answers.append(json.loads(text))
        assert (code, answers[-1]["status"]) == (1, "passive_only")  # a step stands nowhere
    assert answers[0]["instants"] == len(motion)
    assert answers[0]["worst"]["time_s"] == pytest.approx(
        motion.time[answers[0]["worst"]["instant"]]
    )
    for other in answers[1:]:
        assert other["max_delay_s"] == pytest.approx(answers[0]["max_delay_s"], rel=1e-12)
    whole = json.loads((tmp_path / "c.json").read_text())
    assert len(whole["bounds_s"]) == len(motion)
    assert min(whole["bounds_s"]) == whole["max_delay_s"]


@pytest.mark.slow
def test_a_walk_is_verified_exactly_within_a_minute(tmp_path, cli):
    """Seven steps at 1 kHz, default proofs, common and time-varying multipliers."""
    from sealag.design import load
    from sealag.walking import GroundProfile, WalkPlan

    system = load("bundled:hume")
    motion = WalkPlan.over(GroundProfile.paper(), steps=7).motion(system.robot, rate=1000.0)
    walk, out = tmp_path / "walk.npz", tmp_path / "c.json"
    system.save_motion(motion, walk)
    code, text, _ = cli(
        "certify",
        "bundled:hume",
        "--motion",
        walk,
        "--time-varying",
        "--allow-unstable",
        "--json",
        "--out",
        out,
    )
    answer = json.loads(text)
    assert code == 0
    assert 0.0 < answer["time_varying_delay_s"] <= answer["common_multiplier_delay_s"] * (1 + 1e-6)
    assert out.stat().st_size < 2_000_000
    start = time.perf_counter()
    code, text, _ = cli("verify", out, "--exact", "--json")
    assert time.perf_counter() - start < 60.0
    result = json.loads(text)
    assert code == 0
    assert result["valid"]
    assert result["exact"]
    names = {check["name"] for check in result["checks"]}
    assert any(name.startswith("time-varying multiplier in all") for name in names)


def test_proofs_are_as_many_as_asked_for(tmp_path, cli):
    from sealag.design import load
    from sealag.walking import GroundProfile, WalkPlan

    system = load("bundled:hume")
    walk, out = tmp_path / "walk.npz", tmp_path / "c.json"
    motion = WalkPlan.over(GroundProfile.paper(), steps=1).motion(system.robot, rate=50.0)
    system.save_motion(motion, walk)
    counts = {}
    for proofs in ("3", "all"):
        code, _, _ = cli(
            "certify", "bundled:hume", "--motion", walk, "--proofs", proofs,
            "--criterion", "published", "--json", "--out", out,
        )  # fmt: skip
        counts[proofs] = len(json.loads(out.read_text())["proofs"])
        code, text, _ = cli("verify", out)
        assert code == 0
        assert text.splitlines()[-1].startswith(
            "the certificate holds: as it states, the design is"
        )
    assert counts == {"3": 3, "all": len(motion)}
    for wrong in ("0", "-1", "some", "²"):
        code, _, err = cli("certify", "bundled:hume", f"--proofs={wrong}", "--out", out)
        assert code == 2
        assert "--proofs is" in err


def test_a_changed_digit_is_shown(tmp_path, cli):
    out = tmp_path / "c.json"
    cli("certify", EXAMPLES / "baxter.toml", "--json", "--out", out)
    data = json.loads(out.read_text())
    number = repr(data["proofs"][0]["W"][0][0][0])
    out.write_text(out.read_text().replace(number, repr(float(number) * 2.0)))
    code, text, _ = cli("verify", out)
    assert code == 1
    assert "BAD  content is as written" in text
    assert "BAD  instant 0: matrix inequality" in text
    assert text.endswith("the certificate does not hold\n")


def test_the_joint_that_limits_most_is_named_first(tmp_path, cli):
    out = tmp_path / "c.json"
    _, text, _ = cli("certify", EXAMPLES / "baxter.toml", "--out", out)
    (line,) = [line for line in text.splitlines() if line.startswith("limiting joints")]
    told = {name: float(share[:-1]) for name, share in map(str.split, line[16:].split(", "))}
    shares = json.loads(out.read_text())["worst"]["direction"]
    known = {name: 100.0 * share for name, share in shares.items() if share >= 0.01}
    assert 1 < len(told) == min(3, len(known))
    assert list(told.values()) == sorted(told.values(), reverse=True)
    assert next(iter(told)) == max(known, key=known.get)
    assert told == pytest.approx({name: known[name] for name in told}, abs=0.5)


def test_margin_command(cli):
    code, text, _ = cli("margin", EXAMPLES / "baxter.toml", "--json")
    answer = json.loads(text)
    assert code == 0
    assert answer["delay_s"] == pytest.approx(answer["first_crossing_s"])
    assert 0.05 < answer["delay_s"] < 0.2
    assert answer["unstable_modes"] == 0


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_starter_file_answers_once_filled(base, tmp_path, cli):
    """Held by its torso Hume is certified; on two point feet no posture of it is at rest."""
    from helpers.robots import urdf_path

    path = tmp_path / "mine.toml"
    code, _, _ = cli("init", urdf_path("bundled:hume.urdf"), "--out", path, "--base", base)
    assert code == 0
    code, _, err = cli("certify", path)
    assert code == 2
    _, _, named = err.partition("still to be filled in: ")
    lines = [line.split(" = ")[0] for line in path.read_text().splitlines() if '"FILL' in line]
    assert len(lines) >= 6
    for line in lines:
        assert line in named
    text = path.read_text().replace('"FILL: rad"', "0.1")
    for fill, value in (
        ("FILL: K,", "350.0"), ("FILL: beta", "0.5"), ("FILL: D_theta", "50.0"),
        ("FILL: 1/s", "100.0"), ("FILL: T_H", "10.0"), ("FILL: T_L", "2.0"), ("FILL: B ", "0.1"),
    ):  # fmt: skip
        if f'"{fill}' in text:
            start = text.index(f'"{fill}')
            text = text[:start] + value + text[text.index('"', start + 1) + 1 :]
    path.write_text(text)
    code, out, err = cli("certify", path, "--json", "--out", tmp_path / "c.json")
    answer = json.loads(out)
    assert err == ""
    assert code == (0 if base == "fixed" else 1)
    assert answer["stable"] is (base == "fixed")
    if base == "floating":
        assert "no equilibrium" in answer["reasons"][0]
    assert cli("verify", tmp_path / "c.json")[0] == 0
    code, _, err = cli("init", urdf_path("bundled:hume.urdf"), "--out", path)
    assert code == 2
    assert "exists already" in err


def test_the_starter_s_units_and_names_are_told(tmp_path, cli):
    """Of a stiffness that multiplies no inertia, a jitter on two ways, postures and folders."""
    help_text = " ".join(cli("init", "--help")[1].split())
    for name in ("standing, half_sitting, homing, home, default or neutral", "bundled:hume.urdf",
                 "--base", "folder is made if needed"):  # fmt: skip
        assert name in help_text
    path = tmp_path / "new" / "p.toml"
    assert cli("init", "bundled:hume.urdf", "--out", path)[0] == 0
    text = path.read_text()
    assert "Nm/rad if stiffness_form is force" in text
    assert "jitter counts on the way up and on the way down" in " ".join(text.split("\n# "))


def test_help_and_version(cli):
    code, out, _ = cli("--version")
    assert (code, out) == (0, f"sealag {sealag.__version__}\n")
    for ask in (["-h"], ["--help"]):
        code, out, _ = cli(*ask)
        assert code == 0
        assert "130 interrupted" in " ".join(out.split())
    assert "Motion to certify" not in cli("margin", "-h")[1]
    assert cli("--versions")[0] == 2


def test_installed_command_prints_json_only(tmp_path):
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", "from sealag.cli import main; main()", "certify", "bundled:hume",
         "--json"],
        capture_output=True, text=True, timeout=120, cwd=tmp_path, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert json.loads(done.stdout)["status"] == "not_certified"
    assert done.stderr == ""
    assert np.isfinite(json.loads(done.stdout)["max_delay_s"])


def test_what_is_passive_only_is_a_no_unless_it_is_allowed(tmp_path, cli):
    """Standing on two points Hume falls, whatever its delay; a long one is no question of it."""
    text = (resources.files("sealag") / "data" / "hume.toml").read_text(encoding="utf-8")
    for late in ("central_round_trip", "embedded_round_trip"):
        text = re.sub(
            rf"(?m)^{late} = .*$", f'{late} = {{ kind = "constant", value_ms = 1.0 }}', text
        )
    project, out = tmp_path / "hume.toml", tmp_path / "c.json"
    project.write_text(text, encoding="utf-8")
    certify = ("certify", project, "--out", out)
    assert cli(*certify, "--json")[0] == 1
    assert cli(*certify, "--allow-unstable")[0] == 0
    code, told, _ = cli(*certify)
    lines = told.splitlines()
    assert code == 1
    assert lines[0].startswith("passive up to 8.96 ms; your delay is ")
    assert lines[1].startswith("warning: the centre of mass is 0.023 m outside the feet")
    assert lines[2] == f"{'verdict':26} passive only (certified criterion)"
    assert any(line.startswith("passive only because the posture is no stable") for line in lines)
    assert cli("verify", out)[1].endswith("passive only, not shown to be stable\n")
    assert cli("certify", "bundled:hume", "--out", out, "--allow-unstable")[0] == 1


def test_nothing_is_written_that_the_check_refuses(tmp_path, cli, monkeypatch):
    """A bound that its proof does not carry; a margin that no root crosses at is withdrawn."""
    held, out = EXAMPLES / "hume_held.toml", tmp_path / "c.json"
    good = sealag.certify(sealag.load(held))
    answer, evidence = good.answer, good.evidence
    (proof,) = evidence.proofs
    wrong = replace(evidence, proofs=(replace(proof, F=2.0 * proof.F),))
    later = replace(evidence, instant_margins_s=(2.0 * answer.local_margin_s,))
    claim = replace(
        answer,
        local_margin_s=2.0 * answer.local_margin_s,
        first_crossing_s=2.0 * answer.local_margin_s,
        conservatism=2.0 * answer.local_margin_s / answer.max_delay_s,
    )

    def answers(certificate):
        monkeypatch.setattr("sealag.design.certify", lambda *_words, **_options: certificate)
        return cli("certify", held, "--out", out)

    code, text, err = answers(replace(good, evidence=wrong))
    assert (code, text, out.exists()) == (3, "", False)
    assert err.startswith("sealag: The certificate's own check does not confirm ")
    assert err.count("\n") == 1
    code, text, err = answers(replace(good, answer=claim, evidence=later))
    assert (code, err) == (1, "")
    assert "whether it is stable stays open" in text.splitlines()[0]
    assert "own check does not confirm them" in text
    assert cli("verify", out)[0] == cli("verify", out, "--second")[0] == 0
    assert (answers(good)[0], cli("verify", out)[0]) == (0, 0)


def test_a_bound_beyond_all_networks_is_told_as_people_say_it(tmp_path, cli):
    project, out = tmp_path / "slow.toml", tmp_path / "c.json"
    text = (EXAMPLES / "hume_held.toml").read_text(encoding="utf-8")
    slow = re.sub(r"motor_damping = [0-9.]+", "motor_damping = 1e5", text)
    assert slow != text
    project.write_text(slow, encoding="utf-8")
    code, told, _ = cli("certify", project, "--out", out)
    lines = told.splitlines()
    assert code == 0
    assert lines[0].startswith("tolerates more than 5 s: delay is not what limits this design; ")
    (largest,) = (line for line in lines if line.startswith("largest delay"))
    assert re.fullmatch(r"largest delay +\d+ (s|h|days|years)", largest)


@pytest.mark.parametrize("criterion", ["certified", "published"])
def test_the_certificate_of_a_law_that_cannot_run_holds(criterion, tmp_path, cli):
    """Where q̄(θ) does not exist, no loop rests, and a certificate says so of its equilibrium."""
    text = (EXAMPLES / "hume_held.toml").read_text(encoding="utf-8")
    soft = text.replace("spring_stiffness = 350.0", "spring_stiffness = 1e-3")
    assert soft != text
    project, path = tmp_path / "soft.toml", tmp_path / "c.json"
    project.write_text(soft, encoding="utf-8")
    code, out, _ = cli("certify", project, "--criterion", criterion, "--json", "--out", path)
    answer = json.loads(out)
    assert code == 1
    assert answer["equilibrium"]["found"] is False
    assert "no equilibrium: q̄(θ) does not exist" in answer["reasons"][-1]
    for options in ([], ["--second"], ["--project", project]):
        assert cli("verify", path, *options)[0] == 0
