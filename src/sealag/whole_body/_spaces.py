"""Contact-consistent operational space along a motion: J*, Λ and the fed-back stiffness."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import RobotError
from sealag.kernels import keep
from sealag.robot import Contact, Motion, Robot
from sealag.typing import Array, BoolArray
from sealag.whole_body._law import Law
from sealag.whole_body._signals import static_contraction
from sealag.whole_body._stack import Stack, stack_terms
from sealag.whole_body._tasks import (
    FORM_CODE,
    RANK_TOLERANCE,
    GravityCompensation,
    TaskError,
    TaskInertia,
)

_STEP = 1e-5  # rad: half the base of central differences of gravity compensation
_BESIDE = 1e-3
"""rad: distance of the neighbouring configurations whose ranks are compared. Ten times larger
leaves the posture's neighbourhood; ten times smaller comes near the 3e-5 rad over which
RANK_TOLERANCE drops a direction."""

_EMPTY = 1e-13
"""Share of Λ's largest eigenvalue below which one belongs to a dropped direction: kept ones lie
above RANK_TOLERANCE, dropped ones are rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spaces:
    """The whole-body controller's matrices at N instants.

    Attributes:
        levels: (k + 1,) first row of each priority level, then m.
        K_x: (m, m) task gains, without the motion's own factor.
        J_star: (N, m, n) contact-consistent Jacobians J*_{i|prec(i)} of Eq. (10).
        Lambda: (N, m, m) task inertias, blocks of the levels on the diagonal.
        stiffness: (N, m, m) S of the form that is run, blocks likewise.
        F_task: (N, n, n) Σ J*ᵀ S J*, joint-side stiffness of the tasks, Nm/rad; with plain task
            errors Σ J*_{k|prec}ᵀ S_k J_k overline(UN_s).
        F_gravity: (N, n, n) ∂ḡ/∂q_j along contact-consistent motions; 0 unless it is fed back.
        F_q: (N, n, n) F_task − F_gravity.
        F_theta: (N, n, n) −∂τ_osc/∂θ of the signal, with J* and S frozen.
        contraction: (N,) ‖K^{-½} F_q K^{-½}‖, the contraction factor of q̄(θ).
        asymmetry: (N,) ‖F_θ − F_θᵀ‖ / ‖F_θ + F_θᵀ‖.
        gravity: (N, n) compensation torque ḡ, Nm.
        singular: (N,) whether J_s or J* has a lower rank there than at neighbouring configurations,
            so that F jumps.
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
    singular: BoolArray

    def __len__(self) -> int:
        """Return the number of instants."""
        return len(self.J_star)

    def at(self, instants: Sequence[int]) -> "Spaces":
        """Return the matrices at some of the instants.

        Args:
            instants: which.
        """
        along = {
            name: getattr(self, name)[list(instants)]
            for name in self.__dataclass_fields__
            if name not in ("levels", "K_x")
        }
        return replace(self, **along)

    def level(self, index: int) -> tuple[Array, Array, Array]:
        """Return J* (N, m_i, n), Λ (N, m_i, m_i) and K_x (m_i, m_i) of a priority level.

        Args:
            index: 0 for the highest priority.
        """
        rows = slice(self.levels[index], self.levels[index + 1])
        return self.J_star[:, rows], self.Lambda[:, rows, rows], self.K_x[rows, rows]

    @staticmethod
    def relative_asymmetry(F: Array) -> Array:
        """Return ‖F − Fᵀ‖ / ‖F + Fᵀ‖ (Frobenius), 0 for F = 0.

        Args:
            F: (…, n, n).
        """
        skew = np.linalg.norm(F - np.swapaxes(F, -1, -2), axis=(-2, -1))
        even = np.linalg.norm(F + np.swapaxes(F, -1, -2), axis=(-2, -1))
        return np.divide(skew, even, out=np.where(skew == 0.0, 0.0, np.inf), where=even > 0.0)

    @classmethod
    def along(cls, robot: Robot, law: Law, actuators: Actuators, motion: Motion) -> "Spaces":
        """Evaluate the law's matrices at every instant of a motion.

        Args:
            robot: the robot.
            law: the law.
            actuators: its springs.
            motion: configurations and contacts.

        Returns:
            Stacked matrices in the motion's order.

        Raises:
            RobotError: a mass matrix is not positive definite.
            UnknownNameError: a frame or joint of a task or contact does not exist.
        """
        n, count = robot.n, len(motion)
        levels = law.levels(robot)
        m = levels[-1]
        J_star, Lambda, S = (np.zeros((count, m, k)) for k in (n, m, m))
        torque, F_gravity = np.zeros((count, n)), np.zeros((count, n, n))
        singular = np.zeros(count, dtype=bool)
        moved = J_star if law.task_error is TaskError.CONSISTENT else np.zeros_like(J_star)
        for index, contacts in enumerate(motion.contact_sets):
            where = np.flatnonzero(motion.contact_index == index)
            if len(where) == 0:
                continue
            q = motion.q[where]
            at = _spaces_at(robot, law, q, contacts=contacts)
            J_star[where], Lambda[where], S[where], torque[where] = (
                at.J_star, at.Lambda, at.stiffness, at.gravity,
            )  # fmt: skip
            singular[where] = _singular(robot, law, q, at, contacts=contacts, levels=levels)
            if law.task_error is TaskError.PLAIN:
                moved[where] = at.J_t @ at.along
            if law.gravity is GravityCompensation.FEEDBACK:
                F_gravity[where] = _gravity_gradient(robot, q, contacts, directions=at.along)
        if motion.stiffness is not None:
            S *= motion.stiffness[:, None, None]
        K = actuators.spring_stiffness
        F_task = J_star.transpose(0, 2, 1) @ S @ moved
        F_q = F_task - F_gravity
        F_theta = law.signal.motor_stiffness(F_q, K)
        return Spaces(
            levels=tuple(levels),
            K_x=law.gain(robot),
            J_star=J_star,
            Lambda=Lambda,
            stiffness=S,
            F_task=F_task,
            F_gravity=F_gravity,
            F_q=F_q,
            F_theta=F_theta,
            contraction=static_contraction(F_q, K),
            asymmetry=Spaces.relative_asymmetry(F_theta),
            gravity=torque,
            singular=singular,
        )


class _SpacesAt(NamedTuple):
    """Operational spaces at N configurations with the same contacts."""

    J_star: Array  # (N, m, n)
    Lambda: Array  # (N, m, m)
    stiffness: Array  # (N, m, m)
    along: Array  # (N, nv, n) overline(UN_s)
    gravity: Array  # (N, n)
    J_t: Array  # (N, m, nv)


def _spaces_at(robot: Robot, law: Law, q: Array, *, contacts: Sequence[Contact]) -> _SpacesAt:
    stack = stack_terms(robot, q, contacts, rows=law.rows(robot))
    return _solved(
        robot,
        stack,
        gain=law.gain(robot),
        levels=law.levels(robot),
        form=FORM_CODE[law.stiffness_form],
        star=law.task_inertia is TaskInertia.LAMBDA_STAR,
    )


def _solved(
    robot: Robot, stack: Stack, *, gain: Array, levels: list[int], form: int, star: bool
) -> _SpacesAt:
    from sealag.kernels import operational_space as kernel

    count, _, nv = stack.J_s.shape
    m, n = stack.J_t.shape[1], robot.n
    shapes = ((m, n), (m, m), (m, m), (nv, n), (n,), (m, nv))
    out = kernel.StackedSpaces(*(np.zeros((count, *shape)) for shape in shapes))
    spaces = kernel.Stack(
        terms=kernel.StackedTerms(M=stack.M, g=stack.g, J_s=stack.J_s, J_t=stack.J_t), K_x=gain,
        levels=np.array(levels), form=form, star=star, tolerance=RANK_TOLERANCE, out=out,
        space=kernel.allocate(nv, n, stack.J_s.shape[1], m=m),
    )  # fmt: skip
    if kernel.operational_spaces(keep(spaces)) >= 0:
        raise RobotError(
            f"The mass matrix of {robot.name} is not positive definite; "
            "a link that moves has no mass or no inertia."
        )
    return _SpacesAt(
        J_star=out.J_star, Lambda=out.Lambda, stiffness=out.stiffness, along=out.along,
        gravity=out.gravity, J_t=stack.J_t,
    )  # fmt: skip


def _singular(
    robot: Robot,
    law: Law,
    q: Array,
    at: _SpacesAt,
    *,
    contacts: Sequence[Contact],
    levels: list[int],
) -> BoolArray:
    """Whether ranks at configurations (N, nq) are lower than at neighbouring ones.

    Neighbours lie along two random contact-consistent motions: almost all configurations of a
    family have the full rank, so that any of them shows a loss.
    """
    lost = np.zeros(len(q), dtype=bool)
    here = _ranks(robot, at, levels)
    for seed in (1, 2):
        way = np.random.default_rng(seed).normal(size=robot.n)
        steps = at.along @ (_BESIDE * way / np.linalg.norm(way))
        aside = np.stack([robot.integrate(a, b) for a, b in zip(q, steps)])
        there = _spaces_at(robot, law, aside, contacts=contacts)
        lost |= (here < _ranks(robot, there, levels)).any(axis=1)
    return lost


def _ranks(robot: Robot, at: _SpacesAt, levels: list[int]) -> Array:
    """Ranks of the free joint motions and of each level's Λ, (N, 1 + levels)."""
    joints = np.trace(at.along[:, robot.nv_base :], axis1=1, axis2=2)
    columns = [np.round(joints)]
    for first, last in itertools.pairwise(levels):
        values = np.linalg.eigvalsh(at.Lambda[:, first:last, first:last])
        columns.append((values > _EMPTY * values[:, -1:]).sum(axis=1))
    return np.stack(columns, axis=1)


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
