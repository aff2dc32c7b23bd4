"""The gait's own margin: the step-to-step map of the simulated walk, and its multipliers."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import sealag
from sealag.delay import Constant, Delays, Link
from sealag.design import load
from sealag.errors import InputError
from sealag.simulation import Clock, Network, Push, Scene, closed_loop
from sealag.simulation._gait_margin import GaitAtDelay, GaitCase, GaitMargin
from sealag.simulation._orbit import find_orbit
from sealag.walking import GroundProfile
from sealag.walking._placement import Placement

CLOCK = Clock(central=1e-3)


@pytest.fixture(scope="module")
def case():
    """Hume's walk with its mean delays."""
    system = load("bundled:hume")
    return GaitCase(
        robot=system.robot, actuators=system.actuators, walking=system.walking,
        delays=system.delays, clock=CLOCK,
    )  # fmt: skip


def _repeats(case):
    """Whether a restored walk goes on as it did."""
    walk = case.strides(1.0, held=4)
    walk.run(2)
    kept = walk.save()
    walk.run(2)
    first = walk.coordinates()
    walk.load(kept)
    walk.run(2)
    return np.array_equal(first, walk.coordinates())


def test_a_saved_walk_goes_on_as_it_did(case):
    """Bit by bit: nothing that a walk remembers is left out."""
    assert _repeats(case)


def test_memory_left_out_is_noticed(case, monkeypatch):
    """Without the footsteps' memory a restored walk is another one."""
    monkeypatch.setattr(Placement, "memory", lambda self: [])
    assert not _repeats(case)


def _sections(case, *, force):
    """q and v (40, 23) of the plain simulator at its sections, without places and quaternions;
    pushed in the twentieth stride."""
    walking = replace(case.walking, ground=GroundProfile.flat(), steps=80)
    start = walking.begin(case.robot, case.actuators, period=1e-3)
    delays = case.delays
    up, down, drive = (
        Link(delay=Constant(value=link.delay.mean))
        for link in (delays.central.up, delays.central.down, delays.embedded.down)
    )
    push = Push(frame="torso", force=(force, 0.5 * force, 0.0), start=14.2, duration=0.01)
    run = closed_loop(
        case.robot, case.actuators, start.controller, q=start.q, v=start.v, theta=start.theta,
        theta_dot=start.theta_dot, duration=40 * 0.7, scene=Scene.of_walk(walking, [push]),
        network=Network(central_up=up, central_down=down, embedded_down=drive),
        clock=replace(CLOCK, log=0.7),
    )  # fmt: skip
    return np.hstack([run.q[:, 7:], run.v])


def _rate(case):
    """By how much a stride changes what a small push has left, late, and how much that is.

    Three modes are left, a pair and a single one, so that sizes alone beat: the stride's map on the
    span of three directions (dynamic mode decomposition) tells them apart.
    """
    left = _sections(case, force=1.0) - _sections(case, force=-1.0)
    before, after = left[25:36].T, left[26:37].T
    U, sizes, V = np.linalg.svd(before, full_matrices=False)
    stride = U[:, :3].T @ after @ V[:3].T / sizes[:3]
    return float(np.abs(np.linalg.eigvals(stride)).max()), np.linalg.norm(left, axis=1)


@pytest.fixture(scope="module")
def orbit(case):
    """The periodic gait at the design's mean delay."""
    walk = case.strides(1.0, held=14)
    walk.run(20)
    return find_orbit(walk, warm=6)


@pytest.mark.slow
def test_multipliers_predict_how_a_push_decays(case, orbit):
    """The plain simulator, pushed one way and the other, forgets at the largest one's rate."""
    rate, left = _rate(case)
    assert left[24:].max() < 0.1
    assert rate == pytest.approx(abs(orbit.multipliers[0]), rel=0.03)
    assert orbit.residual < 1e-7


@pytest.mark.slow
def test_an_unstable_gait_has_a_multiplier_above_one(case, orbit):
    """Without control of the heading the yaw leaves the gait, by the multiplier in each stride."""
    options = replace(case.walking.options, heading_stiffness=0.0)
    free = replace(case, walking=replace(case.walking, options=options)).strides(1.0, held=14)
    free.load(orbit.state)
    alone = find_orbit(free, warm=0)
    largest = alone.multipliers[0]
    assert largest.real > 1.02
    assert abs(largest.imag) < 1e-6
    free.load(alone.state)
    before = free.coordinates()
    way = alone.mode.real / np.abs(alone.mode.real).max()
    free.load(alone.state, 1e-4 * way)
    grown = []
    for _ in range(4):
        free.run(1)
        grown.append(float((free.coordinates() - before) @ way))
    assert np.diff(np.log(grown)) == pytest.approx(np.log(largest.real), rel=0.15)


def _point(delay, radius, walks):
    return GaitAtDelay(
        delay_s=delay, residual=0.0, multipliers=np.array([radius]), error=1e-3, walks=walks,
        reason="",
    )  # fmt: skip


def test_the_margin_is_below_the_first_delay_that_is_not_stable():
    """Stable again at a longer delay does not count, and an error counts against the gait."""
    radii = ((0.01, 0.6, True), (0.02, 0.9995, True), (0.03, 0.7, False), (0.04, 0.7, True))
    found = GaitMargin(points=tuple(_point(*one) for one in radii), design_s=0.01, neutral=4)
    assert (found.delay_s, found.walks_s, found.falls_s) == (0.01, 0.02, 0.03)
    answer = found.summary()
    assert [point["stable"] for point in answer["points"]] == [True, False, True, True]


def test_a_margin_needs_a_walk_delays_and_whole_periods(case):
    system = load("bundled:hume")
    with pytest.raises(InputError, match="walking"):
        replace(system, walking=None).gait_margin()
    none = Delays(central=Constant(value=0.0), embedded=Constant(value=0.0))
    with pytest.raises(InputError, match="central_round_trip"):
        replace(case, delays=none).margin(jobs=1)
    gait = replace(case.walking.gait, step_time=0.3505)
    with pytest.raises(InputError, match=r"walking\.gait\.step_time"):
        replace(case, walking=replace(case.walking, gait=gait)).strides(1.0, held=1)


def test_the_gait_s_margin_is_printed_and_is_json(cli, monkeypatch):
    """A table of delays, then the margin; JSON has the same numbers."""
    points = tuple(
        GaitAtDelay(
            delay_s=delay, residual=1e-9, multipliers=np.array(radii), error=1e-4, walks=walks,
            reason=reason,
        )
        for delay, radii, walks, reason in (
            (0.02, [0.6 + 0.2j, 0.6 - 0.2j], True, ""), (0.03, [], False, "the base is low"),
        )
    )  # fmt: skip
    found = GaitMargin(points=points, design_s=0.02, neutral=4)
    monkeypatch.setattr(sealag.System, "gait_margin", lambda self: found)
    code, text, err = cli("margin", "bundled:hume", "--gait")
    assert (code, err) == (0, "")
    assert re.search(r"20\.000 ms +0\.632 +stable +goes on\n", text)
    assert re.search(r"30\.000 ms +no gait +not stable falls +the base is low\n", text)
    assert re.search(r"margin of the gait +20\.000 ms", text)
    answer = json.loads(cli("margin", "bundled:hume", "--gait", "--json")[1])
    assert (answer["gait_margin_s"], answer["falls_s"]) == (0.02, 0.03)
    assert answer["points"][0]["multipliers"] == [[0.6, 0.2], [0.6, -0.2]]
    assert answer["points"][1]["radius"] is None
