"""The loop at the equilibrium where it rests, and what the black box says about it."""

from dataclasses import dataclass

import numpy as np

import sealag
from oracle.black_box.body import Body
from oracle.black_box.design import Design, read_design
from oracle.black_box.law import Law, TankLaw, Unsettled, derivative
from oracle.black_box.roots import Late, first_crossing, roots, unstable_count

MOST_STEPS = 60
BALANCED = 1e-12
"""Residual of the equilibrium, of the largest torque."""
NOISE = 1e-8
"""Residual below which one more Newton step is the last: the law's rounding may hide the rest."""
LONGEST_STEP = 0.2
"""rad, m: of one Newton step towards the equilibrium."""
KNIFE_EDGE = 1e-7
"""|Re s| / (1 + |s|) below which rounding may decide on which side of the axis a root is."""
ON_AXIS = 1e-11
"""|Re s| / (1 + |s|) below which a root is on the axis: nothing there is asymptotically stable."""


class NoEquilibrium(RuntimeError):
    """The loop rests nowhere near the posture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Springs, motors and torque loops, (n,) each, in the order of the joints."""

    K: np.ndarray
    B: np.ndarray
    beta: np.ndarray
    D: np.ndarray
    D_s: np.ndarray
    viscous: np.ndarray
    bandwidth: np.ndarray
    limit: np.ndarray

    @classmethod
    def of(cls, design: Design, joints: list[str]) -> "Drive":
        """Return the drives of a design.

        Args:
            design: the project file.
            joints: names, in order.
        """
        keys = {
            "K": "spring_stiffness",
            "B": "rotor_inertia",
            "beta": "inertia_shaping",
            "D": "motor_damping",
            "D_s": "spring_damping",
            "viscous": "viscous_friction",
            "bandwidth": "torque_bandwidth",
            "limit": "torque_limit",
        }
        return cls(
            **{
                name: np.array([design.actuator(joint, key) for joint in joints])
                for name, key in keys.items()
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """Where the loop rests: configuration, motor angles, how far from the posture, Nm carried."""

    q: np.ndarray
    theta: np.ndarray
    sag: float
    torque: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """ẋ = A_0 x + late signals; `delayed` is the law's own path, whose delay is asked for."""

    A_0: np.ndarray
    fixed: list[Late]
    delayed: Late
    neutral: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the black box says.

    Attributes:
        rest: the equilibrium.
        overloaded: joints whose spring torque at rest exceeds the drive's limit.
        unstable: roots not left of the axis without delay, symmetries left out.
        nearest: |Re s| / (1 + |s|) of the root nearest to the axis: a knife's edge if tiny.
        rightmost: largest real part without delay, 1/s.
        margin: constant delay margin, s; 0 if unstable without delay, inf if there is none.
        frequency: of the first crossing, rad/s.
        loop: the matrices.
    """

    rest: Rest
    overloaded: tuple[str, ...]
    unstable: int
    nearest: float
    rightmost: float
    margin: float
    frequency: float
    loop: Loop

    @property
    def stable(self) -> bool:
        """Whether every root is left of the axis without delay."""
        return self.unstable == 0

    @property
    def decided(self) -> bool:
        """Whether no root is so near to the axis that rounding decides."""
        return self.nearest > KNIFE_EDGE

    @property
    def on_axis(self) -> bool:
        """Whether a root lies on the axis to rounding."""
        return self.nearest < ON_AXIS


class BlackBox:
    """One design at one posture with one set of contacts."""

    def __init__(self, path, system, *, q=None, contacts=None, **broken: bool) -> None:
        """Read the design again, and take its controller.

        Args:
            path: the project file.
            system: as `sealag.load` returns it, for its controller only.
            q: (nq,) posture; the project's if None.
            contacts: held frames as sealag names them; the project's if None.
            broken: negative controls: `no_contact_forces`, `no_spring_damping`,
                `no_link_damping`, `no_base_feedback`.
        """
        design = read_design(path)
        if contacts is not None:
            rows = {"point": 3, "surface": 6}
            held = tuple((c.frame, rows[c.kind.value]) for c in contacts)
            design = _with_contacts(design, held)
        self.design, self.body, self.broken = design, Body(design), broken
        self.drive = Drive.of(design, self.body.joints)
        assert tuple(self.body.joints) == tuple(system.robot.joints)
        self.posture = self.body.posture(design) if q is None else np.array(q, dtype=float)
        kind = TankLaw if design.tank else Law
        self.law = kind(self.body, system, self.posture, self.drive.K, contacts)

    def rest(self, start: tuple[np.ndarray, np.ndarray] | None = None) -> Rest:
        """Return the equilibrium that Newton's method reaches from the posture.

        Args:
            start: q and θ to begin with instead; without contacts only.

        Raises:
            NoEquilibrium: none is found.
            Unsettled, SealagError: the law does not exist there.
        """
        body, K = self.body, self.drive.K
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
                    away = np.abs(q_j - self.posture[body.nq - body.n :]).max()
                    torque = K * (found[1] - q_j)
                    return Rest(q=found[0], theta=found[1], sag=float(away), torque=torque)
        if lost is not None and left == np.inf:
            raise lost
        raise NoEquilibrium(f"residual {left:.2g} of the largest torque")

    def _starts(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The posture with springs that carry it, and with springs at rest."""
        body, q = self.body, self.posture
        q_j, Z = q[body.nq - body.n :], body.free(q)
        carry = np.linalg.lstsq(Z[body.base :].T, Z.T @ body.gravity(q), rcond=None)[0]
        return [(q, q_j + carry / self.drive.K), (q, q_j)]

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

    def loop(self, rest: Rest) -> Loop:
        """Return the loop linearised at its equilibrium."""
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
        inner, e = (np.eye(n) - gain) @ spring, self.design.torque_feedback_delay
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

    def _pull_slope(self, rest: Rest, Z: np.ndarray, W: np.ndarray) -> np.ndarray:
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

    def _law_states(self, rest: Rest, W: np.ndarray):
        """Slopes of the law over (y, θ), and how many states its memory has."""
        nv = self.body.nv
        onto = np.zeros((nv + self.body.n, W.shape[1] + self.body.n))
        if "no_base_feedback" not in self.broken:
            onto[: self.body.base, : W.shape[1]] = W[: self.body.base]
        onto[self.body.base : nv, : W.shape[1]] = W[self.body.base :]
        onto[nv:, W.shape[1] :] = np.eye(self.body.n)
        if not isinstance(self.law, TankLaw):
            slope = self.law.slope(rest.q, rest.theta)
            self._require_blind_fall(rest, slope)
            return (slope @ onto, None, 0.0), 0
        fast, slow, rate = self.law.slopes(rest.q, rest.theta)
        self._require_blind_fall(rest, slow)
        fast, slow = fast @ onto, slow @ onto
        return (fast, slow, rate), int(np.linalg.matrix_rank(fast - slow, tol=1e-7))

    def _require_blind_fall(self, rest: Rest, slope: np.ndarray) -> None:
        """A robot without contacts falls; a law that feels the height has no rest."""
        if self.body.falls_freely:
            height = self.body.symmetries(rest.q)[:, 2]
            felt = np.abs(slope[:, : self.body.nv] @ height).max()
            if felt > 1e-7 * max(float(np.abs(slope).max()), 1e-9):
                raise NoEquilibrium(f"the robot falls, and the law answers by {felt:.2g} Nm/m")

    def answer(self, rest: Rest | None = None) -> Answer:
        """Return what there is to say about the design.

        Args:
            rest: the equilibrium; that next to the posture if None.

        Raises:
            NoEquilibrium: it rests nowhere.
            Unsettled: the law has no derivative there.
        """
        rest = self.rest() if rest is None else rest
        loop = self.loop(rest)
        here = roots(loop.A_0, [*loop.fixed, loop.delayed])
        unstable, nearest = unstable_count(here)
        margin, frequency = 0.0, float("nan")
        if not unstable:
            margin, frequency = first_crossing(loop.A_0, loop.fixed, loop.delayed)
        limit = self.drive.limit
        over = np.flatnonzero(np.abs(rest.torque) > limit)
        return Answer(
            rest=rest,
            overloaded=tuple(self.body.joints[i] for i in over),
            unstable=unstable,
            nearest=nearest,
            rightmost=float(here.real.max()) if len(here) else -np.inf,
            margin=margin,
            frequency=frequency,
            loop=loop,
        )


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


def _with_contacts(design: Design, contacts) -> Design:
    from dataclasses import replace

    return replace(design, contacts=contacts)


def answer(path, system, **options) -> Answer:
    """Return the black box's answer for a project file at its posture.

    Args:
        path: the project file.
        system: as `sealag.load` returns it.
        options: as for `BlackBox`.
    """
    return BlackBox(path, system, **options).answer()
