"""The simulator and the exact local margin agree; certified designs stay passive under pushes."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES, random_arm, rough_delays
from sealag.delay import Constant, Delays, Link, RoundTrip
from sealag.design import certify, load, simulate
from sealag.margin import DelayedLoop
from sealag.passivity import Instant, Problem, solve
from sealag.simulation import Clock, Network, Outcome, Push, Scene, closed_loop

pytestmark = pytest.mark.slow


def _bound(arm):
    """The passive bound of the arm's delayed stiffness."""
    problem = Problem.of_stiffness(arm.F, arm.springs.motor_damping)
    return float(solve(problem, share=Instant()).delay)


# Constant delay ----------------------------------------------------------------------------------
def _split(delay, count, up):
    """Both ways of a constant delay whose mean hold of half a period is part of it."""
    tick = delay / count
    whole = delay - tick / 2
    first = round(up * count) * tick
    return RoundTrip(
        up=Link(delay=Constant(value=first)), down=Link(delay=Constant(value=whole - first))
    )


def _late_to_early(swing):
    third = len(swing) // 3
    return swing[-third:].max() / swing[third : 2 * third].max()


def _growth(arm, margin, share, *, periods=60, up=0.0):
    """Ratio of the late to the early swing along the mode that crosses, at a share of its delay."""
    delay = share * float(margin.delay)
    count = max(40, int(np.ceil(100.0 * delay)))
    tick, way = delay / count, _split(delay, count, up)
    q, v, theta, theta_dot = np.split(1e-4 * margin.mode.real, 4)
    run = closed_loop(
        arm.robot,
        arm.springs,
        arm.controller(),
        q=arm.q + q,
        v=v,
        theta=arm.theta + theta,
        theta_dot=theta_dot,
        duration=periods * count * tick,
        clock=Clock(physics=tick, central=tick),
        network=Network(
            central_up=way.up, central_down=way.down, embedded_down=Link(delay=Constant(value=0.0))
        ),
        scene=Scene(),
    )
    assert run.outcome is Outcome.COMPLETED
    return _late_to_early(np.abs(run.q - arm.q).max(axis=1))


@pytest.mark.parametrize("seed", range(50))
def test_margin_parts_convergence_from_divergence(tmp_path, seed):
    arm = random_arm(tmp_path, seed)
    margin = DelayedLoop(*arm.loop()).margin()
    assert 0.0 < margin.delay < np.inf
    assert _growth(arm, margin, 0.95) < 1
    assert _growth(arm, margin, 1.05) > 1


@pytest.mark.parametrize(("seed", "share"), [(13, 0.95), (28, 1.05)])
def test_gravity_is_part_of_the_margin(tmp_path, seed, share):
    """Negative control: the margin without gravity's slope gives the wrong verdict."""
    arm = random_arm(tmp_path, seed)
    A_0, A_1 = arm.loop()
    n = arm.robot.n
    A_0[n : 2 * n, :n] += np.linalg.solve(arm.robot.mass_matrix(arm.q), arm.slope())
    growth = _growth(arm, DelayedLoop(A_0, A_1).margin(), share)
    assert (growth > 1) == (share < 1)


@pytest.mark.parametrize("seed", [0, 1])
def test_only_the_sum_of_both_ways_moves_the_roots(tmp_path, seed):
    """d_1 decides, d_2 does not: the same total gives the same swing however it is split."""
    arm = random_arm(tmp_path, seed)
    margin = DelayedLoop(*arm.loop()).margin()
    growth = [_growth(arm, margin, 1.05, up=up) for up in (0.0, 0.3, 0.9)]
    np.testing.assert_allclose(growth[1:], growth[0], rtol=1e-6)
    assert _growth(arm, margin, 1.15, up=0.3) > 1.05 * growth[1]


def _robot_growth(system, delay, *, frame, force, periods=30):
    """The same for a whole design after a small push, with `sealag.Controller`."""
    tick = delay / 40
    delays = Delays(central=_split(delay, 40, 0.5), embedded=Constant(value=0.0), sample_time=tick)
    push = {"frame": frame, "force_n": force, "start_s": 0.0, "duration_s": 4 * tick}
    run = simulate(
        replace(system, delays=delays, simulation=_with(system, [push])),
        duration=periods * 40 * tick,
    )
    assert run.outcome is Outcome.COMPLETED, run.message
    away = np.array([system.robot.difference(run.q[0], q) for q in run.q])
    return _late_to_early(np.abs(away).max(axis=1))


def _with(system, pushes):
    """The design's [simulation] section with other pushes."""
    section = type(system.simulation)
    return section(**{**system.simulation.model_dump(), "pushes": pushes})


@pytest.mark.parametrize(
    ("name", "frame", "force"),
    [("baxter", "left_gripper", [0.1, -0.05, 0.1]), ("anymal", "base", [0.0, 0.1, 0.0])],
)
def test_margin_parts_convergence_from_divergence_on_whole_robots(name, frame, force):
    """Baxter's 14 joints, and ANYmal on its four feet, swaying sideways."""
    system = load(EXAMPLES / f"{name}.toml")
    frozen = system.frozen()
    margin = frozen.margin().delay
    assert 0.0 < margin < np.inf
    assert _robot_growth(system, 0.95 * margin, frame=frame, force=force) < 1
    assert _robot_growth(system, 1.05 * margin, frame=frame, force=force) > 1


# Delays that vary within the certified bound -----------------------------------------------------
SHARE = 0.99  # of the certified delay: what the network's bound is
SPACING = 12  # ticks from push to push
PUSHES = 500  # on each of 20 designs: 10,000
REST = 1000  # ticks after the last push


def _pushed_arm(arm, bound, tick, *, pushes, seed):
    rng = np.random.default_rng(seed)
    delays = rough_delays(bound, tick)
    network = Network.from_delays(delays)
    clock = Clock(physics=tick / 2, embedded=tick / 2, central=tick)
    assert network.delay_bound(clock) == pytest.approx(bound)
    away = rng.normal(0, 0.3, arm.robot.n)
    return closed_loop(
        arm.robot,
        arm.springs,
        arm.controller(),
        q=arm.q + away,
        theta=arm.theta + away,
        duration=(SPACING * pushes + REST) * tick,
        clock=clock,
        network=network,
        scene=Scene(
            pushes=[
                Push(frame=f"link{arm.robot.n - 1}", force=tuple(rng.normal(0, 20, 3)),
                     start=SPACING * tick * k, duration=4 * tick)
                for k in range(1, pushes + 1)
            ]
        ),
        seed=seed,
    )  # fmt: skip


def _assert_passive(run):
    """All observers say so, with a tolerance far below what the damping took."""
    audit = run.audit
    for side in (audit.controller_side, audit.delay_side, audit.joint_side):
        assert side is not None
        assert side.passive, (side.first_violation, side.joint, side.slack.min())
        assert side.tolerance < 1e-2 * audit.joint_flows["damping"][-1].sum()


def _used(run, bound):
    """Oldest state behind a command at work, as a share of the bound."""
    return run.ages.total / bound


@pytest.mark.parametrize("seed", range(1, 40, 2))  # two joints each
def test_certified_arm_stays_passive_under_pushes(tmp_path, seed):
    """The bound of delays that vary, jitter and lose packets is 0.99 of the certified one."""
    arm = random_arm(tmp_path, seed)
    certified = _bound(arm)
    tick = certified / 60
    run = _pushed_arm(arm, SHARE * certified, tick, pushes=PUSHES, seed=seed)
    assert run.outcome is Outcome.COMPLETED
    assert 0.85 * SHARE < _used(run, certified) <= SHARE
    _assert_passive(run)
    stored = sum(run.audit.stores.values()) + run.audit.controller_storage
    assert stored[-1] < stored[-REST] < stored.max()


def test_observers_see_delays_beyond_the_certified_one(tmp_path):
    """Negative control: the same arms at 3 times their bound."""
    seen = 0
    for seed in range(1, 40, 4):
        arm = random_arm(tmp_path, seed)
        certified = _bound(arm)
        run = _pushed_arm(arm, 3.0 * certified, certified / 60, pushes=10, seed=seed)
        assert run.audit.joint_side.passive
        assert run.audit.delay_side.passive == run.audit.controller_side.passive
        seen += not run.audit.delay_side.passive
    assert seen >= 8


def _pushed_robot(system, bound, tick, *, frames, force, seed, count=12):
    rng = np.random.default_rng(seed)
    pushes = [
        {"frame": frames[k % len(frames)], "force_n": rng.normal(0, force, 3).tolist(),
         "start_s": 15 * tick * (k + 1), "duration_s": 5 * tick}
        for k in range(count)
    ]  # fmt: skip
    return simulate(
        replace(system, delays=rough_delays(bound, tick), simulation=_with(system, pushes)),
        duration=(15 * count + 300) * tick,
        seed=seed,
    )


@pytest.mark.parametrize(
    ("name", "frames", "force"),
    [("baxter", ["left_gripper", "right_gripper"], 20.0), ("anymal", ["base"], 30.0)],
)
def test_certified_robot_stays_passive_under_pushes(name, frames, force):
    """`sealag.Controller` on whole robots: gravity, and contacts under ANYmal."""
    system = load(EXAMPLES / f"{name}.toml")
    certified = certify(system).answer.max_delay_s
    run = _pushed_robot(
        system, SHARE * certified, certified / 40, frames=frames, force=force, seed=1
    )
    assert run.outcome is Outcome.COMPLETED, run.message
    assert 0.85 * SHARE < _used(run, certified) <= SHARE
    _assert_passive(run)
    speed = np.abs(run.v).max(axis=1)
    assert speed[-20:].max() < 0.5 * speed.max()


def test_observers_see_delays_beyond_the_certified_one_on_anymal():
    """Negative control: twice the bound."""
    system = load(EXAMPLES / "anymal.toml")
    certified = certify(system).answer.max_delay_s
    run = _pushed_robot(
        system, 2.0 * certified, certified / 40, frames=["base"], force=30.0, seed=1
    )
    assert run.audit.joint_side.passive
    assert not run.audit.delay_side.passive
    assert not run.audit.controller_side.passive
