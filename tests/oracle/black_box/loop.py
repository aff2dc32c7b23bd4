"""The loop linearised at a state: links, springs, motors, drives and the law's own path."""

from dataclasses import dataclass

import numpy as np

from oracle.black_box.body import Body
from oracle.black_box.design import Drive
from oracle.black_box.law import Law, derivative
from oracle.black_box.rest import State
from oracle.black_box.roots import Late


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """ẋ = A_0 x + late signals; `delayed` is the law's own path, whose delay is asked for."""

    A_0: np.ndarray
    fixed: list[Late]
    delayed: Late
    neutral: int


class Linear:
    """Linearises a design's loop."""

    def __init__(
        self,
        body: Body,
        drive: Drive,
        law: Law,
        *,
        remembers: bool,
        late: float,
        broken: dict[str, bool],
    ) -> None:
        """Prepare.

        Args:
            body: the robot.
            drive: springs, motors and torque loops.
            law: the law that runs.
            remembers: whether its memory moves by itself.
            late: of torque feedback inside the drives, s.
            broken: negative controls.
        """
        self.body, self.drive, self.law = body, drive, law
        self.remembers, self.late, self.broken = remembers, late, broken

    def loop(self, rest: State) -> Loop:
        """Return the loop linearised at a state."""
        body, d, n = self.body, self.drive, self.body.n
        Z = body.free(rest.q)
        M, s = body.mass(rest.q), body.symmetries(rest.q)
        W = Z @ _kernel(s.T @ M @ Z, s.shape[1])
        k = W.shape[1]
        S = W[body.base :]
        inverse = np.linalg.inv(W.T @ M @ W) if k else np.zeros((0, 0))
        G = inverse @ S.T
        A_q = self._pull_slope(rest, Z, W)
        damping = np.zeros_like(body.damping) if "no_link_damping" in self.broken else body.damping
        D_s = np.zeros(n) if "no_spring_damping" in self.broken else d.D_s
        lagging = np.flatnonzero(np.isfinite(d.bandwidth))
        laws, memory = self._law_states(rest, W)
        size = 2 * (k + n) + len(lagging) + memory
        x = np.eye(size)
        y, y_dot, theta, theta_dot = np.split(x[: 2 * (k + n)], [k, 2 * k, 2 * k + n])
        lag = x[2 * (k + n) : 2 * (k + n) + len(lagging)]
        w = x[2 * (k + n) + len(lagging) :]
        spring = np.diag(d.K) @ (theta - S @ y) + np.diag(D_s) @ (theta_dot - S @ y_dot)
        gain = np.diag(1.0 / d.beta)
        inner, e = (np.eye(n) - gain) @ spring, self.late
        wanted = -gain @ np.diag(d.D) @ theta_dot + (inner if e == 0.0 else 0.0 * inner)
        law_of = _Law(laws, np.vstack([y, theta]), w)
        wanted_now = wanted + gain @ law_of.now
        torque = wanted_now.copy()
        torque[lagging] = lag
        A_0 = np.zeros((size, size))
        A_0[:k] = y_dot
        A_0[k : 2 * k] = A_q @ y + G @ spring - inverse @ W.T @ damping @ W @ y_dot
        A_0[2 * k : 2 * k + n] = theta_dot
        A_0[2 * k + n : 2 * (k + n)] = (torque - spring - d.viscous[:, None] * theta_dot) / d.B[
            :, None
        ]
        A_0[2 * (k + n) : size - memory] = d.bandwidth[lagging, None] * (wanted_now[lagging] - lag)
        A_0[size - memory :] = law_of.memory_now
        into = np.zeros((size, n))  # how a torque wanted of the drives enters
        for i in range(n):
            into[2 * k + n + i, i] = 1.0 / d.B[i]
        for row, i in enumerate(lagging):
            into[2 * k + n + i, i] = 0.0
            into[2 * (k + n) + row, i] = d.bandwidth[i]
        B = into @ gain @ law_of.through
        B[size - memory :] += law_of.memory_through
        fixed = []
        if e > 0.0 and np.abs(inner).max() > 0.0:
            acting = np.flatnonzero(np.abs(inner).max(axis=1) > 0.0)
            fixed = [Late(B=into[:, acting], C=inner[acting], delay=e)]
        delayed = Late(B=B, C=law_of.seen, delay=0.0)
        return Loop(A_0=A_0, fixed=fixed, delayed=delayed, neutral=2 * s.shape[1])

    def _pull_slope(self, rest: State, Z: np.ndarray, W: np.ndarray) -> np.ndarray:
        """∂ÿ/∂y with the spring torques held, by differences of the constrained acceleration."""
        body, rank = self.body, self.body.nv - Z.shape[1]
        k = W.shape[1]
        if not k:
            return np.zeros((0, 0))

        def acceleration(y: np.ndarray) -> np.ndarray:
            q = body.move(rest.q, W @ y)
            pull = -body.gravity(q)
            pull[body.base :] += rest.torque
            if "no_contact_forces" in self.broken:
                return np.linalg.solve(W.T @ body.mass(q) @ W, W.T @ pull)
            free = body.free(q, rank)
            return W.T @ free @ np.linalg.solve(free.T @ body.mass(q) @ free, free.T @ pull)

        return derivative(acceleration, k)

    def _law_states(self, rest: State, W: np.ndarray):
        """Slopes of the law over (y, θ), and how many states its memory has."""
        nv = self.body.nv
        onto = np.zeros((nv + self.body.n, W.shape[1] + self.body.n))
        if "no_base_feedback" not in self.broken:
            onto[: self.body.base, : W.shape[1]] = W[: self.body.base]
        onto[self.body.base : nv, : W.shape[1]] = W[self.body.base :]
        onto[nv:, W.shape[1] :] = np.eye(self.body.n)
        if not self.remembers:
            slope = self.law.slope(rest.q, rest.theta)
            return (slope @ onto, None, 0.0), 0
        fast, slow, rate = self.law.slopes(rest.q, rest.theta)
        fast, slow = fast @ onto, slow @ onto
        return (fast, slow, rate), int(np.linalg.matrix_rank(fast - slow, tol=1e-7))


class _Law:
    """The law's linear paths: u = seen late through `through`, and its memory.

    Without memory u = C y(t − d). With the tank u = C_0 y − (C_0 − C_∞) w, ẇ = r (y − w) of the
    delayed y: P Qᵀ = C_0 − C_∞ leaves as many states as that has rank.
    """

    def __init__(self, laws, y: np.ndarray, w: np.ndarray) -> None:
        fast, slow, rate = laws
        size, n, m = y.shape[1], len(fast), len(w)
        if m == 0:
            self.seen, self.through = fast @ y, np.eye(n)
            self.now, self.memory_now = np.zeros((n, size)), np.zeros((0, size))
            self.memory_through = np.zeros((0, n))
            return
        U, values, Vh = np.linalg.svd(fast - slow)
        P, Q = U[:, :m] * values[:m], Vh[:m].T
        self.seen = np.vstack([fast @ y, Q.T @ y])
        self.through = np.hstack([np.eye(n), np.zeros((n, m))])
        self.now = -P @ w
        self.memory_now = -rate * w
        self.memory_through = np.hstack([np.zeros((m, n)), rate * np.eye(m)])


def _kernel(A: np.ndarray, rank: int) -> np.ndarray:
    """Orthonormal basis of what A (rank rows, all independent) maps to 0."""
    if rank == 0:
        return np.eye(A.shape[1])
    return np.linalg.svd(A, full_matrices=True)[2][rank:].T
