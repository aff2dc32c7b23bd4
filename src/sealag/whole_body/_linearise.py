"""The frozen closed loop at one configuration, contacts eliminated, for its exact delay margin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sealag.actuation import Actuators
from sealag.robot import Contact, Robot, Workspace
from sealag.typing import Array
from sealag.whole_body._tasks import Feedback

_STEP = 1e-5
_LOST = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearisation:
    """ẋ = A_0 x + A_1 x(t − d) about one configuration, x = [z, θ, ż, θ̇].

    z are coordinates along the motions that the contacts leave free, without conserved momentum
    that the law would feel, δq = Z z.

    Attributes:
        A_0: (2(k + n), 2(k + n)) what acts without delay: bodies, springs, motors, damping.
        A_1: the same shape, the delayed stiffness; columns of θ, and of z where x depends on it.
        Z: (nv, k) basis of these motions.
        state_names: names of the states.
        symmetries: (2(k + n), s) states along which nothing restores because gravity, contacts
            and the law do not change: yaw about a point foot, translation of a free-floating
            robot, unless a task feels it.
        hessian: (k + n, k + n) second derivative of the whole potential over [z, θ].
        passive_coupling: ‖F_passive Z‖ / ‖F‖: how much of the law answers to passive motions,
            through which it has no potential; `stable` is then not about the law that is run.
        link_asymmetry: relative asymmetry of the link Hessian before it was made symmetric; 0 at
            an equilibrium of the contact forces.
    """

    A_0: Array
    A_1: Array
    Z: Array
    state_names: tuple[str, ...]
    symmetries: Array
    hessian: Array
    passive_coupling: float
    link_asymmetry: float

    @property
    def stable(self) -> bool:
        """Whether the potential has a strict minimum here, up to the symmetries (necessary and,
        with damping and a symmetric stiffness, sufficient for stability without delay)."""
        half = len(self.hessian)
        S = self.symmetries[:half]
        complement = np.linalg.svd(S, full_matrices=True)[0][:, S.shape[1] :]
        reduced = complement.T @ (self.hessian + self.hessian.T) @ complement / 2.0
        values = np.linalg.eigvalsh(reduced)
        return bool(values[0] > 1e-9 * np.abs(values).max())


def linearise(
    robot: Robot,
    actuators: Actuators,
    q: Array,
    *,
    contacts: Sequence[Contact],
    F: Array,
    feedback: Feedback,
    F_passive: Array | None = None,
) -> Linearisation:
    """Freeze the closed loop at a configuration.

    M_z z̈ + H z + Sᵀ(K (S z − θ) + D_s (S ż − θ̇)) = 0 and
    B_s θ̈ + D_θ θ̇ + K (θ − S z) + D_s (θ̇ − S ż) = −(F y + F_passive Z z)(t − d), with S = U Z,
    M_z = Zᵀ M Z, H = Zᵀ ∂(g − J_sᵀ λ)/∂q Z at the contact forces λ that hold the base up, and
    y = θ, or S z when link angles are fed back. Velocities at the configuration are taken as zero.
    Along the symmetries s gravity and contacts do not change, so H is 0 there, also away from an
    equilibrium, and their momentum sᵀ M_z ż is conserved. Where the law feels one, as a task on the
    torso feels yaw about a point foot, z are motions without it, sᵀ M_z z = 0: no delay moves the
    zero roots of what is conserved.

    Args:
        robot: the robot.
        actuators: its springs, motors and damping.
        q: (nq,) configuration.
        contacts: which frames are held.
        F: (n, n) delayed stiffness −∂τ_osc/∂y, Nm/rad.
        feedback: the signal that is fed back.
        F_passive: (n, nv) what the law answers to at fixed y, from `passive_stiffness`; 0 if None.

    Returns:
        The frozen loop.
    """
    at = robot.workspace()
    J_s = robot.contact_jacobian(contacts, q)
    Z = _null_space(J_s, robot.nv)
    symmetric = _symmetries(robot, q, J_s=J_s, Z=Z)
    H, asymmetry = _link_hessian(robot, at, q, contacts=contacts, J_s=J_s, Z=Z)
    others = np.eye(Z.shape[1]) - symmetric @ np.linalg.pinv(symmetric)
    H = others @ H @ others
    M_z = Z.T @ robot.mass_matrix(q) @ Z
    n, passive = robot.n, np.zeros((robot.n, robot.nv)) if F_passive is None else F_passive
    kept = symmetric @ _null_space(passive @ Z @ symmetric, symmetric.shape[1], size=_size(F))
    felt = symmetric @ _null_space(kept.T @ M_z @ symmetric, symmetric.shape[1], size=_size(M_z))
    Y = _null_space(felt.T @ M_z, Z.shape[1], size=_size(M_z))
    Z, M_z, H, kept = Z @ Y, Y.T @ M_z @ Y, Y.T @ H @ Y, Y.T @ kept
    passive, k = passive @ Z, Z.shape[1]
    delayed = np.hstack([passive, F])
    if feedback is Feedback.JOINT:
        delayed = np.hstack([passive + F @ Z[robot.nv_base :], np.zeros((n, n))])
    A_0, A_1 = _loop(actuators, M_z, H, S=Z[robot.nv_base :], delayed=delayed)
    S, K = Z[robot.nv_base :], np.diag(actuators.spring_stiffness)
    hessian = np.block([[H + S.T @ K @ S, -S.T @ K], [-K @ S, K + F]])
    if feedback is Feedback.JOINT:
        hessian = np.block([[H + S.T @ K @ S, -S.T @ K], [-K @ S + F @ S, K]])
    padded = np.zeros((2 * (k + n), kept.shape[1]))
    padded[:k] = kept
    names = tuple(f"z{i}" for i in range(k)) + tuple(f"theta:{j}" for j in robot.joints)
    return Linearisation(
        A_0=A_0,
        A_1=A_1,
        Z=Z,
        state_names=names + tuple(f"d/dt {name}" for name in names),
        symmetries=padded,
        hessian=hessian,
        passive_coupling=float(np.linalg.norm(passive)) / max(float(np.linalg.norm(F)), 1e-300),
        link_asymmetry=asymmetry,
    )


def _size(A: Array) -> float:
    return float(np.linalg.norm(A, 2)) if A.size else 0.0


def _null_space(J: Array, nv: int, *, size: float | None = None) -> Array:
    """Orthonormal basis of what J (…, nv) leaves 0, to _LOST of its own norm or a given size."""
    if J.size == 0:
        return np.eye(nv)
    _, values, rows = np.linalg.svd(J, full_matrices=True)
    rank = int((values > _LOST * (values[0] if size is None else size)).sum())
    return rows[rank:].T


def _loop(
    actuators: Actuators, M_z: Array, H: Array, *, S: Array, delayed: Array
) -> tuple[Array, Array]:
    k, n = S.shape[1], actuators.n
    K, D_s = np.diag(actuators.spring_stiffness), np.diag(actuators.spring_damping)
    B_inverse = np.diag(1.0 / actuators.shaped_inertia)
    D = np.diag(actuators.motor_damping) + D_s
    zero, one = np.zeros((k + n, k + n)), np.eye(k + n)
    stiffness = np.block([[H + S.T @ K @ S, -S.T @ K], [-K @ S, K]])
    damping = np.block([[S.T @ D_s @ S, -S.T @ D_s], [-D_s @ S, D]])
    inverse = np.block([[np.linalg.inv(M_z), np.zeros((k, n))], [np.zeros((n, k)), B_inverse]])
    late = np.vstack([np.zeros((k, k + n)), delayed])
    A_0 = np.block([[zero, one], [-inverse @ stiffness, -inverse @ damping]])
    A_1 = np.block([[zero, zero], [-inverse @ late, zero]])
    return A_0, A_1


def _link_hessian(
    robot: Robot,
    at: Workspace,
    q: Array,
    *,
    contacts: Sequence[Contact],
    J_s: Array,
    Z: Array,
) -> tuple[Array, float]:
    """Zᵀ ∂(g − J_sᵀ λ)/∂q Z at fixed world contact forces λ, by central differences."""
    rest = np.zeros(robot.nv)
    base = slice(0, robot.nv_base)
    force = np.linalg.lstsq(J_s[:, base].T, robot.gravity(q)[base], rcond=None)[0]

    def residual(where: Array) -> Array:
        at.update(where, rest)
        out = at.nle.copy()
        first = 0
        for contact in contacts:
            rows = contact.kind.rows
            out -= at.frame_jacobian(contact.frame)[:rows].T @ force[first : first + rows]
            first += rows
        return out

    columns = [
        residual(robot.integrate(q, _STEP * z)) - residual(robot.integrate(q, -_STEP * z))
        for z in Z.T
    ]
    if not columns:
        return np.zeros((0, 0)), 0.0
    H = Z.T @ np.stack(columns, axis=1) / (2.0 * _STEP)
    scale = np.linalg.norm(H + H.T)
    return (H + H.T) / 2.0, float(np.linalg.norm(H - H.T) / scale) if scale else 0.0


def _symmetries(robot: Robot, q: Array, *, J_s: Array, Z: Array) -> Array:
    """Free motions z that move the robot as a whole without changing its height: rigid
    translations of the world and turns about the vertical, as far as the contacts allow them."""
    if not robot.floating_base:
        return np.zeros((Z.shape[1], 0))
    x, y, z, w = q[3:7]
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    G = np.zeros((robot.nv, 4))
    G[:3, :3] = R.T
    G[3:6, 3] = R.T[:, 2]
    G[:3, 3] = R.T @ np.cross([0.0, 0.0, 1.0], q[:3])
    if len(J_s):
        _, values, rows = np.linalg.svd(J_s @ G, full_matrices=True)
        rank = int((values > 1e-7 * max(values[0], 1e-300)).sum())
        G = G @ rows[rank:].T
    return Z.T @ G
