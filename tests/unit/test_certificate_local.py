"""The local margin of a certificate is checked from its frozen loop, by another method."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.certificates import failures, made, plain, resealed
from helpers.designs import EXAMPLES
from humanoids2016 import random_sea_plant
from sealag.margin import DelayedLoop
from sealag.passivity import Certificate

NO_EARLIER = "no root crosses before"
ON_AXIS = "root on the axis at the first crossing"


def matrices(data):
    loop = data["local_loop"]
    V = np.array(loop["symmetries"]).reshape(len(loop["states"]), -1)
    return np.array(loop["A_0"]), np.array(loop["A_1"]), V


def with_loop(A_0, A_1, *, crossing, frequency, unstable=0, embedded=None):
    """A certificate whose frozen loop is another: only the checks of the loop are looked at."""
    data = made("baxter")
    A_e, delay = embedded if embedded is not None else (None, 0.0)
    loop = {
        "A_0": A_0.tolist(), "A_1": A_1.tolist(), "A_e": None if A_e is None else A_e.tolist(),
        "embedded_delay_s": delay, "symmetries": [], "frequency_rad_s": frequency, "jitter": None,
        "states": [f"x{k}" for k in range(len(A_0))], "at": "posture",
    }  # fmt: skip
    margin = 0.0 if unstable else crossing
    data.update(
        local_loop=loop, first_crossing_s=crossing, local_margin_s=margin, unstable_modes=unstable,
        instant_margins_s=[margin], stable=not unstable,
    )  # fmt: skip
    return data


def answers(data):
    found = {check.name: check for check in Certificate.verify(resealed(data)).checks}
    return {name: found[name] for name in (NO_EARLIER, ON_AXIS) if name in found}


def plants(count):
    seed, found = 0, 0
    while found < count:
        plant = random_sea_plant(seed, joints=3, signal="motor")
        seed += 1
        if plant.symmetries.size:
            continue
        margin = DelayedLoop(plant.A_0, plant.A_1).margin()
        if np.isfinite(margin.first_crossing) and not margin.unstable_roots:
            found += 1
            yield plant, margin


def test_crossings_of_random_plants_hold_and_later_ones_do_not():
    later = 0
    for plant, margin in plants(8):
        at = {"crossing": margin.first_crossing, "frequency": margin.frequency}
        checks = answers(with_loop(plant.A_0, plant.A_1, **at))
        assert all(check.ok for check in checks.values()), checks
        period = 2.0 * np.pi / margin.frequency
        at["crossing"] += period
        checks = answers(with_loop(plant.A_0, plant.A_1, **at))
        assert checks[ON_AXIS].ok
        assert not checks[NO_EARLIER].ok
        found = float(checks[NO_EARLIER].detail.split()[0])
        assert found == pytest.approx(margin.first_crossing, rel=1e-4)
        later += 1
    assert later == 8


def random_loops(count):
    """Dense ones, oscillators that hardly decay, and two equal arms side by side."""
    rng = np.random.default_rng(11)
    while count:
        n = int(rng.integers(2, 6))
        A_0, A_1 = rng.normal(size=(2, n, n)) * 10.0 ** rng.uniform(-1.0, 1.0, (2, 1, 1))
        A_0 -= (np.linalg.eigvals(A_0 + A_1).real.max() + 10.0 ** rng.uniform(-3, 1)) * np.eye(n)
        if count % 3 == 0:
            A_0, A_1 = np.kron(np.eye(2), A_0), np.kron(np.eye(2), A_1)
        margin = DelayedLoop(A_0, A_1).margin()
        if np.isfinite(margin.first_crossing):
            count -= 1
            yield A_0, A_1, margin


def test_a_crossing_is_told_from_a_later_one():
    """The sweep by eigenvalue discs knows of no search by Newton's method, and must agree."""
    for A_0, A_1, margin in random_loops(12):
        at = {"frequency": margin.frequency}
        assert answers(with_loop(A_0, A_1, crossing=margin.first_crossing, **at))[NO_EARLIER].ok
        for share in (1.01, 1.5, 40.0):
            late = answers(with_loop(A_0, A_1, crossing=share * margin.first_crossing, **at))
            assert not late[NO_EARLIER].ok
            found = float(late[NO_EARLIER].detail.split()[0])
            assert found == pytest.approx(margin.first_crossing, rel=1e-4)


def test_roots_below_the_real_axis_are_swept_too():
    """λ² + 0.2 λ + 1 = ½ e^{-λd} crosses first after more than half a turn."""
    A_0, A_1 = np.array([[0.0, 1.0], [-1.0, -0.2]]), np.array([[0.0, 0.0], [0.5, 0.0]])
    margin = DelayedLoop(A_0, A_1).margin()
    first, omega = margin.first_crossing, margin.frequency
    assert np.pi < first * omega < 2.0 * np.pi
    assert answers(with_loop(A_0, A_1, crossing=first, frequency=omega))[NO_EARLIER].ok
    assert not answers(with_loop(A_0, A_1, crossing=1.01 * first, frequency=omega))[NO_EARLIER].ok


def slow_design():
    """Hume held, with damping so strong that its first crossing takes two days."""
    system = sealag.load(EXAMPLES / "hume_held.toml")
    heavy = replace(system.actuators, motor_damping=np.full(system.robot.n, 1e6))
    return plain(sealag.certify(replace(system, actuators=heavy)))


def test_a_crossing_that_takes_days_is_counted_where_rounding_leaves_it_open():
    data = slow_design()
    assert data["first_crossing_s"] > 1e5
    found = answers(data)
    assert all(check.ok for check in found.values()), found
    assert "is not excluded, with 0 roots" in found[NO_EARLIER].detail
    later = {**data, "first_crossing_s": 1.02 * data["first_crossing_s"]}
    assert not answers(later)[NO_EARLIER].ok


def test_a_task_that_is_a_millionth_of_its_springs_is_verified():
    """Its derivative is below what differences of carried torques leave."""
    system = sealag.load(EXAMPLES / "hume_held.toml")
    soft = tuple(replace(task, stiffness=1e-6 * task.stiffness) for task in system.law.tasks)
    data = plain(sealag.certify(replace(system, law=replace(system.law, tasks=soft))))
    assert failures(data) == []
    data["local_loop"]["A_1"][8][6] += 1e-2
    assert failures(data) != []


def test_the_same_crossings_by_counting_roots():
    """An embedded part that does nothing leaves the roots where they are; the method is another."""
    for plant, margin in plants(4):
        nothing = (0.0 * plant.A_0, 1e-3)
        at = {"frequency": margin.frequency, "embedded": nothing}
        period = 2.0 * np.pi / margin.frequency
        for crossing, holds in ((margin.first_crossing, True),
                                (margin.first_crossing + period, False)):  # fmt: skip
            checks = answers(with_loop(plant.A_0, plant.A_1, crossing=crossing, **at))
            assert checks[NO_EARLIER].ok is holds
            words = checks[NO_EARLIER].detail.split(" roots")[0]
            counts = [int(word) for word in words.split(", ")]
            for share, count in zip((0.25, 0.5, 0.75, 0.999), counts):
                right = DelayedLoop(plant.A_0, plant.A_1).roots(share * crossing, count=8)
                assert count == int((right.real > 0.0).sum())


def test_roots_that_hardly_decay_are_counted_beside_a_crossing():
    """ẋ = −x(t − d) crosses at π/2, beside oscillators with a damping of a millionth that it
    pushes, so that the poles are no block of their own."""
    A_0, A_1 = np.zeros((13, 13)), np.zeros((13, 13))
    A_1[0, 0] = -1.0
    for k, omega in enumerate(np.linspace(0.3, 30.0, 6)):
        at = slice(1 + 2 * k, 3 + 2 * k)
        A_0[at, at] = [[0.0, omega], [-omega, -2e-6 * omega]]
        A_0[2 + 2 * k, 0] = 1.0
    nothing = (0.0 * A_0, 1e-3)
    for crossing, count in ((np.pi / 2.0, 0), (np.pi / 2.0 + 2.0 * np.pi, 2)):
        data = with_loop(A_0, A_1, crossing=crossing, frequency=1.0, embedded=nothing)
        check = answers(data)[NO_EARLIER]
        assert check.ok is (count == 0)
        assert f"{count} roots right of the axis" in check.detail


def test_a_delay_of_the_embedded_part_moves_the_crossing():
    """ẋ = −x(t − e) − x(t − d)·0.5: with e = 0.3 jω is a root at another d than with e = 0."""
    A_0, A_1, A_e = np.array([[0.0]]), np.array([[-2.0]]), np.array([[-1.0]])
    for e in (1e-9, 0.3):
        omega = np.linspace(0.5, 3.0, 250_001)
        z = (1j * omega + np.exp(-1j * omega * e)) / -2.0
        at = int(np.argmin(np.abs(np.abs(z) - 1.0)))
        for _ in range(50):
            low, high = omega[max(at - 1, 0)], omega[min(at + 1, len(omega) - 1)]
            omega = np.linspace(low, high, 101)
            z = (1j * omega + np.exp(-1j * omega * e)) / -2.0
            at = int(np.argmin(np.abs(np.abs(z) - 1.0)))
        crossing = float((-np.angle(z[at])) % (2.0 * np.pi) / omega[at])
        data = with_loop(A_0, A_1, crossing=crossing, frequency=float(omega[at]), embedded=(A_e, e))
        assert all(check.ok for check in answers(data).values()), answers(data)
        data["local_loop"]["embedded_delay_s"] = e + 0.1
        assert not answers(data)[ON_AXIS].ok


def test_no_crossing_at_all_is_proven_and_not_believed():
    A_0, A_1 = np.array([[-2.0, 1.0], [0.0, -3.0]]), np.array([[0.5, 0.0], [0.2, -0.9]])
    data = with_loop(A_0, A_1, crossing="unbounded", frequency=None)
    assert answers(data)[NO_EARLIER].ok
    data = with_loop(A_0, 8.0 * A_1[[1, 0]], crossing="unbounded", frequency=None)
    assert not answers(data)[NO_EARLIER].ok


def test_every_example_has_a_loop_that_gives_its_margin():
    for design in ("baxter", "moving", "one foot"):
        data = made(design)
        A_0, A_1, V = matrices(data)
        margin = DelayedLoop(A_0, A_1, symmetries=V).margin()
        assert margin.unstable_roots == data["unstable_modes"]
        assert margin.first_crossing == pytest.approx(data["first_crossing_s"], rel=1e-9)


def _crossing(d, factor):
    d["first_crossing_s"] *= factor
    if d["local_margin_s"]:
        d["local_margin_s"] *= factor
        d["instant_margins_s"] = [factor * margin for margin in d["instant_margins_s"]]
        d["conservatism"] = d["local_margin_s"] / d["max_delay_s"]


def _later(d):
    """A true crossing of the same root, one period after the first."""
    period = 2.0 * np.pi / d["local_loop"]["frequency_rad_s"]
    _crossing(d, 1.0 + period / d["first_crossing_s"])


def _row(d, name):
    return d["local_loop"]["A_0"][d["local_loop"]["states"].index(name)]


def _links(d):
    for name in d["local_loop"]["states"]:
        if name.startswith("d/dt z"):
            row = _row(d, name)
            row[:] = [1.00001 * value for value in row]


def _entry(key, row, column, factor):
    """Change what the rate of the last motor takes from an entry."""

    def change(d):
        states = d["local_loop"]["states"]
        d["local_loop"][key][states.index(row(d))][states.index(column(d))] *= factor

    return change


def _motor(d):
    return f"theta:{d['joints'][-1]}"


def _rate(d):
    return f"d/dt {_motor(d)}"


CLAIMS = {
    "later": ("root on the axis", lambda d: _crossing(d, 1.0001)),
    "earlier": ("root on the axis", lambda d: _crossing(d, 0.9999)),
    "another crossing": (NO_EARLIER, _later),
    "margin alone": (
        "margins of instants",
        lambda d: d.update(local_margin_s=1.0, conservatism=10.0),
    ),
    "unstable": ("unstable modes", lambda d: d.update(unstable_modes=2)),
    "stable": ("stable without delay", lambda d: d.update(stable=not d["stable"])),
    "no loop": ("frozen loop", lambda d: d.update(local_loop=None)),
    "delayed stiffness": ("frozen loop: motors", _entry("A_1", _rate, _motor, 1.001)),
    "springs": ("frozen loop: motors", _entry("A_0", _rate, _motor, 1.001)),
    "damping": ("frozen loop: motors", _entry("A_0", _rate, _rate, 1.001)),
    "positions": ("frozen loop: positions", _entry("A_0", _motor, _rate, 1.001)),
    "names": (
        "frozen loop: states",
        lambda d: d["local_loop"]["states"].__setitem__(0, "z1000"),
    ),
    "links": ("root on the axis", _links),
    "frequency": (
        "local margin",
        lambda d: d["local_loop"].update(frequency_rad_s=None),
    ),
}


@pytest.mark.parametrize("name", CLAIMS)
@pytest.mark.parametrize("design", ["baxter", "moving"])
def test_a_changed_claim_is_found_by_its_check(design, name):
    check, change = CLAIMS[name]
    data = made(design)
    if name == "delayed stiffness" and data["local_loop"]["at"] == "rest":  # F is another there
        check = "root on the axis"
    change(data)
    assert any(failed.startswith(check) for failed in failures(data)), failures(data)


def test_a_symmetry_along_which_something_acts_is_found():
    """A robot that flies is moved by nothing along three directions."""
    data = made("flying")
    assert failures(data) == []
    assert matrices(data)[2].shape[1] == 3
    for row in data["local_loop"]["symmetries"]:
        row[0] += 0.1
    assert "frozen loop: symmetries" in failures(data)


def test_a_slack_crossing_is_not_hidden_by_leaving_it_out():
    """What is not known is open at its instant, and then nothing is said of stability."""
    data = made("baxter")
    data["first_crossing_s"] = None
    assert "local margin" in failures(data)
    data.update(local_margin_s=None, conservatism=None)
    assert "margins of instants" in failures(data)
    data.update(instant_margins_s=[None], instant_basis=["open"])
    assert "stable without delay" in failures(data)


def test_a_bound_is_no_margin_where_the_law_answers_to_the_base():
    """The passive bound of an instant may stand for its margin, unless what is fed back depends on
    motions that the motors do not determine."""
    data = made("moving")
    k = (data["critical"]["instant"] + 7) % data["instants"]
    data["instant_basis"][k] = "bound"
    data["instant_margins_s"][k] = data["bounds_s"][k]
    loop = data["local_loop"]
    others = [k for k, name in enumerate(loop["states"]) if not name.startswith("theta:")]
    for share, coupled in ((0.0, False), (1e-8, False), (1e-3, True)):
        for row in loop["A_1"]:
            for at in others:
                row[at] = 0.0
        loop["A_1"][-1][others[1]] = share * np.abs(loop["A_1"]).max()
        assert ("margins by bounds" in failures(data)) is coupled


def test_files_stay_small():
    assert len(json.dumps(made("baxter"))) < 130_000
    assert len(json.dumps(made("moving"))) < 140_000


def test_a_loop_that_gains_stability_before_its_first_crossing_is_no_contradiction(tmp_path):
    """Without contacts ANYmal's base turns with its legs: two roots move left on the way."""
    text = (EXAMPLES / "anymal.toml").read_text()
    project = tmp_path / "floating.toml"
    project.write_text(re.sub(r'\[\[contacts\]\]\nframe = "\w+"\n', "", text))
    certificate = sealag.certify(sealag.load(project))
    data = plain(certificate)
    assert data["unstable_modes"] == 2
    count = [c for c in Certificate.verify(data).checks if c.name == NO_EARLIER]
    assert count[0].ok
    assert "0 roots" in count[0].detail
    assert failures(data) == []
