"""Contact-consistent operational space along a motion: J*, Λ and the fed-back stiffness."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import RobotError
from sealag.robot import Contact, Motion, Robot, Stack, stack_terms
from sealag.typing import Array
from sealag.whole_body._options import TaskError
from sealag.whole_body._tasks import Feedback, GravityCompensation, Hierarchy, TaskInertia

RANK_TOLERANCE = 1e-9
"""A direction counts as lost where contacts, higher tasks or a singular leg leave less than this
fraction of the mobility that it would have without them."""

FORM_CODE = {"symmetric": 0, "published": 1, "force": 2}
_STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeBodyStack:
    """The whole-body controller's matrices at N instants.

    Attributes:
        levels: (k + 1,) first row of each priority level, then m.
        K_x: (m, m) task gains.
        J_star: (N, m, n) contact-consistent Jacobians J*_{i|prec(i)} of Eq. (10).
        Lambda: (N, m, m) task inertias, blocks of the levels on the diagonal.
        stiffness: (N, m, m) S of the form that is run, blocks likewise.
        F_task: (N, n, n) Σ J*ᵀ S J*, joint-side stiffness of the tasks, Nm/rad; with plain task
            errors Σ J*_{k|prec}ᵀ S_k J_k overline(UN_s).
        F_gravity: (N, n, n) ∂ḡ/∂q_j along contact-consistent motions; 0 unless it is fed back.
        F_q: (N, n, n) F_task − F_gravity.
        F_theta: (N, n, n) −∂τ_osc/∂θ for the signal that is fed back.
        contraction: (N,) ‖K^{-½} F_q K^{-½}‖, the contraction factor of q̄(θ).
        asymmetry: (N,) ‖F_θ − F_θᵀ‖ / ‖F_θ + F_θᵀ‖.
        gravity: (N, n) compensation torque ḡ, Nm.
    """

    levels: tuple[int, ...]
    K_x: Array
    J_star: Array
    Lambda: Array
    stiffness: Array
    F_task: Array
    F_gravity: Array
    F_q: Array
    F_theta: Array
    contraction: Array
    asymmetry: Array
    gravity: Array

    def __len__(self) -> int:
        """Return the number of instants."""
        return len(self.J_star)

    def level(self, index: int) -> tuple[Array, Array, Array]:
        """Return J* (N, m_i, n), Λ (N, m_i, m_i) and K_x (m_i, m_i) of a priority level.

        Args:
            index: 0 for the highest priority.
        """
        rows = slice(self.levels[index], self.levels[index + 1])
        return self.J_star[:, rows], self.Lambda[:, rows, rows], self.K_x[rows, rows]


def evaluate(
    robot: Robot,
    hierarchy: Hierarchy,
    actuators: Actuators,
    *,
    motion: Motion,
    feedback: Feedback = Feedback.STATIC_JOINT,
    gravity: GravityCompensation = GravityCompensation.FEEDBACK,
    task_error: TaskError = TaskError.CONSISTENT,
) -> WholeBodyStack:
    """Evaluate the whole-body controller's matrices at every instant of a motion.

    The motor-side stiffness is F_θ = F_q for feedback of motor angles and for the tank,
    F_q (I − K⁻¹F_q)⁻¹ for q̄(θ), and F_q, acting on link angles, for link feedback. Where
    q̄(θ) has no contraction (factor 1 or more) F_θ has no meaning and is NaN.

    Args:
        robot: the robot.
        hierarchy: its tasks.
        actuators: its springs.
        motion: configurations and contacts.
        feedback: the signal that is fed back.
        gravity: where gravity compensation takes its configuration from.
        task_error: which error tasks below the first level feed back.

    Returns:
        Stacked matrices in the motion's order.

    Raises:
        RobotError: a mass matrix is not positive definite.
        UnknownNameError: a frame or joint of a task or contact does not exist.
    """
    n, count = robot.n, len(motion)
    levels = hierarchy.levels(robot)
    m = levels[-1]
    J_star, Lambda, S = (np.zeros((count, m, k)) for k in (n, m, m))
    torque, F_gravity = np.zeros((count, n)), np.zeros((count, n, n))
    moved = J_star if task_error is TaskError.CONSISTENT else np.zeros_like(J_star)
    for index, contacts in enumerate(motion.contact_sets):
        where = np.flatnonzero(motion.contact_index == index)
        if len(where) == 0:
            continue
        q = motion.q[where]
        at = _operational_spaces(robot, hierarchy, q, contacts=contacts)
        J_star[where], Lambda[where], S[where], torque[where] = (
            at.J_star, at.Lambda, at.stiffness, at.gravity,
        )  # fmt: skip
        if task_error is TaskError.PLAIN:
            moved[where] = at.J_t @ at.along
        if gravity is GravityCompensation.FEEDBACK:
            F_gravity[where] = _gravity_gradient(robot, q, contacts, directions=at.along)
    F_task = J_star.transpose(0, 2, 1) @ S @ moved
    F_q = F_task - F_gravity
    root = np.sqrt(actuators.spring_stiffness)
    contraction = np.linalg.norm(F_q / root[:, None] / root[None, :], ord=2, axis=(1, 2))
    F_theta = _motor_side(F_q, actuators.spring_stiffness, contraction, feedback=feedback)
    return WholeBodyStack(
        levels=tuple(levels),
        K_x=hierarchy.gain(robot),
        J_star=J_star,
        Lambda=Lambda,
        stiffness=S,
        F_task=F_task,
        F_gravity=F_gravity,
        F_q=F_q,
        F_theta=F_theta,
        contraction=contraction,
        asymmetry=relative_asymmetry(F_theta),
        gravity=torque,
    )


def relative_asymmetry(F: Array) -> Array:
    """Return ‖F − Fᵀ‖ / ‖F + Fᵀ‖ (Frobenius), 0 for F = 0.

    Args:
        F: (…, n, n).
    """
    skew = np.linalg.norm(F - np.swapaxes(F, -1, -2), axis=(-2, -1))
    even = np.linalg.norm(F + np.swapaxes(F, -1, -2), axis=(-2, -1))
    return np.divide(skew, even, out=np.where(skew == 0.0, 0.0, np.inf), where=even > 0.0)


def _motor_side(F_q: Array, K: Array, contraction: Array, *, feedback: Feedback) -> Array:
    """F_θ = F_q (I − K⁻¹F_q)⁻¹ where q̄(θ) is fed back, else F_q."""
    if feedback is not Feedback.STATIC_JOINT:
        return F_q
    F_theta = np.full_like(F_q, np.nan)
    good = contraction < 1.0
    loop = np.eye(len(K)) - F_q[good] / K[:, None]
    F_theta[good] = np.linalg.solve(loop.transpose(0, 2, 1), F_q[good].transpose(0, 2, 1))
    return F_theta.transpose(0, 2, 1)


class _Spaces(NamedTuple):
    """Operational spaces at N configurations with the same contacts."""

    J_star: Array  # (N, m, n)
    Lambda: Array  # (N, m, m)
    stiffness: Array  # (N, m, m)
    along: Array  # (N, nv, n) overline(UN_s)
    gravity: Array  # (N, n)
    lift: Array  # (N, m, nv) rows of Λ_k J_k P_k
    J_t: Array  # (N, m, nv)


def _operational_spaces(
    robot: Robot, hierarchy: Hierarchy, q: Array, *, contacts: Sequence[Contact]
) -> _Spaces:
    stack = stack_terms(robot, q, contacts, rows=hierarchy.rows(robot))
    return _solved(
        robot,
        stack,
        gain=hierarchy.gain(robot),
        levels=hierarchy.levels(robot),
        form=FORM_CODE[hierarchy.form],
        star=hierarchy.task_inertia is TaskInertia.LAMBDA_STAR,
    )


def _solved(
    robot: Robot, stack: Stack, *, gain: Array, levels: list[int], form: int, star: bool
) -> _Spaces:
    from sealag.kernels.operational_space import allocate, operational_spaces

    count, c, nv = stack.J_s.shape
    m, n = stack.J_t.shape[1], robot.n
    shapes = ((m, n), (m, m), (m, m), (nv, n), (n,), (m, nv))
    out = tuple(np.zeros((count, *shape)) for shape in shapes)
    bad = operational_spaces(
        stack.M,
        stack.g,
        stack.J_s,
        stack.J_t,
        gain,
        np.array(levels),
        form,
        star,
        RANK_TOLERANCE,
        allocate(nv, n, c, m=m),
        out,
    )
    if bad >= 0:
        raise RobotError(
            f"The mass matrix of {robot.name} is not positive definite; "
            "a link that moves has no mass or no inertia."
        )
    return _Spaces._make([*out, stack.J_t])


def passive_stiffness(
    robot: Robot,
    hierarchy: Hierarchy,
    actuators: Actuators,
    *,
    q: Array,
    contacts: Sequence[Contact],
    feedback: Feedback,
    gravity: GravityCompensation,
    task_error: TaskError = TaskError.CONSISTENT,
) -> Array:
    """Return −∂τ_osc/∂q at fixed motor (or link) angles along what contacts leave free, (n, nv).

    Where contacts and joints do not determine each other, as on a point foot, x depends on
    passive motions of the base besides θ: δx = J* δθ + E (I − overline(UN_s) U) δq with the task
    errors' Jacobian E. F_θ says nothing of them; the exact margin must. 0 where joints determine
    all motions, and for the tank, whose x̂ moves with J* θ̇ alone.

    Args:
        robot: the robot.
        hierarchy: its tasks.
        actuators: its springs.
        q: (nq,) configuration.
        contacts: which frames are held.
        feedback: the signal that is fed back.
        gravity: where gravity compensation takes its configuration from.
        task_error: which error tasks below the first level feed back.

    Raises:
        RobotError: the mass matrix is not positive definite.
    """
    n, nv = robot.n, robot.nv
    if feedback is Feedback.STATIC_JOINT_TANK:
        return np.zeros((n, nv))
    at = _operational_spaces(robot, hierarchy, q[None], contacts=contacts)
    free = np.eye(nv)
    if len(J_s := robot.contact_jacobian(contacts, q)):
        free -= np.linalg.pinv(J_s, rcond=RANK_TOLERANCE) @ J_s
    passive = free - at.along[0] @ free[nv - n :]
    J, S, E = at.J_star[0], at.stiffness[0], at.J_t[0].copy()
    levels = hierarchy.levels(robot)
    if task_error is TaskError.CONSISTENT:
        for first, last in itertools.pairwise(levels[1:]):
            E[first:last] -= at.J_t[0, first:last] @ at.lift[0, :first].T @ E[:first]
    F = J.T @ S @ E @ passive
    if gravity is GravityCompensation.FEEDBACK:
        basis, sizes, _ = np.linalg.svd(passive)
        basis = basis[:, sizes > 1e-9]
        slope = _gravity_gradient(robot, q[None], contacts, directions=basis[None])[0]
        F -= slope @ basis.T @ passive
    if feedback is Feedback.STATIC_JOINT:
        stack = J.T @ S @ E @ at.along[0]
        if gravity is GravityCompensation.FEEDBACK:
            stack -= _gravity_gradient(robot, q[None], contacts, directions=at.along)[0]
        F = np.linalg.solve(np.eye(n) - stack / actuators.spring_stiffness, F)
    return F


def _gravity_gradient(
    robot: Robot, q: Array, contacts: Sequence[Contact], *, directions: Array
) -> Array:
    """∂ḡ/∂q along the columns of directions (N, nv, p), by central differences of ḡ: (N, n, p)."""
    count, n, p = len(q), robot.n, directions.shape[2]
    ahead = np.empty((p, 2, count, robot.nq))
    for k in range(count):
        for j in range(p):
            step = _STEP * directions[k, :, j]
            ahead[j, 0, k] = robot.integrate(q[k], step)
            ahead[j, 1, k] = robot.integrate(q[k], -step)
    stack = stack_terms(robot, ahead.reshape(-1, robot.nq), contacts, rows=())
    space = _solved(robot, stack, gain=np.zeros((0, 0)), levels=[0], form=0, star=False)
    torques = space.gravity.reshape(p, 2, count, n)
    return ((torques[:, 0] - torques[:, 1]) / (2.0 * _STEP)).transpose(1, 2, 0)
