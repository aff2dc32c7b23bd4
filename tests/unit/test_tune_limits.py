"""Tuned gains sit on the boundary: closed forms, and convex programs that CVXPY solves anew."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system, constant_delays, joint_task
from sealag.passivity import Status
from sealag.tune import tune
from sealag.whole_body import Law, MotorAngles, StaticJoint, Tank

PLANTS = range(50)


def random_arm(folder, seed):
    """An arm of one or two joints with random springs, dampers, gains, signal and delay."""
    rng = np.random.default_rng(seed)
    n = 1 + seed % 2
    signal = (MotorAngles(), StaticJoint(), Tank())[seed % 3]
    root = rng.normal(size=(n, n))
    K_x = 30.0 * (root @ root.T + 0.1 * np.eye(n))
    robot = arm_system(folder, count=n).robot
    law = Law(
        tasks=(joint_task(robot, K_x),), stiffness_form="force", signal=signal, gravity="planned"
    )
    springs = {
        "spring_stiffness": rng.uniform(100.0, 1000.0, n),
        "motor_damping": rng.uniform(2.0, 30.0, n),
    }
    delays = constant_delays(*rng.uniform(1e-3, 2e-2, 2), sample_time=1e-3)
    return arm_system(
        folder, robot=robot, law=law, springs=springs, count=n, delays=delays,
        posture=np.array([np.pi / 2, 0.0])[:n],
    )  # fmt: skip


def largest_scale(F, K, D, d, signal):
    """max s with s F ≼ D/d, or with a Schur complement for the springs, by CVXPY."""
    s, n = cp.Variable(), len(K)
    root = np.linalg.cholesky(F)
    if isinstance(signal, StaticJoint):  # (s F)⁻¹ ≽ K⁻¹ + d D⁻¹, s⁻¹ = t minimal
        t = cp.Variable()
        C = np.diag(1.0 / K + d / D)
        problem = cp.Problem(cp.Minimize(t), [t * np.eye(n) - root.T @ C @ root >> 0])
        problem.solve(solver=cp.CLARABEL)
        return 1.0 / float(t.value)
    limits = [np.diag(D) / d - s * F >> 0]
    if isinstance(signal, Tank):
        limits.append(np.diag(K) - s * F >> 0)
    cp.Problem(cp.Maximize(s), limits).solve(solver=cp.CLARABEL)
    return float(s.value)


@pytest.mark.parametrize("seed", PLANTS)
def test_the_largest_stiffness_is_that_of_an_independent_program(tmp_path, seed):
    system = random_arm(tmp_path, seed)
    tuned = tune(system)
    drives, law = system.actuators, system.law
    F = np.asarray(law.tasks[0].stiffness)
    K, D, d = drives.spring_stiffness, drives.motor_damping, system.delays.d_1
    expected = largest_scale(F, K, D, d, law.signal)
    assert tuned.limit == pytest.approx(expected, rel=1e-5)
    assert tuned.found
    if tuned.binding.kind != "stability":
        assert tuned.scale == pytest.approx(expected, rel=1e-5)
    else:  # a tank moves its law's matrices beside K
        assert isinstance(law.signal, Tank)
    assert tuned.scale <= expected
    assert tuned.certificate.answer.status is Status.CERTIFIED
    stiffer = replace(
        law.tasks[0], stiffness=1.001 * np.asarray(tuned.system.law.tasks[0].stiffness)
    )
    beyond = sealag.certify(replace(system, law=replace(law, tasks=(stiffer,))))
    assert beyond.answer.status is not Status.CERTIFIED


@pytest.mark.parametrize(
    ("signal", "k_max"),
    [
        (StaticJoint(), lambda K, D, d: 1.0 / (1.0 / K + d / D)),
        (MotorAngles(), lambda K, D, d: D / d),
        (Tank(), lambda K, D, d: min(D / d, K)),
    ],
    ids=["series", "motor", "tank"],
)
@pytest.mark.parametrize("way", [1e-4, 2e-3, 0.1])
def test_one_joint_in_closed_form(tmp_path, signal, k_max, way):
    robot = arm_system(tmp_path, count=1).robot
    law = Law(
        tasks=(joint_task(robot, 7.0),), stiffness_form="force", signal=signal, gravity="planned"
    )
    delays = constant_delays(way, way, sample_time=1e-4)
    system = arm_system(
        tmp_path, robot=robot, law=law, count=1, delays=delays, posture=np.array([np.pi / 2])
    )
    tuned, d = tune(system), system.delays.d_1
    assert 7.0 * tuned.limit == pytest.approx(k_max(300.0, 12.0, d), rel=1e-9)


def test_without_delay_the_spring_is_the_limit(tmp_path):
    """K_q ≺ K: the classical bound of elastic joints."""
    robot = arm_system(tmp_path, count=1).robot
    law = Law(
        tasks=(joint_task(robot, 7.0),), stiffness_form="force", signal=StaticJoint(),
        gravity="planned",
    )  # fmt: skip
    delays = constant_delays(0.0, 0.0, sample_time=1e-5)
    system = arm_system(
        tmp_path, robot=robot, law=law, count=1, delays=delays, posture=np.array([np.pi / 2])
    )
    tuned = tune(system)
    assert 7.0 * tuned.limit == pytest.approx(300.0, rel=1e-3)
    assert 7.0 * tuned.limit < 300.0
    assert tuned.found
    assert tuned.binding.kind == "spring"
    assert tuned.binding.spring_share > 0.99


def delayed_stiffness(system):
    """F of the certified criterion in the posture, n x n."""
    F = system.spaces().F_theta[0]
    return (F + F.T) / 2.0


@pytest.mark.parametrize("name", ["anymal", "baxter", "talos", "go2", "anymal_crawl"])
def test_the_least_damping_is_proven_by_its_dual(name):
    """max d tr(F X) with X_ii = 1, X ≽ 0 is the least trace of D ≽ d F: no gap, no better D."""
    system = sealag.load(EXAMPLES / f"{name}.toml")
    F, n = delayed_stiffness(system), system.robot.n
    X = cp.Variable((n, n), PSD=True)
    size = np.abs(F).max()
    dual = cp.Problem(cp.Maximize(cp.trace(F / size @ X)), [cp.diag(X) == 1])
    dual.solve(solver=cp.CLARABEL)
    least = system.delays.d_1 * size * float(dual.value)
    tuned = tune(system, aim="damping")
    assert tuned.limit == pytest.approx(least, rel=1e-5)
    assert tuned.found
    assert tuned.system.actuators.motor_damping.sum() == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("name", ["anymal", "baxter", "talos", "go2", "anymal_crawl"])
def test_examples_sit_on_their_boundary(name):
    system = sealag.load(EXAMPLES / f"{name}.toml")
    tuned = tune(system)
    spaces, drives = system.spaces(), system.actuators
    K, D, d = drives.spring_stiffness, drives.motor_damping, system.delays.d_1
    L = D / d if system.law.signal.name == "motor" else 1.0 / (1.0 / K + d / D)
    F_t, F_g = spaces.F_task[0], spaces.F_gravity[0]
    s = cp.Variable()
    size = L.max()
    room = (np.diag(L) + (F_g + F_g.T) / 2.0) / size
    limit = [room - s * (F_t + F_t.T) / 2.0 / size >> 0]
    tight = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
    cp.Problem(cp.Maximize(s), limit).solve(solver=cp.CLARABEL, **tight)
    assert tuned.limit == pytest.approx(float(s.value), rel=1e-5)
    assert tuned.certificate.answer.status is Status.CERTIFIED
    tasks = tuple(
        replace(task, stiffness=1.001 * np.asarray(task.stiffness))
        for task in tuned.system.law.tasks
    )
    beyond = replace(tuned.system, law=replace(tuned.system.law, tasks=tasks))
    assert sealag.certify(beyond).answer.status is Status.NOT_CERTIFIED


def test_factors_of_each_task_are_the_fairest():
    """At the maximum of Σ log f under Σ f A ≼ I there is X ≽ 0 with f_g tr(X A_g) = 1 for all."""
    system = sealag.load(EXAMPLES / "anymal.toml")
    common, apart = tune(system), tune(system, share="task")
    assert set(apart.factors) == {"centre of mass", "base orientation"}
    assert apart.limit > common.limit
    drives, d = system.actuators, system.delays.d_1
    root = np.sqrt(1.0 / drives.spring_stiffness + d / drives.motor_damping)
    A = []
    for name in apart.factors:
        tasks = tuple(
            task if task.name == name else replace(task, stiffness=0.0) for task in system.law.tasks
        )
        alone = replace(system, law=replace(system.law, tasks=tasks))
        A.append(root[:, None] * alone.spaces().F_task[0] * root)
    f = np.array(list(apart.factors.values()))
    X = cp.Variable(A[0].shape, PSD=True)
    slack = np.eye(len(root)) - sum(x * a for x, a in zip(f, A))
    gap = cp.Problem(
        cp.Minimize(cp.trace(slack @ X)), [x * cp.trace(a @ X) == 1 for x, a in zip(f, A)]
    ).solve(solver=cp.CLARABEL)
    assert abs(gap) < 1e-4


@pytest.mark.parametrize("share", ["task", "direction"])
def test_a_shared_limit_is_certified_and_stops_there(share):
    system = sealag.load(EXAMPLES / "anymal.toml")
    tuned = tune(system, share=share)
    assert tuned.found
    assert tuned.reached_s == pytest.approx(system.delays.d_1, rel=1e-5)
    assert tuned.scale is None


def test_safety_and_delay_multiply(tmp_path):
    system = sealag.load(EXAMPLES / "go2.toml")
    one = tune(system, safety=1.2)
    other = tune(system, delay=1.2 * system.delays.d_1)
    assert one.limit == pytest.approx(other.limit, rel=1e-9)
    assert one.limit == pytest.approx(1.05 / (1.2 * 0.007) / 40.0, rel=1e-9)
    assert one.reached_s >= 1.2 * system.delays.d_1


@pytest.mark.parametrize(
    "K_x",
    [np.outer([1.0, -3.3], [1.0, -3.3]), np.diag([30.0, 0.0]), np.outer([0.7, 0.3], [0.7, 0.3])],
    ids=["singular", "a direction without gain", "singular too"],
)
@pytest.mark.parametrize("share", ["common", "task"])
def test_a_singular_matrix_of_gains_stays_one(tmp_path, K_x, share):
    """s K_x ≼ D/d: s = 1/(d kᵀ D⁻¹ k) of K_x = k kᵀ; no rounding makes it indefinite."""
    robot = arm_system(tmp_path).robot
    law = Law(tasks=(joint_task(robot, K_x),), stiffness_form="force", gravity="planned")
    posture = np.array([np.pi / 2, 0.0])
    tuned = tune(arm_system(tmp_path, robot=robot, law=law, posture=posture), share=share)
    d = tuned.question.required
    scale = 1.0 / (d * np.trace(K_x @ np.diag([1.0 / 12.0, 1.0 / 5.0])))
    assert tuned.limit == pytest.approx(scale, rel=1e-9)
    np.testing.assert_allclose(tuned.system.law.tasks[0].stiffness, scale * K_x, rtol=2e-6)
    assert tuned.found
