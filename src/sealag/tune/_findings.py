"""What an answer holds beside gains: a mapping of damping, a quadratic index, points of a front."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sealag.design import System
from sealag.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Replaced:
    """How well drives replace the controller's damping.

    Attributes:
        damping: (n,) what the drives take over, Nms/rad.
        error: ‖Πᵀ D Π − J*ᵀ D_x J*‖ over ‖J*ᵀ D_x J*‖ (Frobenius), both in root mean square over
            the motion.
        worst: the largest of one instant, over the same mean.
        instant: where.
        jitter_s: jitter margin with all damping in the controller, half of it, and none, s; None
            where it is not known.
    """

    damping: Array
    error: float
    worst: float
    instant: int
    jitter_s: Mapping[str, float | None]

    def summary(self, joints: Sequence[str]) -> dict[str, Any]:
        """Return it as JSON says it.

        Args:
            joints: the robot's.
        """
        return {
            "damping": dict(zip(joints, self.damping.tolist())),
            "error": self.error,
            "worst": self.worst,
            "instant": self.instant,
            "jitter_s": {
                name: "unbounded" if value == float("inf") else value
                for name, value in self.jitter_s.items()
            },
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Index:
    """A quadratic index and what it could be, s.

    Attributes:
        value: of the gains at the boundary itself.
        free: of the same knobs without a delay; below value where the delay stops them.
        least: Riccati's, of any controller of the motors' angles without a delay.
        active: whether the delay stops the gains.
    """

    value: float
    free: float
    least: float
    active: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A design that no other one of a front beats.

    Attributes:
        number: its place in the front, from 1.
        delay_s: what it tolerates by the passive number, s.
        scale: factor of the old stiffness.
        cost: trace of its damping, Nms/rad, or the drag along the motion, J.
        bandwidth_hz: of the slowest locked joint.
        system: the design.
    """

    number: int
    delay_s: float
    scale: float
    cost: float
    bandwidth_hz: float
    system: System

    def summary(self) -> dict[str, Any]:
        """Return it as JSON says it."""
        drives = self.system.actuators
        return {
            "number": self.number,
            "delay_s": self.delay_s,
            "scale": self.scale,
            "cost": self.cost,
            "bandwidth_hz": self.bandwidth_hz,
            "D_theta": dict(zip(drives.joints, drives.motor_damping.tolist())),
        }
