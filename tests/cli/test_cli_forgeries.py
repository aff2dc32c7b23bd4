"""What a forger may write is noticed by `sealag verify --exact --project`, in time, with words."""

import functools
import json
import time

import pytest

import sealag
from helpers.certificates import plain, resealed
from helpers.designs import EXAMPLES
from sealag.cli import main

HELD = EXAMPLES / "hume_held.toml"
NOT_HELD, NO_CERTIFICATE = 1, 2
LONGEST = 60.0  # s


@functools.cache
def honest():
    return json.dumps(plain(sealag.certify(sealag.load(HELD))))


def verified(path, capsys, *more):
    start = time.perf_counter()
    with pytest.raises(SystemExit) as stop:
        main(["verify", str(path), "--exact", "--project", str(HELD), *more])
    assert time.perf_counter() - start < LONGEST
    return (int(stop.value.code or 0), *capsys.readouterr())


def _window(axes):
    zero = [[0.0] * 6] * 6
    return [{"first": 0, "last": 0, "radius": 0.0, "centre": zero, "axes": [zero] * axes}]


TEXTS = {
    "duplicate key": (lambda t: t.replace("{", '{"max_delay_s": 5.0, ', 1), "'max_delay_s'"),
    "stable: 1": (lambda t: t.replace('"stable": true', '"stable": 1'), "`stable`"),
    "instants: true": (lambda t: t.replace('"instants": 1', '"instants": true'), "`instants`"),
    "instants: 1e13": (lambda t: t.replace('"instants": 1', f'"instants": {10**13}'), "`time_s`"),
    "5000 digits": (lambda t: t.replace('"instants": 1', '"instants": ' + 5000 * "9"), "5000"),
    "deep nesting": (
        lambda t: t.replace('"stable": true', '"stable": ' + 10**6 * "["),
        "nested too deep",
    ),
    "deep and closed": (
        lambda t: t.replace('"stable": true', f'"stable": {10**5 * "["}{10**5 * "]"}'),
        "nested too deep",
    ),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_no_certificate(name, tmp_path, capsys):
    change, words = TEXTS[name]
    path = tmp_path / "c.json"
    path.write_text(change(honest()))
    assert path.read_text() != honest()
    code, out, err = verified(path, capsys)
    assert (code, out) == (NO_CERTIFICATE, "")
    assert err.startswith("sealag: ")
    assert err.count("\n") == 1
    assert words in err


def _direction(d):
    joints = list(d["joints"])
    d["worst"]["direction"] = dict.fromkeys(joints, 0.0) | {joints[-1]: 1.0}


def _other_loop(d):
    """A loop frozen elsewhere, whose A_1 need not hold the F of the bound."""
    d["local_loop"]["at"] = "rest"


def _renamed(d, name):
    old = d["joints"][0]
    text = json.dumps(d).replace(json.dumps(old)[1:-1], json.dumps(name)[1:-1])
    d.clear()
    d.update(json.loads(text))


FORGED = {
    "limiting joints": (_direction, NOT_HELD, "limiting direction"),
    "upper end": (lambda d: d.update(max_delay_upper_s=1e6), NOT_HELD, "upper end"),
    "no assumptions": (lambda d: d.update(assumptions=[]), NOT_HELD, "assumptions"),
    "assumptions replaced": (
        lambda d: d.update(assumptions=[{"key": "none", "text": "Nothing is assumed."}]),
        NOT_HELD,
        "design: assumptions",
    ),
    "one assumption less": (lambda d: d["assumptions"].pop(), NOT_HELD, "design: assumptions"),
    "unknown key": (lambda d: d.update(approved_delay_s=5.0), NO_CERTIFICATE, "approved_delay_s"),
    "left open": (
        lambda d: d.update(left_open={"max_delay_s": "a longer one was too slow"}),
        NOT_HELD,
        "design: left_open",
    ),
    "versions": (lambda d: d.update(versions={"sealag": "at will"}), NOT_HELD, "versions"),
    "another version": (
        lambda d: d["versions"].update(sealag="99.0"),
        NOT_HELD,
        "design: versions",
    ),
    "another library": (
        lambda d: d["versions"].update(approved="1.0"),
        NOT_HELD,
        "design: versions",
    ),
    "margin hidden": (
        lambda d: d.update(local_margin_s=None, conservatism=None),
        NOT_HELD,
        "margins of instants",
    ),
    "margin hidden and opened": (
        lambda d: d.update(
            local_margin_s=None, conservatism=None, instant_margins_s=[None], stable=None,
            instant_basis=["open"],
        ),
        NOT_HELD,
        "local margin",
    ),
    "task inertia": (lambda d: d.update(task_inertia="lambda_star"), NOT_HELD, "task_inertia"),
    "joint name": (lambda d: _renamed(d, "hip\u001b[2J"), NO_CERTIFICATE, "short and printable"),
    "joint name of another": (lambda d: _renamed(d, "elbow"), NOT_HELD, "design: joints"),
    "40 axes": (
        lambda d: d.update(time_varying_windows=_window(40)),
        NO_CERTIFICATE,
        "`time_varying_windows[0].axes`",
    ),
    "loop elsewhere": (_other_loop, NOT_HELD, "design: local_loop"),
    "rest": (
        lambda d: d.update(equilibrium={"found": True, "moved_rad": 0.5}),
        NOT_HELD,
        "design: equilibrium",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGED)
def test_a_resealed_forgery(name, tmp_path, capsys):
    change, status, words = FORGED[name]
    data, path = json.loads(honest()), tmp_path / "c.json"
    change(data)
    path.write_text(json.dumps(resealed(data)))
    code, out, err = verified(path, capsys)
    assert code == status
    found = err if status == NO_CERTIFICATE else out
    bad = [line for line in found.splitlines() if line.startswith(("BAD", "sealag: "))]
    assert any(words in line for line in bad), bad
    assert "\u001b" not in out + err


def test_the_honest_one_holds(tmp_path, capsys):
    """The control: what none of these changes touched."""
    path = tmp_path / "c.json"
    path.write_text(honest())
    code, out, err = verified(path, capsys)
    assert (code, err) == (0, "")
    assert "BAD" not in out
    code, out, _ = verified(path, capsys, "--json")
    assert json.loads(out)["valid"] is True
