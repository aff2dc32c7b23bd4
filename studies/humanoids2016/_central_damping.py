"""Section III: whether late damping hurts more than late stiffness."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanoids2016._claims import Claim, Verdict
from sealag.design import System
from sealag.margin import DelayedLoop

CENTRAL_SHARES = (0.0, 0.5, 1.0)
"""Shares of the damping that the central controller computes from rates as late as positions."""

JOINT_STIFFNESS = 100.0
"""Nm/rad of the joint that is held; the paper's K_x has 100 for the CoM."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitDamping:
    """One joint whose damping is split between drive and central controller.

    Attributes:
        joint: its name.
        share: of the damping that is central.
        jitter_s: largest bound of delays that vary in any way, s; 0 if there is none.
        constant_s: largest constant delay, s.
        positions_s: largest constant delay of the positions alone, the rates in time, s.
        rates_s: largest constant delay of the rates alone, the positions in time, s.
    """

    joint: str
    share: float
    jitter_s: float
    constant_s: float
    positions_s: float
    rates_s: float


def split_damping(system: System) -> tuple[SplitDamping, ...]:
    """Move the damping of each kind of joint, in steps, from its drive into the controller.

    The joint hangs on its spring, the rest of the robot held: with y = k θ + s D θ̇ late by d,
    M q̈ = K (θ − q) and B_s θ̈ + (1 − s) D θ̇ + K (θ − q) = −y(t − d).

    Args:
        system: Hume with the paper's D_θ.
    """
    robot, drives = system.robot, system.actuators
    M = robot.workspace_at(system.posture).M[-robot.n :, -robot.n :]
    return tuple(
        _split(name, share, M=M[k, k], K=drives.spring_stiffness[k],
               B_s=drives.shaped_inertia[k], D=drives.motor_damping[k])
        for k, name in enumerate(robot.joints)
        if name.startswith("right_")
        for share in CENTRAL_SHARES
    )  # fmt: skip


def _split(name: str, share: float, *, M: float, K: float, B_s: float, D: float) -> SplitDamping:
    """Margins of one joint; its state is (q, θ, q̇, θ̇)."""
    A_0 = np.zeros((4, 4))
    A_0[0, 2] = A_0[1, 3] = 1.0
    A_0[2, :2] = -K / M, K / M
    A_0[3, :2] = K / B_s, -K / B_s
    A_0[3, 3] = -(1.0 - share) * D / B_s
    B = np.array([[0.0], [0.0], [0.0], [-1.0 / B_s]])
    position = np.array([[0.0, JOINT_STIFFNESS, 0.0, 0.0]])
    rate = np.array([[0.0, 0.0, 0.0, share * D]])
    whole = DelayedLoop(A_0, B, position + rate)
    return SplitDamping(
        joint=name.removeprefix("right_"),
        share=share,
        jitter_s=whole.jitter_margin().delay,
        constant_s=whole.margin().delay,
        positions_s=DelayedLoop(A_0 + B @ rate, B, position).margin().delay,
        rates_s=DelayedLoop(A_0 + B @ position, B, rate).margin().delay if share else np.inf,
    )


def split_claim(rows: Sequence[SplitDamping]) -> Claim:
    """Check that delayed damping costs more than delayed stiffness.

    Args:
        rows: joints with several shares of central damping.
    """
    ms = 1e3
    joints = dict.fromkeys(row.joint for row in rows)
    each = []
    for joint in joints:
        own = [row for row in rows if row.joint == joint]
        jitter = ", ".join(f"{row.jitter_s * ms:.2f}" for row in own)
        full = own[-1]
        each.append(
            f"{joint}: {jitter} ms; all central, rates alone late {full.rates_s * ms:.2f} ms, "
            f"positions alone {full.positions_s * ms:.1f} ms"
        )
    central = [row for row in rows if row.share > 0.0]
    return Claim(
        key="central damping",
        source="Section III; [16]",
        published="Delayed damping costs more stability than delayed stiffness.",
        computed=(
            "Jitter margin of each joint, the others held, with "
            + ", ".join(f"{share:.0%}" for share in CENTRAL_SHARES)
            + f" of D_θ computed centrally beside k = {JOINT_STIFFNESS:g} Nm/rad. "
            + "; ".join(each)
            + "."
        ),
        verdict=Verdict.of(row.rates_s < row.positions_s for row in central),
        tolerance="late rates leave a smaller exact margin than late positions, every joint and "
        "share",
    )
