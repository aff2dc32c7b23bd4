"""Lyapunov-Krasovskii storage functions V_1 … V_4 (the paper's Section IV-B).

S_j = V_1 is the joint side's, S_c = V_2 + V_3 + V_4 the controller side's; the two meet at the port
(τ_sea, q̇_j). Along the frozen law with motor-side stiffness F and a multiplier Y for the delay d,
d/dt (V_1 + V_2 + V_3 + V_4) ≤ −θ̇ᵀ D θ̇ + ½ θ̇ᵀ Y θ̇ + ½ d² θ̇ᵀ F Y⁻¹ Fᵀ θ̇ ≤ 0.
"""

from dataclasses import dataclass, field

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike


def link_storage(M: ArrayLike, v: ArrayLike, gravity_potential: float) -> float:
    """Return V_1 = ½ vᵀ M v + U_g, J.

    Args:
        M: (nv, nv) mass matrix.
        v: (nv,) velocity.
        gravity_potential: U_g, J.
    """
    rate = np.asarray(v, dtype=float)
    return 0.5 * float(rate @ np.asarray(M, dtype=float) @ rate) + gravity_potential


def motor_storage(
    B_s: ArrayLike, theta_dot: ArrayLike, K: ArrayLike, *, tau_sea: ArrayLike
) -> float:
    """Return V_2 = ½ θ̇ᵀ B_s θ̇ + ½ τ_seaᵀ K⁻¹ τ_sea, J.

    Args:
        B_s: (n,) shaped motor inertia, kg m².
        theta_dot: (n,) motor velocity, rad/s.
        K: (n,) spring stiffness, Nm/rad.
        tau_sea: (n,) spring torque, Nm.
    """
    rate, torque = np.asarray(theta_dot, dtype=float), np.asarray(tau_sea, dtype=float)
    return 0.5 * float(rate @ (np.asarray(B_s) * rate) + torque @ (torque / np.asarray(K)))


def task_storage(F: ArrayLike, deviation: ArrayLike) -> float:
    """Return V_3 = ½ δᵀ F δ, the frozen potential of the fed-back law, J.

    Args:
        F: (n, n) symmetric motor-side stiffness −∂τ_osc/∂θ, Nm/rad; or S in task coordinates.
        deviation: (n,) δ = θ − θ_0 from the equilibrium; or the task error.
    """
    delta = np.asarray(deviation, dtype=float)
    return 0.5 * float(delta @ np.asarray(F, dtype=float) @ delta)


def delay_storage(time: ArrayLike, theta_dot: ArrayLike, Y: ArrayLike, *, delay: float) -> float:
    """Return V_4 = 1/(2d) ∫_{t−d}^{t} (ξ − t + d) θ̇(ξ)ᵀ Y θ̇(ξ) dξ, J.

    The double integral of Section IV-B with Q = Y / d, by the trapezoidal rule.

    Args:
        time: (N,) s, increasing, the last one t; from t − d at the latest.
        theta_dot: (N, n) motor velocities, rad/s.
        Y: (n, n) multiplier.
        delay: d, s.

    Raises:
        InputError: the history is shorter than the delay, or the delay is not positive.
    """
    times, rates = np.asarray(time, dtype=float), np.asarray(theta_dot, dtype=float)
    if not delay > 0.0 or times[0] > times[-1] - delay + 1e-12:
        raise InputError("V_4 needs a positive delay and a history at least as long.")
    begin = times[-1] - delay
    first = np.array([np.interp(begin, times, rates[:, j]) for j in range(rates.shape[1])])
    inside = times > begin
    t = np.concatenate([[begin], times[inside]])
    w = np.vstack([first, rates[inside]])
    power = np.einsum("ki,ij,kj->k", w, np.asarray(Y, dtype=float), w)
    weighted = (t - begin) * power
    return float(np.sum(0.5 * (weighted[1:] + weighted[:-1]) * np.diff(t))) / (2.0 * delay)


@dataclass(slots=True)
class DelayStorage:
    """V_4 step by step for evenly spaced samples, in constant time and memory a step.

    Attributes:
        Y: (n, n) multiplier.
        delay: d, s; a whole number of steps is used.
        step: time between samples, s.
    """

    Y: Array
    delay: float
    step: float
    _ring: Array = field(init=False)
    _next: int = field(init=False, default=0)
    _plain: float = field(init=False, default=0.0)
    _ramp: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        """Allocate the window.

        Raises:
            InputError: the delay is shorter than a step, or the step is not positive.
        """
        if not self.step > 0.0 or round(self.delay / self.step) < 1:
            raise InputError("V_4 needs a positive step and a delay of at least one step.")
        self._ring = np.zeros(round(self.delay / self.step))

    def update(self, theta_dot: ArrayLike) -> float:
        """Take the newest motor velocity and return V_4, J.

        Args:
            theta_dot: (n,) rad/s.
        """
        rate = np.asarray(theta_dot, dtype=float)
        power, count = float(rate @ self.Y @ rate), len(self._ring)
        oldest = self._ring[self._next]
        self._ring[self._next] = power
        self._next = (self._next + 1) % count
        # The ramp (ξ − t + d)/d falls by 1/count a step for all samples in the window.
        self._ramp += power - self._plain / count
        self._plain += power - oldest
        return 0.5 * self.step * (self._ramp - 0.5 * power)
