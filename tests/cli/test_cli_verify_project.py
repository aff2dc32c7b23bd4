"""`verify --project`: what a resealed file may say of itself is held against URDF and project."""

import json
from dataclasses import replace

import pytest

import sealag
from helpers.certificates import half_a_step, made, plain, resealed
from helpers.designs import EXAMPLES
from sealag.cli import main
from sealag.design import verify_design
from sealag.passivity import Certificate

BAXTER = EXAMPLES / "baxter.toml"


def _later(d):
    d["time_s"] = [time + 1.0 for time in d["time_s"]]
    d["worst"]["time_s"] += 1.0
    d["critical"]["time_s"] += 1.0


def _unproven_bound(d):
    proven = {proof["instant"] for proof in d["proofs"]}
    at = min(set(range(d["instants"])) - proven)
    d["bounds_s"][at] *= 1.01


def _renamed(d):
    states = d["local_loop"]["states"]
    d["local_loop"]["states"] = [name.replace(d["joints"][0], "elbow") for name in states]
    d["joints"][0] = "elbow"
    share = d["worst"]["direction"]
    d["worst"]["direction"] = dict(zip(d["joints"], share.values()))


FORGED = {
    "delay": ("baxter", "design: delay_s", lambda d: d.update(delay_s=0.001)),
    "times": ("moving", "design: time_s", _later),
    "unproven bound": ("moving", "design: bounds_s", _unproven_bound),
    "published, not asked": (
        "baxter", "design: published_max_delay_s", lambda d: d.update(published_max_delay_s=0.1),
    ),
    "published": (
        "moving",
        "design: published_max_delay_s",
        lambda d: d.update(published_max_delay_s=1.001 * d["published_max_delay_s"]),
    ),
    "urdf": ("baxter", "urdf file", lambda d: d["hashes"].update(urdf="0" * 64)),
    "project": ("moving", "project file", lambda d: d["hashes"].update(project="0" * 64)),
    "feedback": ("moving", "design: feedback", lambda d: d.update(feedback="static_joint_tank")),
    "inertia": (
        "baxter", "design: task_inertia", lambda d: d.update(task_inertia="lambda_star"),
    ),
    "levels": ("baxter", "design: levels", lambda d: d["levels"].__setitem__(1, 6)),
    "joints": ("baxter", "design: joints", _renamed),
}  # fmt: skip


def design(name):
    if name == "baxter":
        return sealag.load(BAXTER), None
    system = sealag.load("bundled:hume")
    return system, half_a_step(system)


@pytest.mark.parametrize("name", ["baxter", "moving"])
def test_a_certificate_of_the_design_holds(name):
    result = verify_design(made(name), *design(name), exact=name == "baxter")
    assert result.valid, [check for check in result.checks if not check.ok]
    assert any(check.name == "design: bounds_s" for check in result.checks)


@pytest.mark.parametrize("name", FORGED)
def test_what_a_forger_may_reseal_is_found_with_the_project(name):
    design_name, check, change = FORGED[name]
    data = made(design_name)
    change(data)
    data = resealed(data)
    assert Certificate.verify(data).valid, "the file alone does not show it"
    result = verify_design(data, *design(design_name))
    assert check in [one.name for one in result.checks if not one.ok]


def test_a_true_certificate_of_another_design_is_found():
    """Softer tasks, honestly certified, under the hashes of this project."""
    system, _ = design("baxter")
    tasks = tuple(replace(task, stiffness=0.5 * task.stiffness) for task in system.law.tasks)
    softer = replace(system, law=replace(system.law, tasks=tasks))
    data = plain(sealag.certify(softer))
    assert data["max_delay_s"] > 1.5 * made("baxter")["max_delay_s"]
    assert Certificate.verify(data).valid
    failed = {check.name for check in verify_design(data, system).checks if not check.ok}
    assert {"design: bounds_s", "design: J*, S, F at instant 0", "design: local_margin_s"} <= failed


def test_a_common_multiplier_that_fails_at_an_instant_without_proof_is_found():
    """One multiplier for the proven instants only: the file alone cannot know."""
    data, (system, motion) = made("moving"), design("moving")
    held = {proof["instant"] for proof in data["proofs"]}
    open_ = [k for k in range(len(motion)) if k not in held]
    q = motion.q.copy()
    q[open_[0], -6:] *= 1.5
    data["hashes"] = resealed(data)["hashes"]
    failed = [c.name for c in verify_design(data, system, replace(motion, q=q)).checks if not c.ok]
    assert f"design: common multiplier at all {len(motion)} instants" in failed


def test_the_command(tmp_path, capsys):
    def run(*arguments):
        with pytest.raises(SystemExit) as stop:
            main(["verify", *(str(argument) for argument in arguments)])
        return stop.value.code, *capsys.readouterr()

    out, motion = tmp_path / "c.json", tmp_path / "walk.npz"
    sealag.certify(sealag.load(BAXTER)).write(out)
    code, text, _ = run(out, "--project", BAXTER, "--json")
    assert (code, json.loads(text)["valid"]) == (0, True)
    copy = tmp_path / "baxter.toml"
    copy.write_text(BAXTER.read_text() + "# one line more\n")
    code, text, _ = run(out, "--project", copy)
    assert code == 1
    assert [line.split(":")[0] for line in text.splitlines() if line.startswith("BAD")] == [
        "BAD  project file"
    ]
    copy.write_text(BAXTER.read_text().replace("value_ms = 10.0", "value_ms = 20.0"))
    code, text, _ = run(out, "--project", copy)
    assert code == 1
    assert "BAD  design: delay_s" in text
    system, walk = design("moving")
    system.save_motion(walk, motion)
    sealag.certify(system, walk).write(out)
    assert run(out, "--project", "bundled:hume", "--motion", motion)[0] == 0
    code, _, err = run(out, "--project", "bundled:hume")
    assert code == 2
    assert "of a motion of 40 instants; name it (--motion)" in err
    code, _, err = run(out, "--motion", motion)
    assert code == 2
    assert "--project" in err
