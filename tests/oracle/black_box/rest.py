"""Two states of a loop that holds a posture: in the posture itself, and where it rests."""

from dataclasses import dataclass

import numpy as np

import sealag
from oracle.black_box.body import Body
from oracle.black_box.design import Drive
from oracle.black_box.law import Law, Unsettled

MOST_STEPS = 60
BALANCED = 1e-12
"""Residual of the equilibrium, of the largest torque."""
NOISE = 1e-8
"""Residual below which one more Newton step is the last: the law's rounding may hide the rest."""
LONGEST_STEP = 0.2
"""rad, m: of one Newton step towards the equilibrium."""
UNBALANCED = 1e-7
"""Share of weight and torques that a posture, whose angles are rounded, may leave over."""
DEPENDENT = 1e-7
"""Singular value, of the largest, below which joints do not move a way that contacts leave."""


class NoEquilibrium(RuntimeError):
    """The loop rests nowhere near the posture, or the posture is not balanced."""


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Where a loop is: configuration, motor angles, how far from the posture, Nm of the springs."""

    q: np.ndarray
    theta: np.ndarray
    sag: float
    torque: np.ndarray


class Search:
    """Looks for both states of a design."""

    def __init__(self, body: Body, drive: Drive, law: Law, posture: np.ndarray) -> None:
        """Prepare.

        Args:
            body: the robot.
            drive: its springs.
            law: the law that holds the posture.
            posture: (nq,).
        """
        self.body, self.drive, self.law, self.posture = body, drive, law, posture

    @property
    def _joints(self) -> np.ndarray:
        return self.posture[self.body.nq - self.body.n :]

    def in_posture(self, feedback: str, gravity: str) -> State:
        """Return links in the posture, springs that carry gravity, and tasks without error.

        Args:
            feedback: what the law is taken at; motor angles are without error at q_j, q̄(θ) where
                the springs are wound by the compensation.
            gravity: what the law compensates.

        Raises:
            NoEquilibrium: the contacts do not balance the posture.
        """
        body, q = self.body, self.posture
        Z, g = body.free(q), body.gravity(q)
        S, M = Z[body.base :], Z.T @ body.mass(q) @ Z
        torque = np.zeros(body.n)
        if len(M):
            inertia = np.linalg.inv(M)
            torque = np.linalg.pinv(S @ inertia @ S.T, rcond=DEPENDENT) @ S @ inertia @ Z.T @ g
        left = float(np.abs(Z.T @ g - S.T @ torque).max(initial=0.0))
        scale = max(body.weight, float(np.abs(g).max()), 1e-3)
        if left > UNBALANCED * scale:
            raise NoEquilibrium(f"the posture leaves {left:.2g} N or Nm of gravity over")
        slack = feedback == "motor" or (feedback != "joint" and gravity == "none")
        theta = self._joints + (0.0 if slack else 1.0) * torque / self.drive.K
        return State(q=q, theta=theta, sag=0.0, torque=torque)

    def rest(self, start: tuple[np.ndarray, np.ndarray] | None = None) -> State:
        """Return the equilibrium that Newton's method reaches from the posture.

        Args:
            start: q and θ to begin with instead.

        Raises:
            NoEquilibrium: none is found, or nothing holds the robot.
            Unsettled, SealagError: the law does not exist there.
        """
        body, K = self.body, self.drive.K
        if body.falls_freely:
            raise NoEquilibrium("nothing holds the robot: it falls")
        _, places = body.held(self.posture)
        rank = body.nv - body.free(self.posture).shape[1]
        starts = self._starts() if start is None else [start]
        left, lost = np.inf, None
        for attempt in (self._newton, self._downhill):
            for q, theta in starts:
                try:
                    found, residual = attempt(q, theta, places, rank)
                except (Unsettled, sealag.SealagError) as error:
                    lost = error  # the law does not exist on the way; it may from elsewhere
                    continue
                left = min(left, residual)
                if found is not None:
                    q_j = found[0][body.nq - body.n :]
                    away = np.abs(q_j - self._joints).max()
                    torque = K * (found[1] - q_j)
                    return State(q=found[0], theta=found[1], sag=float(away), torque=torque)
        if lost is not None and left == np.inf:
            raise lost
        raise NoEquilibrium(f"residual {left:.2g} of the largest torque")

    def _starts(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The posture with springs that carry it, and with springs at rest."""
        body, q = self.body, self.posture
        Z = body.free(q)
        carry = np.linalg.lstsq(Z[body.base :].T, Z.T @ body.gravity(q), rcond=None)[0]
        return [(q, self._joints + carry / self.drive.K), (q, self._joints)]

    def _newton(self, q, theta, places, rank):
        """Equilibrium (q, θ) by Newton's method, None if it does not arrive; the least residual."""
        left: list[float] = []
        for _ in range(MOST_STEPS):
            Z = self.body.free(q, rank)
            residual, size = self._unbalance(q, theta, Z)
            left.append(float(np.abs(residual).max()) / size)
            if left[-1] < BALANCED or (left[-1] < NOISE and min(left[:-1], default=1.0) < NOISE):
                return (q, theta), left[-1]
            step = -np.linalg.lstsq(self._unbalance_slope(q, theta, Z), residual, rcond=1e-9)[0]
            step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
            k = Z.shape[1]
            q = self.body.touch(self.body.move(q, Z @ step[:k]), places)
            theta = theta + step[k:]
        return None, min(left)

    def _downhill(self, q, theta, places, rank):
        """The same after a search that only goes where the residual falls."""
        damping, left = 1e-3, np.inf
        for _ in range(MOST_STEPS // 3):
            Z = self.body.free(q, rank)
            residual, size = self._unbalance(q, theta, Z)
            left = float(np.abs(residual).max()) / size
            if left < 1e-6:
                return self._newton(q, theta, places, rank)
            J = self._unbalance_slope(q, theta, Z)
            k, scale = Z.shape[1], np.maximum(np.linalg.norm(J, axis=0), 1e-6)
            for _ in range(12):
                system = np.vstack([J, np.diag(np.sqrt(damping) * scale)])
                target = np.concatenate([-residual, np.zeros(J.shape[1])])
                step = np.linalg.lstsq(system, target, rcond=None)[0]
                step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300))
                there = self.body.touch(self.body.move(q, Z @ step[:k]), places)
                try:
                    new, _ = self._unbalance(there, theta + step[k:], self.body.free(there, rank))
                    better = np.linalg.norm(new) < np.linalg.norm(residual)
                except (Unsettled, sealag.SealagError):
                    better = False
                if better:
                    q, theta, damping = there, theta + step[k:], damping / 5.0
                    break
                damping *= 5.0
            else:
                break
        return None, left

    def _unbalance(self, q, theta, Z) -> tuple[np.ndarray, float]:
        body = self.body
        spring = self.drive.K * (theta - q[body.nq - body.n :])
        g = body.gravity(q)
        pull = -g.copy()
        pull[body.base :] += spring
        command = self.law.command(q, theta)
        size = max(float(np.abs(g).max()), float(np.abs(command).max()), 1e-3)
        return np.concatenate([Z.T @ pull, command - spring]), size

    def _unbalance_slope(self, q, theta, Z) -> np.ndarray:
        """A rough Jacobian of the residual by forward differences; Newton's method corrects it."""
        h, k = 1e-6, Z.shape[1]

        def at(step: np.ndarray) -> np.ndarray:
            there = self.body.move(q, Z @ step[:k])
            Z_there = self.body.free(there, self.body.nv - k)
            return self._unbalance(there, theta + step[k:], Z_there @ (Z_there.T @ Z))[0]

        now = self._unbalance(q, theta, Z)[0]
        columns = [(at(h * e) - now) / h for e in np.eye(k + self.body.n)]
        return np.stack(columns, axis=1)
