"""The least quadratic index within a delay: CVXPY, Riccati and Lyapunov know nothing of it."""

import cvxpy as cp
import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm, arm_system, constant_delays, joint_task
from sealag.errors import InputError
from sealag.passivity import Status
from sealag.tune import tune
from sealag.whole_body import Law, MotorAngles, StaticJoint, Task


def design(folder, signal, *, delay=0.02, posture=20.0):
    """An arm with a hand task and a posture task, or the posture alone."""
    robot = arm(folder)
    hand = Task(name="hand", kind="pose", stiffness=(300.0, 300.0, 50.0), frame="link1",
                axes=(0, 2, 4))  # fmt: skip
    tasks = (hand, joint_task(robot, posture))
    law = Law(tasks=tasks, stiffness_form="force", signal=signal, gravity="planned")
    delays = constant_delays(0.5 * delay, 0.5 * delay - 1e-3, sample_time=1e-3)
    return arm_system(
        folder, robot=robot, law=law, delays=delays, posture=np.array([np.pi / 2, 0.3])
    )


def program(system, error, torque):
    """min ½ tr(Q F_θ⁻¹) + ½ tr(R F_θ) over the gain of each row, by CVXPY: (index, gains)."""
    J = system.spaces().J_star[0]
    drives, d = system.actuators, system.delays.d_1
    K, D = drives.spring_stiffness, drives.motor_damping
    k = cp.Variable(len(J), nonneg=True)
    F = J.T @ cp.diag(k) @ J
    n = len(K)
    W, T = cp.Variable((len(J), len(J)), symmetric=True), cp.Variable((n, n), symmetric=True)
    limits = [cp.bmat([[W, J / error], [J.T / error, F]]) >> 0]
    if isinstance(system.law.signal, StaticJoint):
        series = np.diag(1.0 / (1.0 / K + d / D))
        root = np.diag(np.sqrt(K))  # F_θ = K^½ ((I − A)⁻¹ − I) K^½ ≼ T − K
        A = np.diag(K**-0.5) @ F @ np.diag(K**-0.5)
        limits += [cp.bmat([[T, root], [root, np.eye(n) - A]]) >> 0, series - F >> 0]
        Q = J.T @ J / error**2
        constant = -float(np.trace(Q / K)) - K.sum() / torque**2
    else:
        limits += [T == F, np.diag(D) / d - F >> 0]
        constant = 0.0
    index = 0.5 * (cp.trace(W) + cp.trace(T) / torque**2 + constant)
    problem = cp.Problem(cp.Minimize(index), limits)
    tight = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
    problem.solve(solver=cp.CLARABEL, **tight)
    return float(problem.value), k.value


@pytest.mark.parametrize("signal", [MotorAngles(), StaticJoint()], ids=["motor", "static_joint"])
@pytest.mark.parametrize(("error", "torque"), [(0.01, 40.0), (0.5, 5.0)], ids=["delay", "free"])
def test_the_index_is_that_of_an_independent_program(tmp_path, signal, error, torque):
    system = design(tmp_path, signal)
    limits = {"error": error, "torque": torque}
    tuned = tune(system, aim="optimal", share="direction", limits=limits)
    index, _ = program(system, error, torque)
    assert tuned.index.value == pytest.approx(index, rel=1e-6)
    assert tuned.index.active == (error == 0.01)
    assert tuned.index.least < tuned.index.free <= tuned.index.value * (1.0 + 1e-9)
    assert (tuned.index.value > 1.01 * tuned.index.free) == tuned.index.active
    if tuned.index.active:
        assert tuned.reached_s == pytest.approx(system.delays.d_1, rel=1e-4)
        assert tuned.found
        assert tuned.certificate.answer.status is Status.CERTIFIED
    else:
        assert tuned.reached_s > 1.5 * system.delays.d_1


def lyapunov(system, error, torque):
    """∫ |x̃|²/e² + |τ|²/t² ds of D θ̇ = −F θ from E θθᵀ = D⁻¹: the definition itself."""
    spaces, D = system.spaces(), system.actuators.motor_damping
    F, J = spaces.F_theta[0], spaces.J_star[0]
    A = -F / D[:, None]
    X = solve_continuous_lyapunov(A, -np.diag(1.0 / D))
    return float(np.trace((J.T @ J / error**2 + F.T @ F / torque**2) @ X))


@pytest.mark.parametrize("signal", [MotorAngles(), StaticJoint()], ids=["motor", "static_joint"])
def test_the_index_is_the_integral_and_has_its_minimum_there(tmp_path, signal):
    error, torque = 0.5, 5.0
    system = design(tmp_path, signal)
    limits = {"error": error, "torque": torque}
    tuned = tune(system, aim="optimal", share="task", limits=limits)
    assert lyapunov(tuned.system, error, torque) == pytest.approx(tuned.index.value, rel=1e-6)
    for shares in ((1.05, 1.0), (0.95, 1.0), (1.0, 1.05), (1.0, 0.95)):
        tasks = tuple(
            Task(**{**{name: getattr(one, name) for name in ("name", "kind", "frame", "joints",
                 "axes", "priority")}, "stiffness": share * np.asarray(one.stiffness)})
            for share, one in zip(shares, tuned.system.law.tasks)
        )  # fmt: skip
        law = Law(tasks=tasks, stiffness_form="force", signal=signal, gravity="planned")
        moved = arm_system(
            tmp_path, robot=system.robot, law=law, delays=system.delays, posture=system.posture
        )
        assert lyapunov(moved, error, torque) > tuned.index.value * (1.0 + 1e-6)


def test_where_the_delay_does_not_stop_joint_stiffness_it_is_riccatis(tmp_path):
    """Joints that are their own task: F = I t/e, and no controller of any kind does better."""
    robot = arm(tmp_path)
    law = Law(tasks=(joint_task(robot, 20.0),), stiffness_form="force", gravity="planned")
    system = arm_system(tmp_path, robot=robot, law=law, posture=np.array([np.pi / 2, 0.0]))
    error, torque = 0.5, 6.0
    tuned = tune(
        system, aim="optimal", share="direction", limits={"error": error, "torque": torque}
    )
    D = np.diag(system.actuators.motor_damping)
    B, Q, R = np.linalg.inv(D), np.eye(2) / error**2, np.eye(2) / torque**2
    P = solve_continuous_are(np.zeros((2, 2)), B, Q, R)
    gain = np.linalg.solve(R, B.T @ P)
    assert np.diag(gain) == pytest.approx([torque / error] * 2)
    found = np.asarray(tuned.system.law.tasks[0].stiffness)
    assert found == pytest.approx(np.diag(gain), rel=1e-4)
    assert tuned.index.least == pytest.approx(float(np.trace(P @ B)), rel=1e-9)
    assert tuned.index.free == pytest.approx(tuned.index.least, rel=1e-8)
    assert not tuned.index.active


def test_riccatis_index_lies_below_what_one_gain_for_all_reaches(tmp_path):
    system = design(tmp_path, MotorAngles())
    limits = {"error": 0.5, "torque": 5.0}
    one, each = (
        tune(system, aim="optimal", share=share, limits=limits).index
        for share in ("common", "direction")
    )
    J, D = system.spaces().J_star[0], np.diag(system.actuators.motor_damping)
    B = np.linalg.inv(D)
    P = solve_continuous_are(np.zeros((2, 2)), B, J.T @ J / 0.25, np.eye(2) / 25.0)
    assert one.least == each.least == pytest.approx(float(np.trace(P @ B)), rel=1e-9)
    assert each.least < each.free < one.free


def test_weights_are_asked_for(tmp_path):
    system = design(tmp_path, MotorAngles())
    with pytest.raises(InputError, match=r"--limit error=0.02 --limit torque=30Nm"):
        tune(system, aim="optimal", limits={"error": 0.1})
    with pytest.raises(InputError, match="limit torque is for --aim optimal, not for stiffness"):
        tune(system, limits={"torque": 1.0})
    with pytest.raises(InputError, match="let the number be passive"):
        tune(system, aim="optimal", number="jitter", limits={"error": 0.1, "torque": 1.0})


def test_what_stops_the_optimum_is_what_stops_the_largest_stiffness():
    """With one factor in common and a costly error both are the same gains."""
    anymal = sealag.load(EXAMPLES / "anymal.toml")
    best = tune(anymal, aim="optimal", limits={"error": 0.02, "torque": 30.0})
    most = tune(anymal)
    assert best.binding.kind == most.binding.kind == "spring"
    assert best.binding.spring_share == pytest.approx(most.binding.spring_share, rel=1e-4)
