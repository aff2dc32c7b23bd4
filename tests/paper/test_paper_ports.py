"""Both subsystems at the paper's ports, the printed tank, and claims about them that can fail."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from humanoids2016 import (
    Fed,
    Leg,
    PortRow,
    Push,
    TankRow,
    TankSetting,
    Verdict,
    one_joint_claim,
    one_joint_grids,
    port_claims,
    run_leg,
)

LEG = Leg(
    name="two joints", M=np.array([[0.8, 0.1], [0.1, 0.3]]), K=np.array([350.0, 300.0]),
    B_s=np.array([0.06, 0.05]), D=np.array([10.0, 20.0]), J=np.array([[1.0, 0.4], [0.2, 1.0]]),
    S=np.array([[60.0, 5.0], [5.0, 40.0]]),
)  # fmt: skip
PUSH = Push(name="push", force=np.array([8.0, -5.0]), frequency=4.0, end=np.inf)
BOUND = 1.0 / np.linalg.eigvalsh(LEG.F / np.sqrt(np.outer(LEG.D, LEG.D)))[-1]


def integrated(leg, seen, push, *, delay, duration):
    """The motion by SciPy, delay interval by delay interval: (t, states)."""
    n = len(leg.K)
    past, times, found = [], [0.0], [np.zeros(4 * n)]

    def command(t):
        for start, end, dense in past:
            if start <= t <= end:
                return -leg.J.T @ leg.S @ seen @ dense(t)[n : 2 * n]
        return np.zeros(n)

    def slope(t, z):
        q, theta, v, rate = np.split(z, 4)
        spring = leg.K * (theta - q)
        f = np.sin(push.frequency * t) * push.force
        tau = command(t - delay)
        return np.concatenate([
            v, rate, np.linalg.solve(leg.M, spring + f), (tau - leg.D * rate - spring) / leg.B_s
        ])  # fmt: skip

    while times[-1] < duration:
        end = min(times[-1] + delay, duration)
        part = solve_ivp(slope, (times[-1], end), found[-1], dense_output=True, rtol=1e-9,
                         atol=1e-12, method="LSODA")  # fmt: skip
        past.append((times[-1], end, part.sol))
        times += part.t[1:].tolist()
        found += list(part.y.T[1:])
    return np.array(times), np.array(found)


@pytest.mark.parametrize("fed", [Fed.MOTOR, Fed.STATIC])
def test_the_motion_is_that_of_an_integrator(fed):
    delay = 0.5 * BOUND
    run = run_leg(LEG, fed, PUSH, delay=delay, duration=1.0)
    seen = LEG.J if fed is Fed.MOTOR else LEG.J @ LEG.static
    time, z = integrated(LEG, seen, PUSH, delay=delay, duration=1.0)
    for joint in range(2):
        expected = np.interp(run.time, time, z[:, 6 + joint])
        np.testing.assert_allclose(run.theta_dot[:, joint], expected, atol=2e-3 * run.fastest)
    other = run_leg(LEG, fed, PUSH, delay=0.9 * delay, duration=1.0)
    rows = min(len(other.time), len(run.time))
    moved = np.interp(run.time[:rows], other.time, other.theta_dot[:, 0])
    assert np.abs(moved - run.theta_dot[:rows, 0]).max() > 2e-3 * run.fastest


def drop(slack):
    return (np.maximum.accumulate(slack) - slack).max()


def test_both_subsystems_are_passive_below_the_bound_and_one_is_not_far_above():
    tame = run_leg(LEG, Fed.MOTOR, PUSH, delay=0.999 * BOUND, duration=3.0)
    assert drop(tame.joint_slack) < tame.tolerance
    assert drop(tame.controller_slack) < tame.tolerance
    assert tame.rise < tame.tolerance
    assert tame.fastest < tame.speed_bound
    wild = run_leg(LEG, Fed.MOTOR, PUSH, delay=5.0 * BOUND, duration=3.0, multiplier=LEG.S)
    assert drop(wild.joint_slack) < wild.tolerance  # links are passive whatever drives them
    assert drop(wild.controller_slack) > 10.0 * wild.tolerance


def test_the_energies_are_those_of_the_paper():
    """V_4 by its double integral, V_3 and V_2 from the states of a run."""
    run = run_leg(LEG, Fed.MOTOR, PUSH, delay=0.05, duration=0.5)
    h, late = run.time[1], round(0.05 / run.time[1])
    rate = np.gradient(run.x_hat, h, axis=0)
    power = np.einsum("ki,ij,kj->k", rate, LEG.S, rate)
    k = len(run.time) - 1
    inner = [np.trapezoid(power[k - r : k + 1], dx=h) for r in range(late + 1)]
    assert run.V_4[k] == pytest.approx(0.5 * np.trapezoid(inner, dx=h), rel=5e-3)
    x = run.x_hat[k]
    assert run.V_3[k] == pytest.approx(0.5 * x @ LEG.S @ x, rel=1e-12)


@pytest.mark.parametrize("fed", [Fed.TANK_PUBLISHED, Fed.TANK_CORRECTED])
def test_a_rich_tank_lets_x_hat_track_and_an_empty_one_does_not(fed):
    pull = np.array([5.0, 2.0])
    rich = TankSetting(energy=1e3, threshold=1e-4, pull=pull)
    run = run_leg(LEG, fed, PUSH, delay=0.3 * BOUND, duration=2.0, tank=rich)
    assert not run.empty.any()
    assert run.astray < 1e-10
    poor = TankSetting(energy=1e-4, threshold=1e-4, pull=pull)
    spent = run_leg(LEG, fed, PUSH, delay=0.3 * BOUND, duration=2.0, tank=poor)
    assert spent.empty.any()
    assert spent.astray > 0.01
    assert spent.tank.min() >= 0.0


def test_only_the_corrected_tank_keeps_v_from_rising():
    tank = TankSetting(energy=5.0, threshold=1e-4, pull=np.array([5.0, 2.0]))
    runs = {
        fed: run_leg(LEG, fed, PUSH, delay=0.999 * BOUND, duration=3.0, tank=tank)
        for fed in (Fed.TANK_PUBLISHED, Fed.TANK_CORRECTED)
    }
    right, wrong = runs[Fed.TANK_CORRECTED], runs[Fed.TANK_PUBLISHED]
    assert right.rise < right.tolerance
    assert wrong.rise > 10.0 * wrong.tolerance


PORT = PortRow(
    leg="leg", fed=Fed.MOTOR, push="push", delay_s=0.1, near_bound=True, tolerance=1e-6,
    joint_drop=0.0, controller_drop=0.0, given=1.0, fastest=1.0, speed_bound=2.0, potential=True,
    duration=6.0,
)  # fmt: skip
TANK = TankRow(
    flow=Fed.TANK_PUBLISHED, push="push", delay_s=0.1, energy=1.0, threshold=1e-4, emptied=None,
    astray=1e-9, rise=0.0, tolerance=1e-6, duration=6.0,
)  # fmt: skip
LARGE = replace(TANK, threshold=1e-1)


def verdicts(ports, tanks):
    return {claim.key: claim.verdict for claim in port_claims(ports, tanks)}


def test_claims_are_confirmed_by_what_holds_and_fail_where_it_does_not():
    good = verdicts([PORT], [LARGE, TANK])
    assert set(good.values()) == {Verdict.CONFIRMED}
    active = replace(PORT, controller_drop=1.0)
    assert verdicts([active], [LARGE, TANK])["subsystems"] is Verdict.CONTRADICTED
    assert verdicts([PORT, active], [LARGE, TANK])["subsystems"] is Verdict.QUALIFIED
    links = replace(PORT, joint_drop=1.0)
    assert verdicts([links], [LARGE, TANK])["subsystems"] is Verdict.CONTRADICTED
    fast = replace(PORT, fastest=3.0)
    assert verdicts([fast], [LARGE, TANK])["motor speed"] is Verdict.CONTRADICTED
    spent = [replace(LARGE, emptied=0.1), replace(TANK, emptied=0.2, astray=0.3)]
    bad = verdicts([PORT], spent)
    assert bad["tank"] is Verdict.CONTRADICTED
    assert bad["x hat"] is Verdict.QUALIFIED  # the first of the two still tracks


def test_one_joint_agrees_with_the_literature_and_a_wrong_bound_would_not():
    grids = one_joint_grids(LEG)
    assert one_joint_claim(grids).verdict is Verdict.CONFIRMED
    too_long = [replace(grid, bound=1.1 * grid.bound) for grid in grids]
    assert one_joint_claim(too_long).verdict is Verdict.QUALIFIED
    backwards = [replace(grid, margin=grid.margin[::-1]) for grid in grids]
    assert one_joint_claim(backwards).verdict is Verdict.QUALIFIED
