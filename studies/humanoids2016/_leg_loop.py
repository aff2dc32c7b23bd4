"""One frozen leg under delay, step by step: its law, the energy tank as printed, and its energies.

M q̈ = K (θ − q) + f and B_s θ̈ + D_θ θ̇ + K (θ − q) = −Jᵀ S y(t − d), from rest. y is x(θ) = J θ,
x(q̄(θ)) = J (I − K⁻¹ F)⁻¹ θ with F = Jᵀ S J, or x̂ of the energy tank. Between two steps y is a
straight line; along it the motion is exact, by the matrix exponential, and so are the energies that
belong to y. Only the work through a port is a trapezoid.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from sealag.typing import Array, BoolArray

STEP = 5e-4
"""s, at most: the trapezoid of a port's work then errs by 1e-4 of it, see `LegRun.tolerance`."""

WILD = 1e3
"""rad/s: a run in which a motor is faster has left any bound, and ends."""


class Fed(StrEnum):
    """What is fed back."""

    MOTOR = "θ"
    STATIC = "q̄(θ)"
    TANK_PUBLISHED = "x̂, published tank"
    TANK_CORRECTED = "x̂, corrected tank"

    @property
    def tank(self) -> bool:
        """Whether x̂ is fed back."""
        return self in (Fed.TANK_PUBLISHED, Fed.TANK_CORRECTED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A leg frozen at an instant.

    Attributes:
        name: what it is.
        M: (n, n) link inertia, kg m².
        K: (n,) spring stiffness, Nm/rad.
        B_s: (n,) shaped motor inertia, kg m².
        D: (n,) motor damping, Nms/rad.
        J: (m, n) task Jacobian.
        S: (m, m) task stiffness; symmetric, or Λ K_x as printed.
    """

    name: str
    M: Array
    K: Array
    B_s: Array
    D: Array
    J: Array
    S: Array

    @property
    def F(self) -> Array:
        """Jᵀ S J, (n, n) Nm/rad."""
        return self.J.T @ self.S @ self.J

    @property
    def static(self) -> Array:
        """∂q̄/∂θ = (I − K⁻¹ F)⁻¹ (n, n), the derivative of (15)."""
        return np.linalg.inv(np.eye(len(self.K)) - self.F / self.K[:, None])


@dataclass(frozen=True, slots=True, kw_only=True)
class TankSetting:
    """The tank of (19) to (22).

    Attributes:
        energy: E_s at the start, J.
        threshold: ε, the s = (2 E_s)^½ at and below which u is 0, J^½.
        pull: (m,) diagonal of K_b, 1/s.
    """

    energy: float
    threshold: float
    pull: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A force on the links, f = force sin(ω t) until `end`.

    Attributes:
        name: what it is.
        force: (n,) Nm.
        frequency: ω, rad/s.
        end: s.
    """

    name: str
    force: Array
    frequency: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LegRun:
    """A run of a leg; energies in J.

    Attributes:
        time: (N,) s.
        theta_dot: (N, n) motor speeds, rad/s.
        supplied: (N,) work of the push.
        port: (N,) ∫q̇ᵀ Γ_sea dt, what the springs have given to the links.
        V_1: (N,) kinetic energy of the links.
        V_2: (N,) of motors and springs.
        V_3: (N,) the task's potential at the signal that is fed back.
        V_4: (N,) delay line and E_s, as the paper books it.
        tank: (N,) E_s; 0 without a tank.
        empty: (N,) whether s ≤ ε; False without a tank.
        x: (N, m) x(q̄(θ)), m.
        x_hat: (N, m) what is fed back, m.
        shaped_inertia: (n,) kg m².
    """

    time: Array
    theta_dot: Array
    supplied: Array
    port: Array
    V_1: Array
    V_2: Array
    V_3: Array
    V_4: Array
    tank: Array
    empty: BoolArray
    x: Array
    x_hat: Array
    shaped_inertia: Array

    @property
    def joint_slack(self) -> Array:
        """∫q̇ᵀ Γ_sea + pushes − (S_j − S_j(0)) with S_j = V_1: not negative if passive, (26)."""
        return self.port + self.supplied - (self.V_1 - self.V_1[0])

    @property
    def controller_slack(self) -> Array:
        """−∫q̇ᵀ Γ_sea − (S_c − S_c(0)) with S_c = V_2 + V_3 + V_4: not negative if passive."""
        S_c = self.V_2 + self.V_3 + self.V_4
        return -self.port - (S_c - S_c[0])

    @property
    def V(self) -> Array:
        """V_1 + V_2 + V_3 + V_4 less what the pushes supplied; falls if (29) does its work."""
        return self.V_1 + self.V_2 + self.V_3 + self.V_4 - self.supplied

    @property
    def rise(self) -> float:
        """Largest rise of V above any earlier value."""
        return float((self.V - np.minimum.accumulate(self.V)).max())

    @property
    def moved(self) -> float:
        """Largest energy in V_1 and V_2, which the trapezoid's error is a share of."""
        return float((self.V_1 + self.V_2).max())

    @property
    def tolerance(self) -> float:
        """What the trapezoids of port and pushes may err by: a ten-thousandth of what moved."""
        return 1e-4 * self.moved

    @property
    def fastest(self) -> float:
        """Largest motor speed, rad/s."""
        return float(np.abs(self.theta_dot).max())

    @property
    def speed_bound(self) -> float:
        """Theorem 1's bound of θ̇: from ½ θ̇ᵀ B_s θ̇ ≤ V(0) + most supplied, rad/s."""
        energy = float(self.V[0] + self.supplied.max())
        return float(np.sqrt(2.0 * energy / self.shaped_inertia.min()))

    @property
    def astray(self) -> float:
        """Largest |x̂ − x(q̄)| as a share of the largest |x(q̄)|."""
        away = np.linalg.norm(self.x_hat - self.x, axis=1).max()
        return float(away / max(np.linalg.norm(self.x, axis=1).max(), 1e-300))


def run_leg(
    leg: Leg,
    fed: Fed,
    push: Push,
    *,
    delay: float,
    duration: float,
    multiplier: Array | None = None,
    tank: TankSetting | None = None,
    step: float = STEP,
) -> LegRun:
    """Run a leg from rest under a push.

    Args:
        leg: the leg.
        fed: what is fed back.
        push: the force on its links.
        delay: d, s.
        duration: s.
        multiplier: (m, m) Q of V_4; S if None.
        tank: where x̂ is fed back.
        step: longest step, s; the delay is a whole number of steps.
    """
    n, m = len(leg.K), len(leg.S)
    late = int(np.ceil(delay / step))
    h = delay / late
    count = int(np.ceil(duration / h))
    Q = leg.S if multiplier is None else multiplier
    Phi, now, after = _discrete(leg, h)
    time = h * np.arange(count + 1)
    force = np.outer(np.sin(push.frequency * time) * (time < push.end), push.force)
    z = np.zeros((count + 1, 4 * n))
    y, increments, energy = np.zeros((count + 1, m)), np.zeros((count + 1, m)), np.zeros(count + 1)
    empty = np.zeros(count + 1, dtype=bool)
    seen = leg.J if fed is Fed.MOTOR else leg.J @ leg.static
    deviation = leg.J @ (leg.static - np.eye(n))  # v_1 = J (∂q̄/∂θ − I) θ̇
    energy[0] = tank.energy if tank else 0.0
    grip = -np.expm1(-tank.pull * h) if tank else np.zeros(m)
    stress = -leg.J.T @ leg.S
    for k in range(count):
        first, last = y[max(k - late, 0)], y[max(k + 1 - late, 0)]
        input_now = np.concatenate([force[k], stress @ first])
        input_after = np.concatenate([force[k + 1], stress @ last])
        z[k + 1] = Phi @ z[k] + now @ input_now + after @ input_after
        theta = z[k + 1, n : 2 * n]
        if np.abs(z[k + 1, 3 * n :]).max() > WILD:
            count = k
            break
        if not fed.tank or tank is None:
            y[k + 1] = seen @ theta
            increments[k + 1] = y[k + 1] - y[k]
            continue
        turn = theta - z[k, n : 2 * n]
        moved = leg.J @ turn
        empty[k] = np.sqrt(2.0 * energy[k]) <= tank.threshold
        U = np.zeros(m)  # u over the step, (21)
        if not empty[k]:
            U = deviation @ turn + grip * (leg.J @ (leg.static @ z[k, n : 2 * n]) - y[k])
        flow = -0.5 * late * (U @ Q @ U) - late * (U @ Q @ moved)  # (20), with d̄ / h = late
        if fed is Fed.TANK_CORRECTED:
            flow -= (y[k] + 0.5 * (U + moved)) @ leg.S @ U
        if energy[k] + flow < 0.0:
            U, flow, empty[k] = np.zeros(m), 0.0, True
        energy[k + 1] = energy[k] + flow
        increments[k + 1] = U + moved
        y[k + 1] = y[k] + increments[k + 1]
    empty[count] = empty[count - 1]
    logged = _Log(z, y, increments, energy, empty, time, force)
    return _observed(leg, fed, _Log(*(part[: count + 1] for part in logged)), Q=Q, late=late)


class _Log(NamedTuple):
    """What a run leaves behind, at N instants."""

    z: Array  # (N, 4n) q, θ, q̇, θ̇
    y: Array  # (N, m) what is fed back
    increments: Array  # (N, m) of y, since the instant before
    energy: Array  # (N,) E_s, J
    empty: BoolArray  # (N,) whether the tank is
    time: Array  # (N,) s
    force: Array  # (N, n) of the push, Nm


def _discrete(leg: Leg, h: float) -> tuple[Array, Array, Array]:
    """Φ, and what the inputs (f, τ_osc) at both ends of a step do, for inputs along a line."""
    from scipy.linalg import expm

    n = len(leg.K)
    eye, zero, K = np.eye(n), np.zeros((n, n)), np.diag(leg.K)
    W, B = np.linalg.inv(leg.M), np.diag(1.0 / leg.B_s)
    A = np.block([
        [zero, zero, eye, zero], [zero, zero, zero, eye], [-W @ K, W @ K, zero, zero],
        [B @ K, -B @ K, zero, -B @ np.diag(leg.D)],
    ])  # fmt: skip
    G = np.block([[zero, zero], [zero, zero], [W, zero], [zero, B]])
    big = np.zeros((8 * n, 8 * n))
    big[: 4 * n, : 4 * n], big[: 4 * n, 4 * n : 6 * n] = A * h, G * h
    big[4 * n : 6 * n, 6 * n :] = np.eye(2 * n)
    whole = expm(big)
    constant, slope = whole[: 4 * n, 4 * n : 6 * n], whole[: 4 * n, 6 * n :]
    return whole[: 4 * n, : 4 * n], constant - slope, slope


def _observed(leg: Leg, fed: Fed, log: _Log, *, Q: Array, late: int) -> LegRun:
    """Energies and works of a run."""
    z, y, increments, energy, empty, time, force = log
    n, h = len(leg.K), time[1]
    q, theta, q_dot, theta_dot = (z[:, k * n : (k + 1) * n] for k in range(4))
    spring = leg.K * (theta - q)
    turn = np.diff(q, axis=0)
    port, supplied = (_works(signal, turn) for signal in (spring, force))
    V_3 = 0.5 * np.einsum("ki,ij,kj->k", y, leg.S, y)
    if fed is Fed.STATIC:
        load = y @ leg.S.T @ leg.J  # −l, and V_3 = ½ x̃ᵀ S x̃ − ½ lᵀ K⁻¹ l
        V_3 -= 0.5 * (load**2 / leg.K).sum(axis=1)
    power = np.einsum("ki,ij,kj->k", increments[1:], Q, increments[1:]) / h  # ẏᵀ Q ẏ h
    weight = np.arange(late)[::-1] + 0.5  # ξ − t + d̄ in the middle of each step, over h
    V_4 = energy + np.append(0.0, 0.5 * h * np.convolve(power, weight)[: len(power)])
    return LegRun(
        time=time, theta_dot=theta_dot, supplied=supplied, port=port,
        V_1=0.5 * np.einsum("ki,ij,kj->k", q_dot, leg.M, q_dot),
        V_2=0.5 * (theta_dot**2 @ leg.B_s) + 0.5 * ((theta - q) ** 2 @ leg.K),
        V_3=V_3, V_4=V_4, tank=energy, empty=empty,
        x=theta @ (leg.J @ leg.static).T, x_hat=y, shaped_inertia=leg.B_s,
    )  # fmt: skip


def _works(force: Array, turn: Array) -> Array:
    """∫ forceᵀ dq (N,) by trapezoids."""
    done = (0.5 * (force[1:] + force[:-1]) * turn).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(done)])
