"""One joint: (29) against the exact boundary that the haptics literature, [22], is about."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._claims import Claim, Verdict
from humanoids2016._leg_loop import Leg
from humanoids2016._unsafe import delayed_margin
from sealag.margin import DelayedLoop
from sealag.passivity import max_delay
from sealag.typing import Array

DAMPING = (1.0, 3.0, 10.0, 30.0, 100.0)  # Nms/rad
STIFFNESS = (10.0, 30.0, 100.0, 300.0, 1000.0)  # Nm/rad
INERTIA = 1.0  # kg m²
ROUNDING = 1e-5
"""Bounds are brackets of relative width 1e-6."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OneJointGrid:
    """Largest delays over damping and stiffness.

    Attributes:
        name: what the joint is.
        bound: (B, K) of (29), s.
        margin: (B, K) exact for a constant delay, s.
    """

    name: str
    bound: Array
    margin: Array


def one_joint_grids(leg: Leg) -> tuple[OneJointGrid, OneJointGrid]:
    """Compute both for a rigid joint, as in [22], and for one on a spring.

    Args:
        leg: whose last joint's spring and motor the second one has.
    """
    D, k = np.meshgrid(DAMPING, STIFFNESS, indexing="ij")
    one = np.eye(1)
    bound = np.vectorize(
        lambda d, f: float(max_delay(one, one, np.array([f]), np.array([d])).delay)
    )(D, k)
    knee = replace(
        leg, M=np.full((1, 1), INERTIA), K=leg.K[-1:], B_s=leg.B_s[-1:], D=leg.D[-1:], J=one,
        S=one,
    )  # fmt: skip
    elastic = np.vectorize(
        lambda d, f: (
            delayed_margin(knee.M, knee.K, knee.B_s, D=np.array([d]), F=np.array([[f]])).delay
        )
    )(D, k)
    return (
        OneJointGrid(name="rigid", bound=bound, margin=np.vectorize(_rigid)(D, k)),
        OneJointGrid(name=f"K = {knee.K[0]:g} Nm/rad", bound=bound, margin=elastic),
    )


def _rigid(damping: float, stiffness: float) -> float:
    """Exact margin of M ẍ + b ẋ = −k x(t − d), s."""
    A_0 = np.array([[0.0, 1.0], [0.0, -damping / INERTIA]])
    A_1 = np.array([[0.0, 0.0], [-stiffness / INERTIA, 0.0]])
    return DelayedLoop(A_0, A_1).margin().delay


def one_joint_claim(grids: Sequence[OneJointGrid]) -> Claim:
    """Check that stiffness, damping and delay stand to each other as in [22].

    Args:
        grids: largest delays.
    """
    linear = np.array(DAMPING)[:, None] / np.array(STIFFNESS)
    cases, each = [], []
    for grid in grids:
        ratio = grid.margin / grid.bound
        cases += [
            *(np.diff(grid.margin, axis=0) > 0.0).ravel(),
            *(np.diff(grid.margin, axis=1) < 0.0).ravel(),
            *(ratio >= 1.0 - ROUNDING).ravel(),
        ]
        each.append(f"{grid.name}: exact over bound from {ratio.min():.4f} to {ratio.max():.3f}")
    cases += (np.abs(grids[0].bound / linear - 1.0) < ROUNDING).ravel().tolist()
    return Claim(
        key="one joint",
        source="Conclusions, 1; [22]",
        published="Stiffness, damping and delay are related as in the one-joint literature: more "
        "stiffness for more damping or less delay.",
        computed=(
            f"On {linear.size} pairs of b and k (29) is k d = b, the linear condition of haptic "
            "displays without friction and hold. The exact boundary of each joint rises with b, "
            "falls with k and is never below: "
            + "; ".join(each)
            + ". It comes down to k d = b where damping is light, and up to π/2 of it where the "
            "damping outweighs a rigid joint's inertia."
        ),
        verdict=Verdict.of(cases),
        tolerance="exact margins strictly monotonic in b and in k, none below (29), and (29) equal "
        f"to b/k to {ROUNDING:g}",
    )
