"""The second verifier: one short file that shares nothing with the first, and finds forgeries."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import sealag.second_verifier
from helpers.certificates import made, resealed
from sealag.cli import main
from sealag.second_verifier import claims

PROVEN = {"baxter", "crawl", "hume held", "late feedback"}
FILE = Path(sealag.second_verifier.__file__)


def verdicts(data):
    return {name: holds for name, holds, _ in claims(resealed(data))}


def test_it_is_short_and_stands_alone():
    text = FILE.read_text()
    assert len(text.splitlines()) <= 450
    for node in ast.walk(ast.parse(text)):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert all(name.split(".")[0] in sys.stdlib_module_names for name in names)


@pytest.mark.parametrize(
    "design", ["baxter", "moving", "crawl", "one foot", "flying", "hume held", "late feedback"]
)
def test_it_agrees_with_the_first(design):
    data = made(design)
    found = verdicts(data)
    assert found["jitter margin"] is True
    assert (data["local_loop"]["jitter"] is not None) is (design in PROVEN)
    assert False not in found.values(), [name for name, holds in found.items() if holds is False]
    undecided = {name for name, holds in found.items() if holds is None}
    assert "first crossing and local margin" in undecided
    assert found["unstable modes without delay"] is (None if design == "late feedback" else True)


def _scaled(*path, factor):
    def change(data):
        for key in path[:-1]:
            data = data[key]
        data[path[-1]] *= factor

    return change


def _longer(data):
    data["jitter_margin_s"] *= 1.0001
    data["local_loop"]["jitter"]["delay_s"] = data["jitter_margin_s"]


def _shift(d):
    for window in d["time_varying_windows"]:
        window["centre"][0][0] *= 0.999


FORGED = {
    "longer": ("moving", "instant 0: [[2D", _scaled("proofs", 0, "delay_s", factor=1.00001)),
    "multiplier": ("moving", "instant 0: W", _scaled("proofs", 0, "W", 0, 0, 1, factor=1.1)),
    "stiffness": ("moving", "instant 0: F follows", _scaled("proofs", 0, "F", 0, 0, factor=1.01)),
    "springs": ("baxter", "instant 0: F follows", _scaled("spring_stiffness", 0, factor=1.01)),
    "damping": ("moving", "no longer delay", _scaled("D_theta", 0, factor=1.01)),
    "levels": (
        "crawl",
        "instant 0: S couples",
        lambda d: d["proofs"][0]["stiffness"][0].__setitem__(7, 1.0),
    ),
    "printed": ("crawl", "instant 0: [[2D", _scaled("proofs", 0, "W", 1, 0, 0, factor=0.5)),
    "bound": ("moving", "smallest bound", _scaled("max_delay_s", factor=1.01)),
    "upper": ("moving", "no longer delay", _scaled("max_delay_upper_s", factor=0.999)),
    "common": ("moving", "common multiplier at", _scaled("common_multiplier_delay_s", factor=1.01)),
    "ball": (
        "moving",
        "time-varying multiplier at",
        lambda d: d["time_varying_windows"][0].update(radius=0.1),
    ),
    "place": (
        "moving",
        "windows hold the proven",
        _shift,
    ),
    "cover": ("moving", "windows cover", lambda d: d["time_varying_windows"].pop()),
    "modes": ("moving", "unstable modes", lambda d: d.update(unstable_modes=3)),
    "stable": ("moving", "stability", lambda d: d.update(stable=True)),
    "rates": (
        "moving",
        "positions change",
        lambda d: d["local_loop"]["A_0"][0].__setitem__(0, 1.0),
    ),
    "jitter": ("hume held", "jitter margin", _longer),
    "storage": (
        "hume held",
        "jitter margin",
        lambda d: d["local_loop"]["jitter"]["P"][0].__setitem__(0, 1e-9),
    ),
    "multiplier of late signals": (
        "hume held",
        "jitter margin",
        _scaled("local_loop", "jitter", "X", 0, 0, factor=0.9),
    ),
    "no proof": ("hume held", "jitter margin", lambda d: d["local_loop"].update(jitter=None)),
    "status": ("moving", "status follows", lambda d: d.update(status="not_certified")),
    "asymmetry": (
        "moving",
        "instant 0: F is symmetric",
        lambda d: d["proofs"][0]["F"][0].__setitem__(1, 3.0),
    ),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forgery_does_not_hold(name):
    design, claim, change = FORGED[name]
    data = made(design)
    change(data)
    failed = [what for what, holds in verdicts(data).items() if holds is False]
    assert any(what.startswith(claim) for what in failed), failed


def test_a_window_with_many_axes_is_left_undecided():
    data = made("moving")
    data["time_varying_windows"][0]["axes"] *= 20
    assert verdicts(data)["time-varying multiplier"] is None


def test_it_runs_as_a_file_and_by_the_command(tmp_path, capsys):
    def command(*arguments):
        with pytest.raises(SystemExit) as stop:
            main(["verify", "--second", *map(str, arguments)])
        return stop.value.code, *capsys.readouterr()

    def alone(path):
        done = subprocess.run(
            [sys.executable, "-I", str(FILE), str(path)],
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout

    path = tmp_path / "c.json"
    path.write_text(json.dumps(made("one foot")))
    code, text = alone(path)
    assert code == 0
    assert "holds          unstable modes without delay: 4 roots" in text
    assert "cannot decide  first crossing" in text
    code, text, _ = command(path)
    assert (code, text.splitlines()[-1]) == (0, "no claim fails")
    code, text, _ = command(path, "--json")
    assert json.loads(text)["valid"] is True
    data = made("one foot")
    data["unstable_modes"] = 0
    path.write_text(json.dumps(resealed(data)))
    assert alone(path)[0] == 1
    assert command(path)[0] == 1
    whole = json.dumps(data)
    for text, words in (
        ("{", "Expecting property name"),
        ("[]", "it is not sealag-certificate/6"),
        ('{"schema": 1, "schema": 2}', "a key stands twice"),
        (json.dumps({**data, "joints": 3}), "an entry is of another type or size"),
        (json.dumps({**data, "delay_s": None}), "'None' is no finite number"),
        (json.dumps({**data, "hashes": {}}), "a key is missing: 'content'"),
        (json.dumps({**data, "critical": {}}), "a key is missing: 'instant'"),
        (whole.replace('"delay_s": ', '"delay_s": 1e999', 1), "is no finite number"),
        (whole.replace('"instants": 1', '"instants": ' + 5000 * "9", 1), "is no finite number"),
        (whole.replace('"delay_s": ', '"delay_s": NaN, "x": ', 1), "'NaN' is no finite number"),
    ):
        path.write_text(text)
        code, out = alone(path)
        assert (code, out.count("\n")) == (2, 1)
        assert words in out
        code, out, err = command(path)
        assert (code, out) == (2, "")
        assert err.startswith(f"sealag: {path} is not a certificate: ")
        assert words in err
        assert err.count("\n") == 1
    code, _, err = command(tmp_path / "none.json")
    assert (code, err.count("none.json")) == (2, 1)
    assert "cannot be read: No such file or directory." in err
    code, _, err = command(path, "--exact")
    assert code == 2
    assert "--second takes no --exact" in err
