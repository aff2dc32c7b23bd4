"""Nothing is believed: what a forger may write, with a digest that agrees, is found or refused."""

import copy
import json
import re
import time
import tracemalloc

import pytest

from helpers.certificates import failures, made, resealed
from sealag.errors import CertificateError
from sealag.passivity import Certificate


def stated_only():
    """Keys that the documentation of `verify` names as stated and not proven."""
    text = (Certificate.verify.__doc__ or "").split("Stated, not proven")[1].split("Args:")[0]
    return set(re.findall(r"`(\w+)`", text))


def text_of(data):
    return "{\n" + ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in data.items()) + "\n}"


def refused(tmp_path, text):
    """The one sentence with which a file is refused, in bounded time and memory."""
    path = tmp_path / "c.json"
    path.write_text(text)
    tracemalloc.start()
    start = time.perf_counter()
    with pytest.raises(CertificateError) as error:
        Certificate.verify(path)
    assert time.perf_counter() - start < 20.0
    assert tracemalloc.get_traced_memory()[1] < 1e8
    tracemalloc.stop()
    message = str(error.value)
    assert "\n" not in message
    assert len(message) < 500 + len(str(path))
    return message


def test_the_file_as_written_is_read(tmp_path):
    """The control of all that is refused below."""
    path = tmp_path / "c.json"
    path.write_text(text_of(made("baxter")))
    assert Certificate.verify(path).valid


TEXTS = {
    "key twice": (lambda t: t.replace("{", '{"max_delay_s": 5.0,', 1), "'max_delay_s' stands"),
    "inner key twice": (
        lambda t: t.replace('"delay_s": ', '"delay_s": 9.0, "delay_s": ', 1),
        "'delay_s' stands there twice",
    ),
    "NaN": (lambda t: t.replace('"unstable_modes": 0', '"unstable_modes": NaN'), "NaN"),
    "infinity": (lambda t: t.replace('"stable": true', '"stable": Infinity'), "Infinity"),
    "large exponent": (lambda t: t.replace('"stable": true', '"stable": 1e999'), "1e999"),
    "5000 digits": (lambda t: t.replace('"instants": 1', '"instants": ' + "9" * 5000), "5000"),
    "one value": (lambda t: "3", "no JSON object"),
    "half": (lambda t: t[: len(t) // 2], "not JSON"),
    "deep": (lambda t: t.replace('"stable": true', '"stable": ' + "[" * 10**5), "nested too deep"),
    "deep objects": (
        lambda t: t.replace('"stable": true', '"stable": ' + '{"a":' * 10**5),
        "nested too deep",
    ),
}


@pytest.mark.parametrize("name", TEXTS)
def test_text_that_is_no_strict_json_is_refused(name, tmp_path):
    change, words = TEXTS[name]
    text = text_of(made("baxter"))
    assert change(text) != text
    assert words in refused(tmp_path, change(text))


def _in(*path):
    """Set the entry at a path."""

    def change(data, value):
        for key in path[:-1]:
            data = data[key]
        data[path[-1]] = value

    return change


PLACES = {
    "stable is a number": (_in("stable"), 1, "`stable`"),
    "instants is a truth": (_in("instants"), True, "`instants`"),
    "number as text": (_in("delay_s"), "0.01", "`delay_s`"),
    "truth as number": (_in("max_delay_s"), True, "`max_delay_s`"),
    "other word for no bound": (_in("max_delay_s"), "inf", "`max_delay_s`"),
    "null bound": (_in("bounds_s", 0), None, "`bounds_s[0]`"),
    "unbounded damping": (_in("D_theta", 3), "unbounded", "`D_theta[3]`"),
    "status": (_in("status"), "approved", "`status`"),
    "unknown key": (_in("approved_delay_s"), 5.0, "'approved_delay_s'"),
    "unknown inner key": (_in("proofs", 0, "note"), "x", "'note'"),
    "unknown key of the loop": (_in("local_loop", "P"), [[1.0]], "'P'"),
    "many instants": (_in("instants"), 10**13, "`time_s`"),
    "large count": (_in("unstable_modes"), 2**70, "digits"),
    "negative instant": (_in("worst", "instant"), -1, "`worst.instant`"),
    "instant beyond": (_in("critical", "instant"), 1, "`critical.instant`"),
    "control characters": (_in("joints", 0), "elbow\u001b[2J", "`joints[0]`"),
    "turned text": (_in("reasons"), ["not \u202e so"], "`reasons[0]`"),
    "control characters in a name": (_in("left_open"), {"a\n": "b"}, "left_open"),
    "joint twice": (lambda d, _: d["joints"].__setitem__(0, d["joints"][1]), 0, "`joints`"),
    "short row": (lambda d, _: d["proofs"][0]["F"][2].pop(), 0, "`proofs[0].F[2]`"),
    "no rows": (_in("worst_motion"), [], "`worst_motion`"),
    "short damping": (lambda d, _: d["D_theta"].pop(), 0, "`D_theta`"),
    "levels": (_in("levels"), [0, 4, 4, 6], "`levels`"),
    "axes": (
        _in("time_varying_windows"),
        [{"first": 0, "last": 0, "radius": 0.0, "centre": 14 * [14 * [0.0]],
          "axes": 40 * [14 * [14 * [0.0]]]}],
        "`time_varying_windows[0].axes`",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PLACES)
def test_other_types_sizes_and_names_are_refused_by_their_key(name, tmp_path):
    change, value, words = PLACES[name]
    data = made("baxter")
    change(data, value)
    assert words in refused(tmp_path, text_of(resealed(data)))


def _cancel(d):
    d.update(local_margin_s=None, conservatism=None)


FORGED = {
    "margin hidden beside a crossing": ("baxter", _cancel),
    "any joint limits": (
        "baxter",
        lambda d: d["worst"].update(
            direction={name: float(k == 0) for k, name in enumerate(d["joints"])}
        ),
    ),
    "upper end at will": ("baxter", lambda d: d.update(max_delay_upper_s=1e6)),
    "upper end a little longer": (
        "baxter",
        lambda d: d.update(max_delay_upper_s=1.00001 * d["max_delay_upper_s"]),
    ),
    "upper end unbounded": ("baxter", lambda d: d.update(max_delay_upper_s="unbounded")),
    "no assumptions": ("baxter", lambda d: d.update(assumptions=[])),
    "nameless assumption": (
        "baxter",
        lambda d: d.update(assumptions=[{"key": "", "text": "all is well"}]),
    ),
    "left open what is no bound": (
        "baxter",
        lambda d: d.update(left_open={"approved_delay_s": "yes"}),
    ),
    "left open what was not asked": (
        "baxter",
        lambda d: d.update(left_open={"time_varying_delay_s": "a solver stopped"}),
    ),
    "versions that are none": ("baxter", lambda d: d.update(versions={"sealag": "the best one"})),
    "another hash": ("baxter", lambda d: d["hashes"].update(approval="0" * 64)),
    "hash of no file": ("baxter", lambda d: d["hashes"].update(urdf="yes")),
    "stable at an unstable instant": ("moving", lambda d: d.update(stable=True)),
    "fewer unstable modes": ("moving", lambda d: d.update(unstable_modes=2)),
    "margin of one instant": (
        "moving",
        lambda d: d.update(local_margin_s=0.2, conservatism=0.2 / d["max_delay_s"]),
    ),
    "another critical instant": ("moving", lambda d: d["critical"].update(time_s=0.123)),
    "a bound that is none": (
        "moving",
        lambda d: d["instant_basis"].__setitem__(7, "bound"),
    ),
    "open with a margin": ("moving", lambda d: d["instant_basis"].__setitem__(7, "open")),
    "rest of a motion": (
        "moving",
        lambda d: d.update(equilibrium={"found": True, "moved_rad": 0.0}),
    ),
    "no rest": ("baxter", lambda d: d.update(equilibrium={"found": False, "moved_rad": 0.0})),
    "motion scaled": (
        "baxter",
        lambda d: d.update(worst_motion=[[2.0 * v for v in row] for row in d["worst_motion"]]),
    ),
    "friction": ("baxter", lambda d: d["viscous_friction"].__setitem__(0, 1.0)),
    "inertia": ("baxter", lambda d: d["motor_inertia"].__setitem__(0, 1.0)),
    "negative drive": ("baxter", lambda d: d["torque_bandwidth"].__setitem__(0, -1.0)),
    "a late part that is none": (
        "baxter",
        lambda d: d["local_loop"].update(embedded_delay_s=0.001),
    ),
    "frequency": (
        "baxter",
        lambda d: d["local_loop"].update(frequency_rad_s=2.0 * d["local_loop"]["frequency_rad_s"]),
    ),
    "a longer jitter margin": ("baxter", lambda d: _jitter(d, 1.00001)),
    "jitter margin without multipliers": (
        "baxter",
        lambda d: d["local_loop"].update(jitter=None),
    ),
    "another jitter margin than proven": ("baxter", lambda d: d.update(jitter_margin_s=0.05)),
    "jitter margin unbounded": (
        "baxter",
        lambda d: (d.update(jitter_margin_s="unbounded"), d["local_loop"].update(jitter=None)),
    ),
    "none where the loop is stable": (
        "baxter",
        lambda d: (d.update(jitter_margin_s=0.0), d["local_loop"].update(jitter=None)),
    ),
    "storage that is not positive": (
        "baxter",
        lambda d: _all(d["local_loop"]["jitter"], "P", lambda x: -x),
    ),
    "storage of another loop": (
        "baxter",
        lambda d: _all(d["local_loop"]["jitter"], "P", lambda x: 1.01 * x),
    ),
    "lighter X": (
        "baxter",
        lambda d: _all(d["local_loop"]["jitter"], "X", lambda x: 0.99 * x),
    ),
    "asymmetric X": (
        "baxter",
        lambda d: d["local_loop"]["jitter"]["X"][0].__setitem__(1, 0.0),
    ),
    "X of fewer signals": (
        "baxter",
        lambda d: d["local_loop"]["jitter"].update(X=[[1.0]]),
    ),
    "jitter margin of a robot": (
        "baxter",
        lambda d: d["holds_for"].update(jitter_margin_s="any robot"),
    ),
    "jitter margin of what is unstable": ("moving", lambda d: d.update(jitter_margin_s=0.01)),
    "multiplier of no bound": (
        "baxter",
        lambda d: d.update(common_multiplier=d["proofs"][0]["W"][0]),
    ),
    "unbounded margin": (
        "baxter",
        lambda d: (
            d.update(local_margin_s="unbounded", first_crossing_s="unbounded", conservatism=None),
            d.update(instant_margins_s=["unbounded"]),
            d["local_loop"].update(frequency_rad_s=None),
        ),
    ),
}


def _jitter(data, factor):
    """State a longer jitter margin everywhere."""
    data["jitter_margin_s"] *= factor
    data["local_loop"]["jitter"]["delay_s"] = data["jitter_margin_s"]


def _all(holder, key, change):
    holder[key] = [[change(x) for x in row] for row in holder[key]]


@pytest.mark.parametrize("name", FORGED)
def test_a_resealed_forgery_does_not_hold(name):
    design, change = FORGED[name]
    data = made(design)
    assert failures(data) == []
    change(data)
    assert failures(data) not in ([], ["unreadable"])


def leaves(data, path=()):
    """Every place in plain data that holds a value; of a list, the first and the last."""
    if isinstance(data, dict) and data:
        for key, value in data.items():
            yield from leaves(value, (*path, key))
    elif isinstance(data, list) and data:
        for at in sorted({0, len(data) - 1}):
            yield from leaves(data[at], (*path, at))
    else:
        yield path, data


def other(value):
    """Another value of the same type; more than rounding where it is rounding."""
    if isinstance(value, dict | list):
        return {"x": "y"} if isinstance(value, dict) else ["x"]
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return 1.01 * value if abs(value) > 1e-6 else 0.01
    if isinstance(value, str):
        return 0.5 if value == "unbounded" else value + "x"
    return 0.5


def changed(data, path, value):
    data = copy.deepcopy(data)
    holder = data
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    return data


def places(design):
    """Of matrices one entry each is enough: the first."""
    seen = set()
    for path, value in leaves(made(design)):
        kind = tuple(key for key in path if isinstance(key, str))
        if path[0] in ("hashes", "versions", "assumptions"):
            kind = kind[:1]
        if kind not in seen:
            seen.add(kind)
            yield path, value


PLACES_OF_BAXTER = list(places("baxter"))


@pytest.mark.parametrize(("path", "value"), PLACES_OF_BAXTER, ids=lambda v: str(v)[:40])
def test_a_change_at_any_key_is_noticed_or_is_named_as_not_proven(path, value):
    """The digest agrees; baxter has one instant and its proof."""
    found = failures(changed(made("baxter"), path, other(value)))
    if not found:
        assert path[0] in stated_only()


def test_the_walk_meets_every_key():
    assert {path[0] for path, _ in PLACES_OF_BAXTER} == set(made("baxter"))
    assert len(PLACES_OF_BAXTER) > 60


def test_what_follows_is_proven():
    """Keys whose every change is found."""
    for key in (
        "max_delay_s", "max_delay_upper_s", "worst", "worst_motion", "critical", "stable",
        "local_margin_s", "first_crossing_s", "unstable_modes", "conservatism", "proofs", "status",
        "D_theta", "spring_stiffness", "instants", "schema", "criterion",
    ):  # fmt: skip
        assert key not in stated_only()


def test_a_certificate_too_large_to_read_is_not_written(tmp_path):
    from dataclasses import replace

    import sealag

    certificate = sealag.certify(sealag.load("bundled:hume"))
    long = replace(
        certificate, answer=replace(certificate.answer, reasons=("x" * 1_000_000,) * 101)
    )
    with pytest.raises(OSError, match="larger than 100 MB"):
        long.write(tmp_path / "c.json")
    assert not (tmp_path / "c.json").exists()
