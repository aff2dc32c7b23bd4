"""Links near rest: contacts eliminated, gravity and contact forces linearised."""

from dataclasses import dataclass

import numpy as np

from sealag.robot import Contact, Robot
from sealag.typing import Array

_STEP = 1e-5  # rad, m: half the base of central differences of gravity and contact forces
_LOST = 1e-9
"""Share of a Jacobian's norm below which a motion counts as free. Rounding leaves 1e-15, so ten
times smaller is safe too; ten times larger frees motions that a long lever still holds."""

_RIGID = 1e-7  # of the largest: rigid motions of the whole robot that contacts leave


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeLinks:
    """Links along the motions z that contacts leave free, δq = Z z.

    Attributes:
        Z: (nv, k) basis.
        M: (k, k) inertia, kg m².
        H: (k, k) stiffness of gravity and contact forces, Zᵀ ∂(g − J_sᵀ λ)/∂q Z, symmetric.
        rigid: (k, s) motions of the robot as a whole that change no height: translations of the
            world and the turn about the vertical, as far as contacts allow them.
    """

    Z: Array
    M: Array
    H: Array
    rigid: Array


class LinkPlant:
    """M v̇ + g − J_sᵀ λ = Uᵀ τ with contacts that hold, near rest.

    Contact forces λ solve J_sᵀ λ = g − Uᵀ τ in all rows, base and joints, so that their part of the
    stiffness is that of the forces which the law leaves to the contacts.
    """

    def __init__(self, robot: Robot, contacts: tuple[Contact, ...]) -> None:
        """Prepare.

        Args:
            robot: the robot.
            contacts: which frames are held.
        """
        self._robot, self._contacts = robot, contacts

    def jacobian(self, q: Array) -> Array:
        """Return J_s (c, nv).

        Args:
            q: (nq,) configuration.
        """
        return self._robot.contact_jacobian(self._contacts, q)

    def places(self, q: Array) -> list[tuple[Array, Array]]:
        """Return rotation (3, 3) and position (3,) of every contact.

        Args:
            q: (nq,) configuration.
        """
        return [self._robot.frame_placement(c.frame, q) for c in self._contacts]

    def displacement(self, q: Array, places: list[tuple[Array, Array]]) -> Array:
        """Return how far the contacts are from given places (c,): m, then rotation vectors.

        Args:
            q: (nq,) configuration.
            places: as `places` returns them.
        """
        parts = [np.zeros(0)]
        for contact, (R_0, p_0) in zip(self._contacts, places, strict=True):
            R, p = self._robot.frame_placement(contact.frame, q)
            turn = R @ R_0.T
            skew = (turn - turn.T) / 2.0  # sine of the angle: enough near 0, where it ends
            parts.append(np.array([*(p - p_0), skew[2, 1], skew[0, 2], skew[1, 0]]))
            parts[-1] = parts[-1][: contact.kind.rows]
        return np.concatenate(parts)

    def support(self, q: Array, springs: Array | None = None) -> Array:
        """Return J_sᵀ λ (nv,), contact forces of least norm that carry what springs (n,) do not;
        without springs, what they carry of the base alone.

        Args:
            q: (nq,) configuration.
            springs: (n,) torque of the springs, Nm.
        """
        return self.jacobian(q).T @ self._force(q, springs)

    def _force(self, q: Array, springs: Array | None) -> Array:
        rows = self._robot.nv_base if springs is None else self._robot.nv
        left = self._robot.gravity(q)
        if springs is not None:
            left[self._robot.nv_base :] -= springs
        return np.linalg.lstsq(self.jacobian(q)[:, :rows].T, left[:rows], rcond=_LOST)[0]

    def stiffness(self, q: Array, springs: Array, directions: Array) -> Array:
        """Return ∂(g − J_sᵀ λ)/∂q along directions at fixed forces λ, (nv, p).

        Args:
            q: (nq,) configuration.
            springs: (n,) torque of the springs, Nm.
            directions: (nv, p) tangent motions.
        """
        force = self._force(q, springs)
        out = np.empty((self._robot.nv, directions.shape[1]))
        for i, way in enumerate(directions.T):
            out[:, i] = self._load(self._robot.integrate(q, _STEP * way), force)
            out[:, i] -= self._load(self._robot.integrate(q, -_STEP * way), force)
        return out / (2.0 * _STEP)

    def _load(self, q: Array, force: Array) -> Array:
        """g − J_sᵀ λ (nv,)."""
        at = self._robot.workspace_at(q)
        out, first = at.nle.copy(), 0
        for contact in self._contacts:
            last = first + contact.kind.rows
            out -= at.frame_jacobian(contact.frame)[: last - first].T @ force[first:last]
            first = last
        return out

    def free(self, q: Array, springs: Array) -> FreeLinks:
        """Return inertia and stiffness along what the contacts leave free.

        Along rigid motions that change no height, gravity and contacts do not change, so that H is
        0 there, also away from an equilibrium.

        Args:
            q: (nq,) configuration at rest.
            springs: (n,) torque of the springs, Nm.
        """
        J_s = self.jacobian(q)
        Z = null_space(J_s, self._robot.nv)
        rigid = self._rigid(q, J_s, Z)
        H = Z.T @ self.stiffness(q, springs, Z)
        others = np.eye(Z.shape[1]) - rigid @ np.linalg.pinv(rigid)
        H = others @ ((H + H.T) / 2.0) @ others
        return FreeLinks(Z=Z, M=Z.T @ self._robot.mass_matrix(q) @ Z, H=H, rigid=rigid)

    def _rigid(self, q: Array, J_s: Array, Z: Array) -> Array:
        if not self._robot.floating_base:
            return np.zeros((Z.shape[1], 0))
        x, y, z, w = q[3:7]
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        G = np.zeros((self._robot.nv, 4))
        G[:3, :3] = R.T
        G[3:6, 3] = R.T[:, 2]  # about the base's own vertical: translations move it elsewhere
        if len(J_s):
            _, values, rows = np.linalg.svd(J_s @ G, full_matrices=True)
            rank = int((values > _RIGID * max(values[0], 1e-300)).sum())
            G = G @ rows[rank:].T
        return Z.T @ G


def null_space(J: Array, columns: int, *, size: float | None = None) -> Array:
    """Return an orthonormal basis (columns, k) of what J (…, columns) leaves 0.

    Args:
        J: the matrix.
        columns: its number of columns.
        size: a norm to which singular values count as 0; that of J if None.
    """
    if J.size == 0:
        return np.eye(columns)
    _, values, rows = np.linalg.svd(J, full_matrices=True)
    rank = int((values > _LOST * (values[0] if size is None else size)).sum())
    return rows[rank:].T


def norm(A: Array) -> float:
    """Return the spectral norm, 0 of an empty matrix."""
    return float(np.linalg.norm(A, 2)) if A.size else 0.0
