"""Remark 1: springs with damping, and feedback of the torque's derivative."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanoids2016._live import LiveLeg
from sealag.margin import DelayedLoop
from sealag.typing import Array

SPRING_DAMPING = (0.0, 0.5, 2.0, 8.0)
"""D of Remark 1, Nms/rad of every spring; Hume's is not published."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueRateRow:
    """Exact margins of the stance leg at one spring damping, smallest over the walk.

    Attributes:
        damping: D, Nms/rad.
        without_s: (7) as printed, s.
        with_s: with D K⁻¹ Γ̇_sea fed back beside Γ_sea, s.
        asymmetry: of the damping matrix without that feedback, ‖G − Gᵀ‖ / ‖G + Gᵀ‖; 0 with it.
    """

    damping: float
    without_s: float
    with_s: float
    asymmetry: float


def torque_rate_rows(
    live: LiveLeg, *, damping: Sequence[float] = SPRING_DAMPING
) -> tuple[TorqueRateRow, ...]:
    """Damp the springs, with and without feedback of the torque's derivative.

    Both sides of a spring feel Γ_sea + D K⁻¹ Γ̇_sea. With (7) as printed the shaped motor obeys
    B_s θ̈ + β D K⁻¹ Γ̇_sea + D_θ θ̇ + Γ_sea = Γ_osc; with the derivative fed back β is 1 there.

    Args:
        live: the stance leg along the walk.
        damping: D of all springs, Nms/rad.
    """
    values, V = np.linalg.eigh(live.Lambda)
    root = (V * np.sqrt(np.clip(values, 0.0, None))[:, None, :]) @ np.swapaxes(V, 1, 2)
    S = root @ np.diag(live.gains) @ root
    F = np.swapaxes(live.J_star, 1, 2) @ S @ live.J_star
    rows, beta = [], live.inertia_shaping
    for value in damping:
        margins = np.array([
            [_margin(live, M, one, value, share) for share in (beta, 1.0)]
            for M, one in zip(live.mass, F, strict=True)
        ])  # fmt: skip
        G = _damping(live, value, beta)
        odd, even = np.linalg.norm(G - G.T), np.linalg.norm(G + G.T)
        least = margins.min(axis=0).tolist()
        rows.append(
            TorqueRateRow(
                damping=value, without_s=least[0], with_s=least[1], asymmetry=float(odd / even)
            )
        )
    return tuple(rows)


def _damping(live: LiveLeg, value: float, share: float) -> Array:
    """Damping matrix of (q̇, θ̇), Nms/rad; the motors' rows hold a share of the springs'."""
    D = value * np.eye(3)
    return np.block([[D, -D], [-share * D, share * D + np.diag(live.motor_damping)]])


def _margin(live: LiveLeg, M: Array, F: Array, value: float, share: float) -> float:
    n, K = 3, np.diag(live.spring_stiffness)
    zero = np.zeros((n, n))
    B_s = np.diag(live.inertia_shaping * live.rotor_inertia)
    inertia = np.linalg.inv(np.block([[M, zero], [zero, B_s]]))
    A_0 = np.block([
        [np.zeros((2 * n, 2 * n)), np.eye(2 * n)],
        [-inertia @ np.block([[K, -K], [-K, K]]), -inertia @ _damping(live, value, share)],
    ])  # fmt: skip
    A_1 = np.zeros_like(A_0)
    A_1[2 * n :, n : 2 * n] = -inertia[:, n:] @ F
    return DelayedLoop(A_0, A_1).margin().delay
