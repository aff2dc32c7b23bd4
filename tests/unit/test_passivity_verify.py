"""A certificate holds as made, no changed claim passes, and no changed digit."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest

import sealag
import sealag.passivity
from helpers.certificates import failures, made, plain, resealed, without_loop
from helpers.designs import EXAMPLES
from sealag.errors import CertificateError, InputError
from sealag.passivity import Certificate, Criterion

SEED = 20261124
CHECKERS = (
    "reading", "certificate", "stated", "statement", "layout", "kinds", "checks", "claims",
    "definite", "proofs", "shared", "supremum", "local", "axis", "sweep", "headline",
    "jitter_proof", "balls",
)  # fmt: skip


def test_what_is_no_file_is_told_so():
    with pytest.raises(CertificateError, match="checks itself with `checks`"):
        Certificate.verify(Certificate.read(made("baxter")))


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("design", ["baxter", "moving", "crawl"])
def test_holds_as_made(design, exact):
    result = Certificate.verify(made(design), exact=exact)
    assert result.valid, [check for check in result.checks if not check.ok]
    assert len(result.checks) >= 12


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("key", ["common_multiplier", "time_varying"])
def test_shared_multipliers_hold_and_longer_delays_do_not(key, exact):
    data = made("moving")
    delay = f"{key}_delay_s"
    assert 0.9 * data["max_delay_s"] < data[delay] <= data["max_delay_s"] * (1.0 + 1e-9)
    data[delay] = 1.2 * data["max_delay_s"]
    failed = failures(data, exact=exact)
    assert any(name.startswith(key.split("_")[0]) for name in failed)
    assert all("multiplier" in name or "windows" in name for name in failed)


def _share(d):
    names = list(d["worst"]["direction"])
    d["worst"]["direction"][names[0]] += 0.01
    d["worst"]["direction"][names[1]] -= 0.01


def _weaker(d):
    """All of the last joint: it turns active later than the worst motion."""
    n = len(d["joints"])
    d["worst_motion"] = [[0.0] * (n - 1) + [1.0], [0.0] * n]
    d["worst"]["direction"] = dict(zip(d["joints"], d["worst_motion"][0]))


def _longer(d, *, proof):
    d["max_delay_s"] *= 1.001
    d["bounds_s"][0] = d["max_delay_s"]
    if proof:
        d["proofs"][0]["delay_s"] = d["max_delay_s"]


CLAIMS = {
    "max_delay_s": ("smallest bound", lambda d: d.update(max_delay_s=d["max_delay_s"] * 1.0000001)),
    "bounds": ("smallest bound", lambda d: d["bounds_s"].__setitem__(0, d["bounds_s"][0] * 1.001)),
    "both": ("instant 0: claimed delay", lambda d: _longer(d, proof=False)),
    "all three": ("instant 0: matrix inequality", lambda d: _longer(d, proof=True)),
    "upper end": ("upper end", lambda d: d.update(max_delay_upper_s=d["max_delay_s"] * 0.99)),
    "refutation": ("upper end", _weaker),
    "status": ("verdict", lambda d: d.update(status="not_certified")),
    "reasons": ("verdict", lambda d: d.update(status="not_certified", reasons=["I say so"])),
    "delay": ("verdict", lambda d: d.update(delay_s=1.0)),
    "link feedback": ("verdict", lambda d: d.update(feedback="joint")),
    "feedback": ("instant 0: F follows", lambda d: d.update(feedback="motor")),
    "published": ("published bound", lambda d: d.update(published_max_delay_s=-1.0)),
    "damping": ("frozen loop: motors", lambda d: d["D_theta"].__setitem__(8, 99.0)),
    "spring": ("instant 0: F follows", lambda d: d["spring_stiffness"].__setitem__(8, 700.0)),
    "negative": ("damping, springs", lambda d: d["D_theta"].__setitem__(0, -1.0)),
    "instants": ("unreadable", lambda d: d.update(instants=2)),
    "worst": ("worst instant", lambda d: d["worst"].update(time_s=1.0)),
    "share": ("limiting direction", _share),
    "motion": ("limiting direction", lambda d: d["worst_motion"][0].__setitem__(9, 0.3)),
    "no proof": ("proof of the worst", lambda d: d.update(proofs=[])),
    "proof twice": ("instants", lambda d: d.update(proofs=2 * d["proofs"])),
    "conservatism": ("conservatism", lambda d: d.update(conservatism=d["conservatism"] * 1.01)),
    "asymmetry": ("asymmetry", lambda d: d.update(asymmetry=1e-6)),
    "contraction": ("contraction", lambda d: d.update(contraction=d["contraction"] * 0.999)),
    "contraction up": ("contraction", lambda d: d.update(contraction=d["contraction"] * 1.001)),
    "gravity": ("instant 0: gravity gradient", lambda d: d.update(gravity="planned")),
    "levels": ("unreadable", lambda d: d["levels"].__setitem__(-1, 3)),
    "form": ("words of the law", lambda d: d.update(stiffness_form="best")),
    "Q": ("instant 0: W = d Q", lambda d: d["proofs"][0]["Q"][0][0].__setitem__(0, 1.0)),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_changed_claim_is_found_by_its_check(name):
    check, change = CLAIMS[name]
    data = made("baxter")
    change(data)
    assert any(failed.startswith(check) for failed in failures(data, exact=True))


def _no_windows(d):
    d["time_varying_windows"] = []


def _shift(d):
    for window in d["time_varying_windows"]:
        window["centre"][0][0] *= 0.999


MOVING = {
    "asymmetry below": ("asymmetry", lambda d: d["proofs"][3]["F"][0].__setitem__(1, 3.0)),
    "contraction below": ("contraction", lambda d: d.update(contraction=0.9 * d["contraction"])),
    "no common W": ("common multiplier", lambda d: d.update(common_multiplier=None)),
    "no moving W": ("time-varying", lambda d: d.update(time_varying_multiplier=None)),
    "no windows": ("time-varying", _no_windows),
    "fewer windows": ("time-varying windows cover", lambda d: d["time_varying_windows"].pop()),
    "another place": ("time-varying windows hold", _shift),
    "wider ball": (
        "time-varying multiplier in",
        lambda d: [window.update(radius=0.1) for window in d["time_varying_windows"]],
    ),
    "beyond": ("shared multipliers", lambda d: d.update(common_multiplier_delay_s=1.0)),
}


@pytest.mark.parametrize("name", MOVING)
def test_a_changed_claim_about_the_motion_is_found_by_its_check(name):
    check, change = MOVING[name]
    data = made("moving")
    change(data)
    assert any(failed.startswith(check) for failed in failures(data))


def test_instants_that_bind_the_common_multiplier_have_proofs():
    data = made("moving")
    assert len(data["proofs"]) > 12
    system = sealag.load("bundled:hume")
    with pytest.raises(InputError, match="proofs is 0"):
        sealag.certify(system, proofs=0)


def test_any_changed_digit_of_the_file_is_found(tmp_path):
    path = tmp_path / "c.json"
    sealag.certify(sealag.load("bundled:hume")).write(path)
    text = path.read_text()
    assert Certificate.verify(path).valid
    rng = np.random.default_rng(SEED)
    digits = [at for at, letter in enumerate(text) if letter.isdigit()]
    missed = []
    for at in rng.choice(digits, 100, replace=False):
        other = str((int(text[at]) + int(rng.integers(1, 10))) % 10)
        path.write_text(text[:at] + other + text[at + 1 :])
        try:
            result = Certificate.verify(path)
        except CertificateError:
            continue
        if result.valid or result.checks[0].ok:
            missed.append(text[at - 20 : at + 20])
    assert missed == []


def test_a_digit_that_its_double_does_not_show_is_found(tmp_path):
    """0.30000000000000003 is another way to write 0.30000000000000004."""
    path = tmp_path / "c.json"
    certificate = sealag.certify(sealag.load("bundled:hume"))
    certificate.write(path)
    text = path.read_text()
    number = repr(float(certificate.evidence.proofs[0].Q[0][0, 0]))
    same = [number[:-1] + digit for digit in "0123456789" if digit != number[-1]]
    same = [other for other in same if float(other) == float(number)] or [number + "0"]
    path.write_text(text.replace(number, same[0], 1))
    result = Certificate.verify(path)
    assert [check.name for check in result.checks if not check.ok] == ["content is as written"]
    assert same[0] in result.checks[0].detail


def test_a_digest_of_other_content_is_found_and_a_reseal_is_not():
    data = made("baxter")
    data["versions"]["numpy"] = "0.0"
    failed = [check.name for check in Certificate.verify(data).checks if not check.ok]
    assert failed == ["content is as written"]
    assert Certificate.verify(resealed(data)).valid, "versions are not proven"


def test_verification_does_not_use_the_code_that_makes_bounds():
    folder = Path(sealag.passivity.__file__).parent
    allowed = {f"sealag.passivity._{name}" for name in CHECKERS}
    for name in CHECKERS:
        tree = ast.parse((folder / f"_{name}.py").read_text())
        used = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        ours = {module for module in used if module and module.startswith("sealag")}
        assert ours <= allowed | {
            "sealag.errors",
            "sealag.files",
            "sealag.typing",
            "sealag.units",
        }, name
        others = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import)
                  for alias in node.names}  # fmt: skip
        assert others <= {"hashlib", "json", "math", "numpy", "re", "types"}, name


def test_unreadable_certificates_are_named(tmp_path):
    data = made("baxter")
    path = tmp_path / "c.json"
    path.write_text("{")
    with pytest.raises(CertificateError, match="not JSON"):
        Certificate.verify(path)
    path.write_text(json.dumps({"schema": "other"}))
    with pytest.raises(CertificateError, match="layout"):
        Certificate.verify(path)
    short = {key: value for key, value in data.items() if key != "proofs"}
    path.write_text(json.dumps(short))
    with pytest.raises(CertificateError, match="lacks the key `proofs`"):
        Certificate.verify(path)
    for broken in (
        {"proofs": [{**data["proofs"][0], "F": [[None]]}]},
        {"proofs": [{**data["proofs"][0], "instant": -1}]},
        {"hashes": None},
        {"time_s": 3.0},
        {"local_loop": {**data["local_loop"], "A_0": [[1.0]]}},
    ):
        with pytest.raises(CertificateError, match="is not a certificate: `"):
            Certificate.verify({**data, **broken})


@pytest.mark.parametrize("design", ["baxter", "moving", "crawl", "one foot", "flying"])
def test_what_is_read_is_what_was_written(design):
    data = made(design)
    certificate = Certificate.read(data)
    assert certificate.to_json_dict() == data
    assert certificate.summary().keys() < data.keys()
    assert [check.name for check in certificate.checks() if not check.ok] == []


def test_a_certificate_has_no_truth_value():
    certificate = sealag.certify(sealag.load(EXAMPLES / "baxter.toml"))
    with pytest.raises(TypeError, match="status"):
        bool(certificate)
    assert plain(certificate)["hashes"]["content"] != certificate.question.hashes["project"]


def with_delay(data, delay):
    """The same proof for another delay; only its inequality is looked at."""
    data["proofs"][0]["delay_s"] = delay
    return data


def dissipates(data, delay, *, exact):
    return "instant 0: matrix inequality" not in failures(with_delay(data, delay), exact=exact)


def test_doubles_never_call_definite_what_rationals_do_not():
    """At the longest delay of a multiplier, bisected in rationals, and as near to it as 1e-15."""
    data = without_loop(plain(sealag.certify(sealag.load(EXAMPLES / "hume_held.toml"))))
    low = data["max_delay_s"]
    high = 1.01 * low
    while high > low * (1.0 + 1e-14):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if dissipates(data, middle, exact=True) else (low, middle)
    assert low > data["max_delay_s"], "the multiplier must leave room"
    rng = np.random.default_rng(SEED)
    found = {True: 0, False: 0}
    for _ in range(60):
        delay = low * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-15, -8))
        truth = dissipates(data, delay, exact=True)
        assert dissipates(data, delay, exact=False) <= truth
        found[truth] += 1
    assert min(found.values()) > 10


@pytest.mark.parametrize("criterion", list(Criterion))
def test_infinite_bounds_are_certified_without_numbers(criterion):
    """A design whose tasks have no stiffness tolerates any delay."""
    from dataclasses import replace

    system = sealag.load(EXAMPLES / "baxter.toml")
    tasks = tuple(replace(task, stiffness=0.0 * task.stiffness) for task in system.law.tasks)
    system = replace(system, law=replace(system.law, tasks=tasks, gravity="planned"))
    data = plain(sealag.certify(system, criterion=criterion))
    assert data["max_delay_s"] == data["max_delay_upper_s"] == "unbounded"
    assert data["status"] == "passive_only"  # nothing holds it
    assert failures(data) == []


def test_an_unbounded_delay_needs_a_law_without_stiffness():
    data = made("baxter")
    data.update(
        bounds_s=["unbounded"] * len(data["bounds_s"]), max_delay_s="unbounded",
        max_delay_upper_s="unbounded",
        proofs=[], common_multiplier_delay_s=None, time_varying_delay_s=None, conservatism=None,
    )  # fmt: skip
    assert "unbounded delay" in failures(data)


@pytest.mark.parametrize(
    ("design", "words"),
    [("baxter", "0 rad away"), ("flying", "none near the posture"), ("moving", "none for a")],
)
def test_an_equilibrium_that_was_not_found_is_nowhere(design, words):
    (check,) = (
        check for check in Certificate.verify(made(design)).checks if check.name == "equilibrium"
    )
    assert check.ok
    assert check.detail.startswith(words)
