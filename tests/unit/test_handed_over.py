"""What others take over: runs as tables of pandas, loops as state spaces of python-control."""

import sys

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from sealag.errors import InputError
from sealag.margin import DelayedLoop
from sealag.report import read_recording, write_run


@pytest.fixture(scope="module")
def walked():
    system = sealag.load("bundled:hume")
    return system, sealag.simulate(system, scenario="walk", duration=0.05)


def test_a_run_is_a_table_with_the_recordings_names(walked, tmp_path):
    pytest.importorskip("pandas")
    system, run = walked
    table = run.to_pandas()
    assert table.index.name == "time_s"
    np.testing.assert_array_equal(table.index, run.time)
    write_run(run, system.robot, tmp_path / "w.mcap", project="", version="")
    recording = read_recording(tmp_path / "w.mcap")
    for topic, signal in recording.signals.items():
        if topic in ("/joint_states", "/tf"):
            continue
        for name in signal.names:
            column = name if topic == "/base" else f"{topic[1:]}/{name}"
            np.testing.assert_array_equal(table[column], signal.column(name))
    states = recording.signals["/joint_states"]
    for joint in run.joints:
        np.testing.assert_array_equal(table[joint], states.column(f"{joint}:position"))
        np.testing.assert_array_equal(
            table[f"{joint}:velocity"], states.column(f"{joint}:velocity")
        )
    np.testing.assert_array_equal(table["base_qw"], run.q[:, 6])
    assert table.shape[1] == 2 * len(run.joints) + len(set(run.feet)) + sum(
        len(signal.names)
        for topic, signal in recording.signals.items()
        if topic not in ("/joint_states", "/tf")
    )


def test_a_fixed_base_has_no_base_columns():
    pytest.importorskip("pandas")
    run = sealag.simulate(EXAMPLES / "hume_held.toml", scenario="regulate", duration=0.01)
    table = run.to_pandas()
    assert not [name for name in table if name.startswith("base_")]
    assert list(table)[: len(run.joints)] == list(run.joints)


def response(loop, s, d):
    """det(s − A_0 − A_1 e^{-sd} − A_e e^{-se}) from the loop's own matrices."""
    A_e = 0.0 if loop.A_e is None else np.asarray(loop.A_e)
    late = np.asarray(loop.A_1) * np.exp(-s * d) + A_e * np.exp(-s * loop.embedded_delay)
    return np.linalg.det(s * np.eye(len(np.asarray(loop.A_0))) - np.asarray(loop.A_0) - late)


def closed(loop, s, d):
    """The same from the state space, closed at its ports: det(s − A) det(1 − G(s) Δ(s))."""
    found = loop.to_control()
    count = len([name for name in found.input_labels if name.startswith("u")])
    delta = np.diag(
        [np.exp(-s * d)] * count + [np.exp(-s * loop.embedded_delay)] * (found.ninputs - count)
    )
    open_loop = np.linalg.det(s * np.eye(found.nstates) - found.A)
    return open_loop * np.linalg.det(np.eye(found.ninputs) - found(s, squeeze=False) @ delta)


A_0 = np.array([[0.0, 1.0, 0.0], [-4.0, -1.0, 0.5], [0.0, 0.2, -3.0]])
B = np.array([[0.0], [1.0], [0.0]])
C = np.array([[-2.0, -0.3, 0.1]])
A_e = np.zeros((3, 3))
A_e[2] = [0.4, 0.0, -0.7]
LOOPS = {
    "sides": DelayedLoop(A_0, B, C),
    "whole": DelayedLoop(A_0, B @ C),
    "embedded": DelayedLoop(A_0, B, C, A_e, 0.02),
    "embedded without delay": DelayedLoop(A_0, B, C, A_e),
}


@pytest.mark.parametrize("name", LOOPS)
def test_a_state_space_closes_to_the_loop(name):
    pytest.importorskip("control")
    loop = LOOPS[name]
    for s in (0.3 + 2.0j, 1.0 - 5.0j, 4.0 + 0.5j):
        assert closed(loop, s, 0.1) == pytest.approx(response(loop, s, 0.1), rel=1e-9)


@pytest.mark.parametrize(("share", "stable"), [(0.98, True), (1.02, False)])
def test_a_pade_approximant_closes_at_the_margin(share, stable):
    """Poles of python-control, with the delay approximated there, cross at the margin."""
    control = pytest.importorskip("control")
    loop = sealag.load(EXAMPLES / "hume_held.toml").frozen()
    found = loop.to_control()
    numerator, denominator = control.pade(share * loop.margin().delay, 6)
    late = control.tf2ss(control.tf(numerator, denominator))
    closed = control.feedback(found, control.append(*[late] * found.ninputs), sign=1)
    assert (closed.poles().real.max() < 0.0) == stable


def test_a_robots_loop_has_its_states_names():
    pytest.importorskip("control")
    loop = sealag.load(EXAMPLES / "hume_held.toml").frozen()
    found = loop.to_control()
    assert found.state_labels == list(loop.states)
    assert (found.ninputs, found.noutputs) == (6, 6)
    np.testing.assert_array_equal(found.B @ found.C, loop.A_1)
    np.testing.assert_array_equal(found.A, loop.A_0)


def test_what_is_not_installed_is_named(walked, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError, match="pip install pandas"):
        walked[1].to_pandas()
    with pytest.raises(InputError, match="pip install control"):
        LOOPS["sides"].to_control()


def test_a_loop_that_is_none_is_refused():
    pytest.importorskip("control")
    with pytest.raises(InputError, match="needs"):
        DelayedLoop(A_0, B, B).to_control()
