"""Preallocated storage for everything the plant knows about one instant."""

import numpy as np

from sealag.robot import Robot


class Instant:
    """One instant's state, dynamics terms, contact forces and powers; overwritten in place.

    Attributes:
        q: Configuration (nq,).
        v: Velocity (nv,).
        z: Joint vectors (n, 9) of the motor kernels: angle, speed and torque first.
        M: Mass matrix (nv, nv).
        nle: Coriolis and gravity terms (nv,).
        potential: Gravity potential, J.
        tau: Spring torques (n,), Nm.
        acceleration: v̇ (nv,).
        force: Contact forces in their contact frames (P, 3), N.
        position: Contact points, then loaded points, in the world (P + L, 3), m.
        velocity: Their velocities (P + L, 3), m/s.
        gap: Height of each contact point above the ground (P,), m; inf while it is loaded.
        power: Powers of holding, sliding, torsional and disturbing forces, W; kinetic energy, J.
        solved: The arrays that the contact kernel writes, in its order.
    """

    __slots__ = (
        "J", "L", "M", "acceleration", "drift", "force", "gap", "nle", "position", "potential",
        "power", "q", "right", "rows", "solved", "spin", "target", "tau", "twist_rows", "v",
        "velocity", "z",
    )  # fmt: skip

    def __init__(self, robot: Robot, *, points: int, contacts: int, feet: int) -> None:
        n, nv = robot.n, robot.nv
        self.q, self.v, self.z = np.zeros(robot.nq), np.zeros(nv), np.zeros((n, 9))
        self.M, self.nle, self.potential = np.zeros((nv, nv)), np.zeros(nv), 0.0
        self.tau, self.acceleration = np.zeros(n), np.zeros(nv)
        self.force, self.target = np.zeros((contacts, 3)), np.zeros((contacts, 3))
        self.position, self.velocity = np.zeros((points, 3)), np.zeros((points, 3))
        self.gap, self.power = np.full(contacts, np.inf), np.zeros(5)
        self.right, self.L = np.zeros(nv), np.zeros((nv, nv))
        self.rows, self.J = np.zeros((contacts, 3, nv)), np.zeros((points, 3, nv))
        self.drift, self.twist_rows, self.spin = (
            np.zeros((points, 3)), np.zeros((feet, nv)), np.zeros(feet)
        )  # fmt: skip
        self.solved = (
            self.tau, self.acceleration, self.force, self.position, self.velocity, self.target,
            self.right, self.L, self.rows, self.power, self.J, self.drift, self.twist_rows,
            self.spin,
        )  # fmt: skip
