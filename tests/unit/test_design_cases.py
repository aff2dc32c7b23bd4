"""Inputs on which a certificate was once wrong, each with its right value.

An independent black-box linearisation found them: own URDF load, own contact dynamics, the ticked
controller differentiated numerically. Margins without a joint's damping are its first figures.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sealag
from sealag.cli import main
from sealag.design import load
from sealag.errors import SolverError
from sealag.simulation import Outcome

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT / "tests" / "data" / "cases"


def case(name):
    """A case by its name, a file or a folder with p.toml."""
    path = CASES / name / "p.toml"
    return load(path if path.is_file() else CASES / f"{name}.toml")


def undamped(system):
    """The same robot without the damping of its joints."""
    return replace(system, robot=replace(system.robot, damping=np.zeros(system.robot.n)))


def with_drives(system, **changes):
    return replace(system, actuators=replace(system.actuators, **changes))


def growth(loop):
    """Fastest growth without delay, 1/s."""
    return float(np.linalg.eigvals(loop.A_0 + loop.A_1 + loop.A_e).real.max())


# Margins by value ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "margin"), [("anymal", 87.4415), ("anymal_crawl", 73.6393), ("baxter", 107.6918)]
)
def test_margins_of_examples(name, margin):
    found = load(ROOT / "examples" / f"{name}.toml").local_margins().delay_s
    assert found == pytest.approx(margin * 1e-3, abs=1e-7)


def test_damping_of_a_urdf_acts():
    baxter = undamped(load(ROOT / "examples" / "baxter.toml"))
    assert baxter.frozen().margin().delay == pytest.approx(101.9631e-3, abs=1e-7)
    best = case("dampbest")
    assert best.local_margins().delay_s == pytest.approx(52.286e-3, abs=1e-6)
    assert undamped(best).local_margins().delay_s == pytest.approx(62.687e-3, abs=1e-6)


def test_followers_of_a_urdf_move_with_their_leaders():
    system = case("mimic")
    certificate = sealag.certify(system)
    assert certificate.answer.max_delay_s == pytest.approx(269.97e-3, abs=1e-5)
    assert certificate.answer.local_margin_s == pytest.approx(420.84e-3, abs=1e-5)


@pytest.mark.parametrize(
    ("bandwidth", "damped", "margin"),
    [(100.0, False, 91.99), (600.0, False, 100.33), (100.0, True, 97.84)],
)
def test_slow_drives_cost_margin(bandwidth, damped, margin):
    system = case("s2_torque_bandwidth_baxter")
    system = with_drives(system, torque_bandwidth=np.full(14, bandwidth))
    loop = (system if damped else undamped(system)).frozen()
    assert loop.margin().delay == pytest.approx(margin * 1e-3, abs=5e-6)


def test_slow_drives_are_covered_by_no_bound():
    system = case("s2_torque_bandwidth_baxter")
    bounds = system.certified_bounds(system.spaces())
    assert bounds.delay[0] == 0.0
    assert "torque_bandwidth" in bounds.refusals[0]
    ideal = with_drives(
        system, torque_bandwidth=np.full(14, np.inf), torque_limit=np.full(14, np.inf)
    )
    assert ideal.certified_bounds(ideal.spaces()).delay[0] > 0.09


# Unstable without delay ------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "modes", "rate"),
    [
        ("s1_link_hessian_anymal", 1, 0.1743),
        ("s2_torque_bandwidth_one_joint", 2, 7.2503),
        ("s4_tank_passive_base", 4, 0.00098),
        ("s5_tank_locally_active", 2, 0.5745),
    ],
)
def test_unstable_without_delay(name, modes, rate):
    system = case(name)
    found = system.local_margins()
    assert (found.delay_s, found.unstable_modes) == (0.0, modes)
    assert growth(system.frozen()) == pytest.approx(rate, rel=2e-3)
    certificate = sealag.certify(system)
    assert certificate.answer.stable is False
    assert certificate.answer.unstable_modes == modes
    assert certificate.answer.local_margin_s == 0.0


def test_late_torque_feedback_is_unstable_and_refused():
    """Unstable by the embedded delay alone; the same drive without that delay is not."""
    system = case("s8_delayed_torque_feedback")
    certificate = sealag.certify(system)
    assert certificate.answer.status == "not_certified"
    assert "torque feedback of j is late by 12.000 ms" in certificate.answer.reasons[0]
    assert (certificate.answer.stable, certificate.answer.unstable_modes) == (False, 2)
    assert not any(one.key == "torque_feedback" for one in certificate.answer.assumptions)
    at_once = replace(system, delays=replace(system.delays, delayed_torque_feedback=False))
    assert sealag.certify(at_once).answer.stable is True
    run = sealag.simulate(system, scenario="track", duration=2.0)
    assert run.outcome is Outcome.DIVERGED or np.abs(run.q[-1] - run.q[0]).max() > 0.5


def test_a_tank_that_can_pay_drives_the_loop():
    """The loop of s5 is stable with an empty tank."""
    system = case("s5_tank_locally_active")
    empty = replace(system, law=replace(system.law, signal=replace(system.law.signal, energy=0.0)))
    assert empty.local_margins().delay_s > 0.0


# Limits, rests and singular postures -----------------------------------------------------------
@pytest.mark.parametrize(("name", "joint"), [("s2_torque_limit_one_joint", "j"), ("effort0", "j1")])
def test_motors_that_cannot_carry_the_posture_are_not_certified(name, joint):
    system = case(name)
    certificate = sealag.certify(system)
    assert certificate.answer.status == "not_certified"
    assert f"the motor of {joint} gives at most" in certificate.answer.reasons[0]
    strong = with_drives(system, torque_limit=np.full(system.robot.n, 1e3))
    assert not any("the motor of" in reason for reason in sealag.certify(strong).answer.reasons)


def test_a_limit_of_zero_is_named():
    keys = {one.key: one.text for one in sealag.certify(case("effort0")).answer.assumptions}
    assert "0 for j1" in keys["urdf_limit_zero"]
    assert "urdf_limit_zero" not in {
        one.key for one in sealag.certify(case("dampbest")).answer.assumptions
    }


def test_joint_damping_of_the_urdf_is_named():
    system = case("dampbest")
    damped = replace(system, robot=replace(system.robot, damping=np.full(system.robot.n, 0.1)))
    still = replace(system, robot=replace(system.robot, damping=np.zeros(system.robot.n)))
    for one, named in ((damped, True), (still, False)):
        keys = {part.key for part in sealag.certify(one).answer.assumptions}
        assert ("joint_damping" in keys) is named


def test_a_motor_without_its_torque_does_not_hold_the_arm():
    """The limit acts in the simulator as well."""
    system = case("s2_torque_limit_one_joint")
    strong = with_drives(system, torque_limit=np.full(1, 1e3))
    fallen, held = (
        sealag.simulate(one, scenario="regulate", duration=0.5) for one in (system, strong)
    )
    moved = [np.abs(run.q - run.q[0]).max() for run in (fallen, held)]
    assert moved[0] > 0.1
    assert moved[1] < 1e-3


def test_a_lost_direction_is_refused_and_bounded_beside_it():
    system = case("s6_singular_posture")
    certificate = sealag.certify(system)
    assert certificate.answer.status == "not_certified"
    assert "lose a direction" in certificate.answer.reasons[0]
    assert system.spaces().singular.all()
    answer = certificate.answer
    assert (answer.stable, answer.local_margin_s) == (None, None)
    said = [one.text for one in answer.assumptions if one.key == "critical_instant"]
    assert "differs by 42.1%" in said[0]
    with pytest.raises(SolverError, match="no margin holds"):
        system.local_margins()
    for angle in (0.001, 0.01):
        bent = system.posture.copy()
        bent[1] += angle
        beside = replace(system, posture=bent)
        assert not beside.spaces().singular.any()
        answer = sealag.certify(beside).answer
        assert answer.max_delay_s == pytest.approx(51.43e-3, abs=1e-5)
        assert answer.stable is True


def test_the_loop_rests_elsewhere_with_another_margin():
    """Soft springs, motor angles: 13.9 ms in the posture, less where it sags to."""
    system = case("unclear_own_equilibrium")
    certificate = sealag.certify(system)
    assert system.frozen(rest=system.in_posture()).margin().delay == pytest.approx(
        13.94e-3, abs=1e-5
    )
    assert certificate.answer.local_margin_s == pytest.approx(5.1275e-3, abs=1e-6)
    assert certificate.answer.max_delay_s > 13e-3
    assert certificate.answer.status == "not_certified"
    assert "before its bound" in certificate.answer.reasons[0]


def test_a_static_joint_state_that_gravity_makes_possible_is_found():
    """Newton's step with the gradient of the compensation, not of the task alone."""
    system = case("s7_static_joint_gravity")
    run = sealag.simulate(system, scenario="regulate", duration=0.5)
    assert run.outcome is Outcome.COMPLETED, run.message
    assert np.abs(run.q - run.q[0]).max() < 1e-6
    certificate = sealag.certify(system)
    assert (certificate.answer.status, certificate.answer.stable) == ("certified", True)
    assert certificate.answer.contraction < 1.0
    assert certificate.answer.max_delay_s < certificate.answer.local_margin_s


def test_a_quantile_says_what_it_leaves_out():
    """The median is no upper bound: of 50 samples 25 are later."""
    system = case("unclear_quantile")
    samples = np.loadtxt(CASES / "samp.txt")
    texts = [
        one.text for one in sealag.certify(system).answer.assumptions if one.key == "delay_quantile"
    ]
    later = np.mean(samples > np.quantile(samples, 0.5))
    assert later == 0.5
    assert len(texts) == 1
    assert texts[0].count(f"{later:.1%} of the packets") == 2
    keys = {one.key for one in sealag.certify(case("dampbest")).answer.assumptions}
    assert "delay_quantile" not in keys


# Answers and sentences -------------------------------------------------------------------------
def command(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    return stop.value.code, *capsys.readouterr()


@pytest.mark.parametrize(
    "name", ["crash_no_free_motion", "crash_frame_named_as_joint", "link_eq_joint"]
)
def test_what_once_crashed_is_answered(name, tmp_path, capsys):
    path = CASES / name / "p.toml"
    path = path if path.is_file() else CASES / f"{name}.toml"
    code, out, err = command(capsys, "certify", path, "--json", "--out", tmp_path / "c.json")
    assert code in (0, 1)
    assert '"status"' in out
    assert "Traceback" not in out + err


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("loop2", ["link l2 has two parents", "j2", "j3"]),
        ("parent2", ["link bar has two parents", "c1", "c2"]),
        ("I_triangle", ["link l1", "triangle inequality"]),
        ("negfixed", ["mass of link cw", "-0.5"]),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(name, words, tmp_path, capsys):
    code, out, err = command(
        capsys, "certify", CASES / name / "p.toml", "--out", tmp_path / "c.json"
    )
    assert (code, out) == (2, "")
    assert "r.urdf" in err
    for word in words:
        assert word in " ".join(err.split())
    assert "Traceback" not in err


def test_zero_roots_decide_the_margin_where_they_hide_the_crossings():
    """Six joints are compensated and held by no task: the margin is 0, and no search says when
    another root would cross."""
    certificate = sealag.certify(case("free_compensated_joints"))
    assert (certificate.answer.stable, certificate.answer.unstable_modes) == (False, 6)
    assert certificate.answer.local_margin_s == 0.0
    assert certificate.answer.first_crossing_s is None
    held = case("free_compensated_joints")
    posture = replace(held.law.tasks[0], name="all", kind="posture", frame=None, axes=())
    assert sealag.certify(replace(held, law=replace(held.law, tasks=(posture,)))).answer.stable
