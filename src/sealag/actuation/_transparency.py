"""How well the spring torque follows its command: the price of damping (docs/theory section 9)."""

from dataclasses import dataclass

import numpy as np

from sealag.typing import Array


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


def locked_joints(K: Array, B_s: Array, D: Array, *, delay: float = 0.0) -> Transparency:
    """Compute bandwidth, damping ratio and phase lag of the locked joints in closed form.

    |K / (K − B_s ω² + j D_θ ω)|² = ½ is quadratic in ω².

    Args:
        K: (n,) spring stiffness, Nm/rad.
        B_s: (n,) shaped inertia, kg m².
        D: (n,) motor damping D_θ, Nms/rad.
        delay: feedforward delay d_2, s.
    """
    half = D**2 / (2.0 * B_s**2) - K / B_s
    root = np.sqrt(half**2 + (K / B_s) ** 2)
    squared = np.where(half > 0.0, (K / B_s) ** 2 / (root + np.abs(half)), root - half)
    # From 1 mHz on, so that the phase at 1 Hz is unwound.
    s = 2j * np.pi * np.array([1e-3, 1.0])[:, None]
    transfer = K / (B_s * s**2 + D * s + K) * np.exp(-s * delay)
    return Transparency(
        bandwidth=np.sqrt(squared) / (2.0 * np.pi),
        damping_ratio=D / (2.0 * np.sqrt(K * B_s)),
        phase_lag=-np.unwrap(np.angle(transfer), axis=0)[1],
    )


def most_damping(K: Array, B_s: Array, *, bandwidth: float) -> Array:
    """Return the motor damping at which the locked joints have a bandwidth, (n,) Nms/rad.

    D² ω² = 2 K² − (K − B_s ω²)²: amplitudes that pass −3 dB once have at least that bandwidth
    while D is not larger. NaN where the undamped joint is slower.

    Args:
        K: (n,) spring stiffness, Nm/rad.
        B_s: (n,) shaped inertia, kg m².
        bandwidth: Hz, positive.
    """
    omega = 2.0 * np.pi * bandwidth
    x = B_s * omega**2 / K
    room = (np.sqrt(2.0) - 1.0 + x) * (np.sqrt(2.0) + 1.0 - x)  # does not cancel at small x
    return K / omega * np.sqrt(np.where(room >= 0.0, room, np.nan))
