"""A certificate holds as made, and no changed number passes."""

import copy
import json

import numpy as np
import pytest

import sealag
from sealag.errors import CertificateError
from sealag.locomotion import paper_terrain, plan_walk, walk_motion
from sealag.passivity import read_certificate, verify, write_certificate
from sealag.robot import Motion

SEED = 20261124


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    system = sealag.load("examples/baxter.toml")
    certificate = sealag.certify(system)
    path = tmp_path_factory.mktemp("certificate") / "baxter.json"
    write_certificate(certificate, path)
    return path


@pytest.fixture(scope="module")
def data(made):
    return read_certificate(made)


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """A certificate over half a step of the planned walk, with shared multipliers."""
    system = sealag.load("bundled:hume")
    whole = walk_motion(system.robot, plan_walk(paper_terrain(), steps=2), rate=100.0)
    part = slice(0, 40)
    motion = Motion(
        time=whole.time[part],
        q=whole.q[part],
        v=whole.v[part],
        contact_sets=whole.contact_sets,
        contact_index=whole.contact_index[part],
    )
    certificate = sealag.certify(system, motion, time_varying=True)
    path = tmp_path_factory.mktemp("moving") / "hume.json"
    write_certificate(certificate, path)
    return read_certificate(path)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("key", ["common_multiplier", "time_varying"])
def test_shared_multipliers_hold_and_longer_delays_do_not(moving, key, exact):
    """Both are below the pointwise bound, and hold at every instant with a proof."""
    assert verify(moving, exact=exact).valid
    delay = f"{key}_delay_s"
    assert 0.9 * moving["max_delay_s"] < moving[delay] <= moving["max_delay_s"] * (1.0 + 1e-9)
    broken = copy.deepcopy(moving)
    broken[delay] = 1.2 * moving["max_delay_s"]
    failed = [check.name for check in verify(broken, exact=exact).checks if not check.ok]
    assert failed
    assert all("multiplier" in name for name in failed)


@pytest.mark.parametrize("exact", [False, True])
def test_holds_as_made(made, exact):
    result = verify(made, exact=exact)
    assert result.valid, [check for check in result.checks if not check.ok]
    assert len(result.checks) >= 12


def _places(proof):
    """Entries whose sign or size decides something, found by looking for large ones."""
    for key in ("J_star", "stiffness", "F", "Y"):
        matrix = np.array(proof[key])
        for index in np.argwhere(np.abs(matrix) > 0.05 * np.abs(matrix).max()):
            yield key, tuple(index)


def inequality_holds(data):
    """Whether a changed Y is still a multiplier, by NumPy alone."""
    proof, D = data["proofs"][0], np.diag(data["D_theta"])
    F, Y, d = np.array(proof["F"]), np.array(proof["Y"]), proof["delay_s"]
    block = np.block([[2 * D - Y, d * F], [d * F.T, Y]])
    return (Y == Y.T).all() and np.linalg.eigvalsh(block)[0] > 0.0


@pytest.mark.parametrize("exact", [False, True])
def test_a_hundred_corrupted_numbers_are_found(data, exact):
    rng = np.random.default_rng(SEED)
    places = list(_places(data["proofs"][0]))
    tried, missed = 0, []
    while tried < (100 if exact else 50):
        key, index = places[rng.integers(len(places))]
        broken = copy.deepcopy(data)
        row = broken["proofs"][0][key][index[0]]
        row[index[1]] *= 1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-3, 1)
        if key == "Y" and inequality_holds(broken):
            continue
        tried += 1
        if verify(broken, exact=exact).valid:
            missed.append((key, index))
    assert missed == []


CLAIMS = {
    "max_delay_s": lambda d: d.update(max_delay_s=d["max_delay_s"] * 1.0000001),
    "bounds": lambda d: d["bounds_s"].__setitem__(0, d["bounds_s"][0] * 1.001),
    "both": lambda d: (
        d.update(max_delay_s=d["max_delay_s"] * 1.001),
        d["bounds_s"].__setitem__(0, d["max_delay_s"]),
    ),
    "all three": lambda d: (
        d.update(max_delay_s=d["max_delay_s"] * 1.001),
        d["bounds_s"].__setitem__(0, d["max_delay_s"]),
        d["proofs"][0].update(delay_s=d["max_delay_s"]),
    ),
    "status": lambda d: d.update(status="not_certified"),
    "delay": lambda d: d.update(delay_s=1.0),
    "feedback": lambda d: d.update(feedback="motor"),
    "link feedback": lambda d: d.update(feedback="joint"),
    "damping": lambda d: d["D_theta"].__setitem__(8, d["D_theta"][8] * 0.99),
    "spring": lambda d: d["spring_stiffness"].__setitem__(8, 700.0),
    "negative damping": lambda d: d["D_theta"].__setitem__(0, -1.0),
    "instants": lambda d: d.update(instants=2),
    "worst": lambda d: d["worst"].update(time_s=1.0),
    "share": lambda d: d["worst"]["direction"].update(left_s0=0.5),
    "no proof": lambda d: d.update(proofs=[]),
    "conservatism": lambda d: d.update(conservatism=d["conservatism"] * 1.01),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_changed_claim_is_found(data, name):
    broken = copy.deepcopy(data)
    CLAIMS[name](broken)
    assert not verify(broken, exact=True).valid


def test_a_delay_beyond_the_supremum_cannot_be_proven(data):
    """Scaling Y with the delay, as a clever forger would, does not help."""
    for factor in (1.00001, 1.01, 2.0):
        broken = copy.deepcopy(data)
        longer = broken["max_delay_s"] * factor
        broken["max_delay_s"] = broken["bounds_s"][0] = broken["proofs"][0]["delay_s"] = longer
        broken["proofs"][0]["Y"] = (factor * np.array(broken["proofs"][0]["Y"])).tolist()
        assert not verify(broken, exact=True).valid


def test_verification_does_not_use_the_code_that_makes_bounds():
    import ast
    from pathlib import Path

    import sealag.passivity._verify as module

    tree = ast.parse(Path(module.__file__).read_text())
    used = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name for name in used if name and "sealag" in name} == {
        "sealag.errors",
        "sealag.passivity._certificate",
        "sealag.typing",
    }


def test_unreadable_certificates_are_named(tmp_path, data):
    path = tmp_path / "c.json"
    path.write_text("{")
    with pytest.raises(CertificateError, match="not JSON"):
        verify(path)
    path.write_text(json.dumps({"schema": "other"}))
    with pytest.raises(CertificateError, match="layout"):
        verify(path)
    short = {key: value for key, value in data.items() if key != "proofs"}
    path.write_text(json.dumps(short))
    with pytest.raises(CertificateError, match="lacks proofs"):
        verify(path)
    broken = copy.deepcopy(data)
    broken["proofs"][0]["F"] = [[None]]
    with pytest.raises(CertificateError, match="cannot be read"):
        verify(broken)


def test_a_certificate_has_no_truth_value():
    certificate = sealag.certify(sealag.load("examples/baxter.toml"))
    with pytest.raises(TypeError, match="status"):
        bool(certificate)
