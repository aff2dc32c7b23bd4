"""Whole-body matrices on real robots: identities, gradients, degenerate contacts."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.designs import EXAMPLES
from sealag.actuation import Actuators
from sealag.design import load
from sealag.robot import Contact, ContactKind, Motion
from sealag.whole_body import (
    GravityCompensation,
    MotorAngles,
    Spaces,
    StaticJoint,
    StiffnessForm,
    Task,
    TaskKind,
)

HUME = load("bundled:hume")
ANYMAL = load(EXAMPLES / "anymal.toml")
BAXTER = load(EXAMPLES / "baxter.toml")
TALOS = load(EXAMPLES / "talos.toml")


def motion_of(system, q, contacts):
    q = np.atleast_2d(q)
    return Motion(
        time=np.arange(len(q)) * 0.1,
        q=q,
        v=np.zeros((len(q), system.robot.nv)),
        contact_sets=(tuple(contacts),),
        contact_index=np.zeros(len(q), dtype=np.int64),
    )


def spaces_of(system, q=None, contacts=None, **changes):
    contacts = system.contacts if contacts is None else contacts
    q = system.posture if q is None else q
    changes = {"signal": MotorAngles(), "gravity": GravityCompensation.NONE, **changes}
    return Spaces.along(
        system.robot,
        replace(system.law, **changes),
        system.actuators,
        motion_of(system, q, contacts),
    )


def near(system, seed, spread=0.2):
    rng = np.random.default_rng(seed)
    v = np.concatenate([np.zeros(system.robot.nv_base), rng.normal(size=system.robot.n) * spread])
    return system.robot.integrate(system.posture, v)


@pytest.mark.parametrize("system", [HUME, ANYMAL, BAXTER, TALOS], ids=lambda s: s.name)
def test_jacobian_is_the_motion_that_contacts_allow(system):
    """J* q̇_j = J_t v for every v that the contacts allow and that has these joint rates."""
    robot, q = system.robot, near(system, 1)
    spaces = spaces_of(system, q)
    J_s = robot.contact_jacobian(system.contacts, q)
    M = robot.mass_matrix(q)
    Mi = np.linalg.inv(M)
    N_s = np.eye(robot.nv)
    if len(J_s):
        N_s = N_s - Mi @ J_s.T @ np.linalg.pinv(J_s @ Mi @ J_s.T) @ J_s
    UN = N_s[robot.nv_base :]
    bar = Mi @ UN.T @ np.linalg.pinv(UN @ Mi @ UN.T, rcond=1e-9)
    rows = [task.rows(robot) for task in system.law.ordered]
    at = robot.workspace_at(q)
    first = np.vstack([row.take(at) for row in rows])[: spaces.levels[1]]
    np.testing.assert_allclose(spaces.J_star[0, : spaces.levels[1]], first @ bar, atol=1e-8)
    np.testing.assert_allclose(N_s @ Mi @ J_s.T, 0.0, atol=1e-9)


@pytest.mark.parametrize("system", [HUME, ANYMAL, BAXTER, TALOS], ids=lambda s: s.name)
def test_symmetric_form_is_symmetric_and_semidefinite_published_is_not(system):
    spaces = spaces_of(system, near(system, 2))
    F = spaces.F_task[0]
    assert spaces.asymmetry[0] < 1e-12
    assert np.linalg.eigvalsh(F)[0] > -1e-9 * np.abs(F).max()
    gains = [Task(name=t.name, kind=t.kind, frame=t.frame, joints=t.joints, priority=t.priority,
                  stiffness=np.geomspace(1.0, 50.0, len(t.rows(system.robot).rows)))
             for t in system.law.tasks]  # fmt: skip
    printed = {"tasks": tuple(gains), "stiffness_form": StiffnessForm.PUBLISHED}
    assert spaces_of(system, near(system, 2), **printed).asymmetry[0] > 1e-4


@pytest.mark.parametrize("system", [BAXTER, ANYMAL], ids=lambda s: s.name)
def test_gravity_gradient_is_symmetric_where_joints_move_everything(system):
    contacts = system.contacts[:2] if system is ANYMAL else ()
    spaces = spaces_of(system, near(system, 3), contacts, gravity=GravityCompensation.FEEDBACK)
    if system is BAXTER:
        expected = system.robot.gravity_gradient(near(system, 3))
        np.testing.assert_allclose(spaces.F_gravity[0], expected, atol=1e-7)
        assert Spaces.relative_asymmetry(spaces.F_gravity)[0] < 1e-9
    else:
        assert Spaces.relative_asymmetry(spaces.F_gravity)[0] > 1e-6, "two feet leave a free motion"


def test_gravity_gradient_on_four_feet_is_symmetric_on_the_motions_left():
    """Twelve joints, six motions: torques that only press the feet apart have no potential."""
    q = near(ANYMAL, 3)
    spaces = spaces_of(ANYMAL, q, gravity=GravityCompensation.FEEDBACK)
    J_s = ANYMAL.robot.contact_jacobian(ANYMAL.contacts, q)
    free = np.linalg.svd(J_s)[2][12:].T[6:]
    basis = np.linalg.qr(free)[0]
    assert basis.shape == (12, 6)
    assert Spaces.relative_asymmetry(basis.T @ spaces.F_gravity[0] @ basis) < 1e-7
    assert Spaces.relative_asymmetry(spaces.F_gravity[0]) > 1e-3


def test_static_feedback_is_stiffer_by_the_springs():
    motor = spaces_of(BAXTER)
    static = spaces_of(BAXTER, signal=StaticJoint())
    K = BAXTER.actuators.spring_stiffness
    F, n = motor.F_theta[0], BAXTER.robot.n
    np.testing.assert_allclose(
        static.F_theta[0] @ (np.eye(n) - F / K[:, None]), F, atol=1e-9 * np.abs(F).max()
    )
    assert np.linalg.eigvalsh(static.F_theta[0] - F)[0] > -1e-9 * np.abs(F).max()


def test_contraction_and_asymmetry_are_those_of_what_is_fed_back():
    """Gravity's gradient is part of the contraction, the springs are part of the asymmetry; no two
    springs are alike."""
    K = BAXTER.actuators.spring_stiffness * np.linspace(1.0, 3.0, BAXTER.robot.n)
    system = replace(BAXTER, actuators=replace(BAXTER.actuators, spring_stiffness=K))
    spaces = spaces_of(
        system,
        signal=StaticJoint(),
        gravity=GravityCompensation.FEEDBACK,
        stiffness_form=StiffnessForm.PUBLISHED,
    )
    root = np.sqrt(K)
    factor = [
        np.linalg.norm(F / np.outer(root, root), 2)
        for F in (spaces.F_task[0] - spaces.F_gravity[0], spaces.F_task[0])
    ]
    assert spaces.contraction[0] == pytest.approx(factor[0], rel=1e-12)
    assert factor[1] != pytest.approx(factor[0], rel=1e-3)
    skew = [
        np.linalg.norm(F - F.T) / np.linalg.norm(F + F.T)
        for F in (spaces.F_theta[0], spaces.F_q[0])
    ]
    assert spaces.asymmetry[0] == pytest.approx(skew[0], rel=1e-12)
    assert skew[1] != pytest.approx(skew[0], rel=1e-3)


def test_static_feedback_without_contraction_has_no_bound():
    """And where the law is exactly as stiff as its springs, no stiffness either."""
    soft = Actuators.of(
        BAXTER.robot.joints, spring_stiffness=5.0, rotor_inertia=0.1, motor_damping=1.0
    )
    law = replace(BAXTER.law, signal=StaticJoint(), gravity=GravityCompensation.NONE)
    for springs, refused in ((soft, True), (BAXTER.actuators, False)):
        system = replace(BAXTER, actuators=springs, law=law)
        spaces = system.spaces()
        assert (spaces.contraction[0] > 1.0) == refused
        assert (system.certified_bounds(spaces).delay[0] == 0.0) == refused
        assert (law.signal.refusal(spaces.contraction) is not None) == refused
    F = spaces_of(BAXTER).F_q
    least = np.linalg.eigvalsh(F[0])[-1]
    assert np.isnan(StaticJoint().motor_stiffness(F, np.full(BAXTER.robot.n, least))).all()
    assert np.isfinite(StaticJoint().motor_stiffness(F, np.full(BAXTER.robot.n, 1.1 * least))).all()


@pytest.mark.parametrize(
    "contacts",
    [
        (),
        (Contact(frame="left_foot"),),
        (Contact(frame="left_foot"), Contact(frame="left_foot")),
        (Contact(frame="left_foot", kind=ContactKind.SURFACE), Contact(frame="right_foot")),
    ],
    ids=["flight", "one foot", "the same foot twice", "surface and point"],
)
def test_degenerate_contacts_stay_finite(contacts):
    straight = HUME.robot.configuration(np.zeros(6), base_position=(0, 0, 0.93))
    for q in (HUME.posture, straight):
        spaces = spaces_of(HUME, q, contacts)
        assert np.isfinite(spaces.F_theta).all()
        assert spaces.asymmetry[0] < 1e-9
    if len(contacts) == 2 and contacts[0] == contacts[1]:
        once = spaces_of(HUME, HUME.posture, contacts[:1])
        np.testing.assert_allclose(
            spaces_of(HUME, HUME.posture, contacts).F_task, once.F_task, atol=1e-7
        )


def test_flight_leaves_no_torque_for_the_centre_of_mass():
    com = (Task(name="c", kind=TaskKind.COM, stiffness=np.array(100.0)),)
    assert np.abs(spaces_of(HUME, contacts=(), tasks=com).F_task).max() < 1e-6
    assert np.abs(spaces_of(HUME, tasks=com).F_task).max() > 10.0


def test_lower_levels_do_not_disturb_higher_ones():
    """Accelerations of level 1 under the torque of level 2 alone are zero."""
    robot, q = BAXTER.robot, near(BAXTER, 4)
    spaces = spaces_of(BAXTER, q)
    top = slice(0, spaces.levels[1])
    low = slice(spaces.levels[1], spaces.levels[2])
    torque = spaces.J_star[0, low].T @ spaces.Lambda[0, low, low] @ np.ones(spaces.levels[2] - 12)
    at = robot.workspace_at(q)
    J = np.vstack([row.take(at) for row in BAXTER.law.rows(robot)])[top]
    acceleration = J @ np.linalg.solve(robot.mass_matrix(q), torque)
    assert np.abs(acceleration).max() < 1e-6 * np.abs(torque).max()


def test_the_starred_inertia_is_that_of_what_the_motors_move():
    """Λ* = (J* φ* J*ᵀ)⁺ in single support, where the motors do not reach all of the task."""
    left = HUME.contacts[:1]
    spaces = spaces_of(HUME, contacts=left, task_inertia="lambda_star", stiffness_form="published")
    plain = spaces_of(HUME, contacts=left, stiffness_form="published")
    robot, q = HUME.robot, HUME.posture
    Mi, J_s = np.linalg.inv(robot.mass_matrix(q)), robot.contact_jacobian(left, q)
    P = Mi - Mi @ J_s.T @ np.linalg.pinv(J_s @ Mi @ J_s.T) @ J_s @ Mi
    phi, J_star = P[robot.nv_base :, robot.nv_base :], spaces.J_star[0, : spaces.levels[1]]
    starred = np.linalg.pinv(J_star @ phi @ J_star.T, rcond=1e-9)
    K = spaces.K_x[: len(J_star), : len(J_star)]
    found = [one.stiffness[0, : len(J_star), : len(J_star)] for one in (spaces, plain)]
    np.testing.assert_allclose(found[0], starred @ K, atol=1e-6 * np.abs(found[0]).max())
    assert np.abs(found[1] - found[0]).max() > 1e-3 * np.abs(found[0]).max()
