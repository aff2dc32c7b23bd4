"""How well the spring torque follows its command: the price of damping (docs/theory section 9)."""

from dataclasses import dataclass

import numpy as np

from sealag.actuation._actuators import Actuators
from sealag.typing import Array, ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Transparency:
    """Torque transparency of each joint with the link locked.

    Attributes:
        bandwidth: (n,) frequency at which the amplitude has fallen by 3 dB, Hz.
        damping_ratio: (n,) of the motor on its spring.
        phase_lag: (n,) phase of the spring torque behind the command at 1 Hz, delay included, rad.
    """

    bandwidth: Array
    damping_ratio: Array
    phase_lag: Array


def _torque_transfer(actuators: Actuators, frequency: ArrayLike, *, delay: float = 0.0) -> Array:
    """Return τ_sea / τ_osc = K / (B_s s² + D_θ s + K) · e^{−s d_2} with the link locked.

    Args:
        actuators: the actuators.
        frequency: (F,) Hz.
        delay: feedforward delay d_2, s.

    Returns:
        (F, n) complex transfer.
    """
    s = 2j * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float))[:, None]
    K = actuators.spring_stiffness
    shaped = actuators.shaped_inertia * s**2 + actuators.motor_damping * s + K
    return K / shaped * np.exp(-s * delay)


def transparency(actuators: Actuators, *, delay: float = 0.0) -> Transparency:
    """Compute bandwidth, damping ratio and phase lag of the locked joints in closed form.

    |K / (K − B_s ω² + j D_θ ω)|² = ½ is quadratic in ω².

    Args:
        actuators: the actuators.
        delay: feedforward delay d_2, s.
    """
    K, B_s, D = actuators.spring_stiffness, actuators.shaped_inertia, actuators.motor_damping
    half = D**2 / (2.0 * B_s**2) - K / B_s
    root = np.sqrt(half**2 + (K / B_s) ** 2)
    squared = np.where(half > 0.0, (K / B_s) ** 2 / (root + np.abs(half)), root - half)
    lag = -np.unwrap(np.angle(_torque_transfer(actuators, [1e-3, 1.0], delay=delay)), axis=0)[1]
    return Transparency(
        bandwidth=np.sqrt(squared) / (2.0 * np.pi),
        damping_ratio=D / (2.0 * np.sqrt(K * B_s)),
        phase_lag=lag,
    )
