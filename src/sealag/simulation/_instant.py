"""Preallocated memory for everything the plant knows about one instant."""

import numpy as np

from sealag.typing import Array


class Instant:
    """One instant's state, contact forces and powers; overwritten in place.

    Attributes:
        data: All of it in one row, as the kernels take it; the other arrays are views.
        row: The part of it that is logged, from q to force.
        q: Configuration (nq,).
        v: Velocity (nv,).
        z: Joint vectors (n, 9) of the motor kernels: angle, speed and torque first.
        acceleration: v̇ (nv,).
        power: Powers of holding, sliding, torsional and disturbing forces, W, and behind them
            ``energy``, as the kernels take both (6,).
        energy: Kinetic energy and gravity potential (2,), J.
        tau: Spring torques (n,), Nm.
        force: Contact forces in their contact frames (P, 3), N.
        gap: Height of each contact point above the ground (P,), m; inf while it is loaded.
        position: Contact points, then loaded points, in the world (T, 3), m.
        velocity: Their velocities (T, 3), m/s.
        drift: Their accelerations at zero v̇ (T, 3), m/s².
        J: Their Jacobians (T, 3, nv).
        target: What the contact equations ask for besides J v̇ (P, 3).
        rows: L⁻¹ (C J)ᵀ of the contact points (P, 3, nv).
        right: Applied generalised forces less Coriolis and gravity (nv,).
        L: Cholesky factor of the mass matrix (nv, nv).
        twist_rows: L⁻¹ Jᵀ of each foot's turn about its normal (feet, nv).
        spin: The rate of that turn (feet,), rad/s.
        sizes: As in ``contact.parts``.
    """

    __slots__ = (
        "J", "L", "acceleration", "data", "drift", "energy", "force", "gap", "position", "power",
        "q", "right", "row", "rows", "sizes", "spin", "target", "tau", "twist_rows", "v",
        "velocity", "z",
    )  # fmt: skip

    def __init__(self, sizes: tuple[int, int, int, int, int, int, int]) -> None:
        from sealag.kernels import contact

        nq, nv, n, count = sizes[:4]
        self.sizes = sizes
        self.data = np.zeros(contact.memory_size(sizes))
        self.row = self.data[: nq + 2 * nv + 10 * n + 6 + 3 * count]
        (
            self.q, self.v, self.z, self.acceleration, self.power, self.tau, self.force, self.gap,
            self.position, self.velocity, self.drift, self.J, self.target, self.rows, self.right,
            self.L, self.twist_rows, self.spin, *_,
        ) = contact.parts(self.data, sizes)  # fmt: skip
        self.energy = self.power[4:]
        self.gap[:] = np.inf

    def split(self, rows: Array) -> dict[str, Array]:
        """Return the named parts of logged rows (N, …).

        Args:
            rows: As ``row``, below one another.
        """
        nq, nv, n, count = self.sizes[:4]
        ends = np.cumsum([nq, nv, 9 * n, nv + 6, n])
        q, v, z, _, tau, force = (part.copy() for part in np.split(rows, ends, axis=1))
        angle, speed, torque = (z[:, k::9].copy() for k in range(3))
        return {
            "q": q, "v": v, "theta": angle, "theta_dot": speed, "tau_motor": torque,
            "tau_sea": tau, "contact_force": force.reshape(len(rows), count, 3),
        }  # fmt: skip
