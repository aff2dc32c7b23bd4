"""The compiled parts of a controller's tick against plain NumPy and SciPy twins."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.kernels import from_python, newton_of, solve_space, space_of
from sealag.kernels import control_law, task_error
from sealag.kernels.operational_space import SYMMETRIC
from sealag.robot import Contact, load_robot
from sealag.whole_body import GravityCompensation, Law, Task, TaskKind
from sealag.whole_body._evaluation import LawEvaluation

frame_error = from_python(task_error.frame_error)
gravity_slope = from_python(control_law.gravity_slope)
leave_to_higher = task_error.leave_to_higher
static_step = from_python(control_law.static_step)
CONTACTS = (Contact(frame="left_foot"), Contact(frame="right_foot"))
GAINS = np.array([100.0, 120.0, 90.0, 60.0, 50.0, 40.0, 30.0])
LEVELS = np.array([0, 6, 7])
WANTED = SimpleNamespace()


def turned(axis, angle):
    return Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis)).as_matrix()


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 2.0, 3.0, 3.1, np.pi - 1e-7, np.pi])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, -2, 3), (-1, 1, 0)])
def test_frame_error_is_the_rotation_vector_up_to_half_a_turn(axis, angle):
    R = turned((0.3, 0.2, -0.5), 1.1)
    wanted, out = turned(axis, angle) @ R, np.zeros(6)
    frame_error(wanted, np.array([1.0, 2.0, 3.0]), R, np.ones(3), out)
    np.testing.assert_allclose(out[:3], [0.0, 1.0, 2.0], atol=1e-15)
    back = Rotation.from_rotvec(out[3:]).as_matrix()
    np.testing.assert_allclose(back @ R, wanted, atol=2e-8 if angle > 3.0 else 1e-12)
    expected = angle * np.asarray(axis) / np.linalg.norm(axis)
    if angle < np.pi:
        np.testing.assert_allclose(out[3:], expected, atol=2e-8)
    assert np.linalg.norm(out[3:]) == pytest.approx(angle, abs=2e-8)


def plain_leave(J, M_inverse, levels, error):
    """x̃_{k|prec} with projectors written out."""
    out, P = error.copy(), M_inverse.copy()
    motion = np.zeros(len(M_inverse))
    for first, last in itertools.pairwise(levels):
        J_k = J[first:last]
        out[first:last] -= J_k @ motion
        Lambda = np.linalg.pinv(J_k @ P @ J_k.T, rcond=1e-8, hermitian=True)
        motion += P @ J_k.T @ Lambda @ out[first:last]
        P = P - P @ J_k.T @ Lambda @ J_k @ P
    return out


@pytest.mark.parametrize("levels", [[0, 6], [0, 3, 6], [0, 2, 5, 8], [0, 6, 14]])
def test_errors_of_lower_tasks_move_as_their_own_jacobian_says(levels):
    rng = np.random.default_rng(len(levels))
    nv, m = 9, levels[-1]
    X = rng.normal(size=(nv, nv))
    M, J = X @ X.T + np.eye(nv), rng.normal(size=(m, nv))
    space = space_of(nv, nv, 0, m=m)
    assert solve_space(
        M, np.zeros(nv), np.zeros((0, nv)), J, np.eye(m), np.array(levels), SYMMETRIC, False, 1e-9,
        space,
    )  # fmt: skip
    error = rng.normal(size=m)
    out = error.copy()
    leave_to_higher(J, space.lift, np.array(levels), out, np.zeros(nv))
    np.testing.assert_allclose(out, plain_leave(J, np.linalg.inv(M), levels, error), atol=1e-8)
    moved = J.copy()
    for column in moved.T:
        part = column.copy()
        leave_to_higher(J, space.lift, np.array(levels), part, np.zeros(nv))
        column[:] = part
    np.testing.assert_allclose(moved, space.J_star, atol=1e-8)
    if len(levels) > 2:
        assert np.abs(J - space.J_star).max() > 0.1


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("slope", [0.0, 1.0])
@pytest.mark.parametrize("symmetric", [True, False])
def test_static_step_is_newton_s(symmetric, slope, plain):
    """l(q̄) = J*ᵀ S x̃ + ḡ has the gradient −J*ᵀ S J + ∂ḡ/∂q, −J the errors' Jacobian."""
    rng = np.random.default_rng(8)
    m, n = 4, 6
    J, X = rng.normal(size=(m, n)), rng.normal(size=(m, m))
    S = X @ X.T if symmetric else X @ X.T + 0.3 * (X - X.T)
    moved_by = J + 0.3 * rng.normal(size=(m, n)) if plain else J
    F, G = J.T @ S @ moved_by, slope * 5.0 * rng.normal(size=(n, n))
    K = 1.5 * np.linalg.norm(F - G, 2) * rng.uniform(1.0, 2.0, n)
    torque, sag = rng.normal(size=n), rng.normal(size=n)
    moved, newton = sag.copy(), newton_of(n, n, m, slope=G, J=moved_by)
    assert static_step(J, S, K, torque, moved, newton)
    step = newton.step
    expected = np.linalg.solve(np.diag(K) - F + G, -K * sag - torque)
    np.testing.assert_allclose(step, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(moved, sag + expected, rtol=1e-9)
    if slope:
        without = np.linalg.solve(np.diag(K) - F, -K * sag - torque)
        assert np.abs(step - without).max() > 1e-3 * np.abs(step).max()
    if plain:
        wrong = np.linalg.solve(np.diag(K) - J.T @ S @ J + G, -K * sag - torque)
        assert np.abs(step - wrong).max() > 1e-3 * np.abs(step).max()


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("of", ["tasks", "gravity"])
def test_static_step_refuses_exactly_where_the_fixed_point_is_no_contraction(seed, of):
    """The largest eigenvalue of K^-½ (J*ᵀ S J* − ∂ḡ/∂q) K^-½ decides, whichever part it is of."""
    rng = np.random.default_rng(seed)
    J, X, K = rng.normal(size=(3, 5)), rng.normal(size=(3, 3)), rng.uniform(1.0, 9.0, 5)
    S, root = X @ X.T, np.sqrt(K)
    F = J.T @ S @ J
    factor = np.linalg.norm(F / np.outer(root, root), 2)
    for share in (0.999, 1.001):
        scaled = share / factor
        task, slope = (S * scaled, 0.0 * F) if of == "tasks" else (0.0 * S, -F * scaled)
        newton = newton_of(5, 5, 3, slope=slope, J=J)
        exists = static_step(J, task, K, np.zeros(5), np.zeros(5), newton)
        assert exists == (share < 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_gravity_slope_is_that_of_the_potential_along_given_motions(seed):
    """The symmetric part of ∂(Wᵀ g)/∂q W with W frozen, by central differences of g."""
    robot, rng = load_robot("bundled:hume.urdf", floating_base=True), np.random.default_rng(seed)
    posture = robot.configuration(0.3 * rng.normal(size=6))
    q, W = robot.integrate(posture, 0.4 * rng.normal(size=12)), rng.normal(size=(12, 6))
    at = robot.workspace()
    at.update(q, np.zeros(12))
    newton = newton_of(12, 6, 0, slope=np.full((6, 6), np.nan))
    out = newton.slope
    gravity_slope(robot.tree, at.terms, W, newton)

    def force(step):
        return W.T @ robot.gravity(robot.integrate(q, step))

    h = 1e-5
    expected = np.stack([(force(h * w) - force(-h * w)) / (2.0 * h) for w in W.T], axis=1)
    expected = (expected + expected.T) / 2.0
    np.testing.assert_allclose(out, expected, atol=1e-6 * np.abs(expected).max())
    there = robot.integrate(q, 0.1 * rng.normal(size=12))
    at.update(there, np.zeros(12))
    gravity_slope(robot.tree, at.terms, W, newton)
    assert np.abs(out - expected).max() > 1e-2 * np.abs(expected).max(), "it must depend on q"


def plain_law(robot, q, joints, along, offset):
    """J*ᵀ S x̃ + g of CoM, torso orientation and one joint, at the moved configuration."""
    there = robot.integrate(q, along @ (joints - q[-6:]))
    J_s = robot.contact_jacobian(CONTACTS, there)
    turn = robot.frame_jacobian("torso", there)[3:]
    J_t = np.vstack([robot.com_jacobian(there), turn, np.eye(12)[[8]]])
    space, m = space_of(12, 6, 6, m=7), 7
    assert solve_space(
        robot.mass_matrix(there), robot.gravity(there), J_s, J_t, np.diag(GAINS), LEVELS, SYMMETRIC,
        False, 1e-9, space,
    )  # fmt: skip
    error = np.zeros(m)
    error[:3] = WANTED.com - robot.center_of_mass(there)
    turned_by = WANTED.rotation @ robot.frame_placement("torso", there)[0].T
    error[3:6] = Rotation.from_matrix(turned_by).as_rotvec()
    error[6] = WANTED.joint - there[-4]
    error += offset
    leave_to_higher(J_t, space.lift, LEVELS, error, np.zeros(12))
    return space.J_star.T @ space.stiffness @ error + space.gravity, error


def test_law_is_its_parts_one_after_the_other():
    """The whole tick in one call equals frames, tasks, space and torque taken one by one."""
    robot, rng = load_robot("bundled:hume.urdf", floating_base=True), np.random.default_rng(4)
    posture = robot.configuration(np.deg2rad([2, -25, 55, -1, -30, 50]))
    WANTED.com, WANTED.joint = robot.center_of_mass(posture), posture[-4]
    WANTED.rotation = robot.frame_placement("torso", posture)[0]
    chosen = Law(
        tasks=(
            Task(name="com", kind=TaskKind.COM, stiffness=GAINS[:3]),
            Task(name="turn", kind=TaskKind.ORIENTATION, frame="torso", stiffness=GAINS[3:6]),
            Task(
                name="knee", kind=TaskKind.POSTURE, joints=(robot.joints[2],), priority=2,
                stiffness=GAINS[6:],
            ),
        )
    )  # fmt: skip
    chosen = replace(chosen, gravity=GravityCompensation.FEEDBACK)
    law = LawEvaluation(robot, chosen, np.ones(6), contacts=CONTACTS, posture=posture)
    q, law.offset[:] = (
        robot.integrate(posture, 0.05 * rng.normal(size=12)),
        0.01 * rng.normal(size=7),
    )
    joints, out = q[-6:] + 0.02 * rng.normal(size=6), np.zeros(6)
    law.follow(posture)
    along = law.space.joint_from_base.copy()
    law.at(q, joints, out)
    torque, left = plain_law(robot, q, joints, along, law.offset)
    np.testing.assert_allclose(law.error, left, atol=1e-11)
    np.testing.assert_allclose(out, torque, rtol=1e-9, atol=1e-9)
