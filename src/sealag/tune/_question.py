"""What is asked: which gain, for which number, how the knob is shared."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sealag.design import System
from sealag.errors import InputError, either
from sealag.robot import Motion

LARGEST_SAFETY = 1e3
MOST_INSTANTS = 20_000
"""Instants whose matrices are held at once: 30 joints with 12 directions take 2 GB."""


class Aim(StrEnum):
    """What is made as large or as small as the delay allows."""

    STIFFNESS = "stiffness"
    BANDWIDTH = "bandwidth"
    DAMPING = "damping"
    DRAG = "drag"
    SHAPING = "shaping"
    MAPPING = "mapping"
    OPTIMAL = "optimal"
    FRONT = "front"
    SCHEDULE = "schedule"


class Limit(StrEnum):
    """What a design must keep to besides the delay."""

    BANDWIDTH = "bandwidth"
    RMS = "rms"
    NOISE = "noise"
    ERROR = "error"
    TORQUE = "torque"
    RATE = "rate"


_TRANSPARENCY = frozenset({Limit.BANDWIDTH, Limit.RMS})
_TAKEN = {
    Aim.STIFFNESS: _TRANSPARENCY,
    Aim.DAMPING: _TRANSPARENCY,
    Aim.DRAG: _TRANSPARENCY,
    Aim.FRONT: _TRANSPARENCY,
    Aim.SHAPING: frozenset({Limit.NOISE}),
    Aim.OPTIMAL: frozenset({Limit.ERROR, Limit.TORQUE}),
    Aim.SCHEDULE: frozenset({Limit.RATE}),
}
"""Which limits each aim takes; none for the others."""
_SHARED = (Aim.STIFFNESS, Aim.OPTIMAL)
"""Aims whose stiffness may have more than one factor."""


class Number(StrEnum):
    """Which of the three delays must reach the required one."""

    PASSIVE = "passive"
    JITTER = "jitter"
    CONSTANT = "constant"


class Share(StrEnum):
    """What has a factor of its own: all tasks together, each task, each direction or joint."""

    COMMON = "common"
    TASK = "task"
    DIRECTION = "direction"


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What `tune` is asked.

    Attributes:
        system: the design, with the delay that is asked about.
        motion: its instants; None for the posture.
        aim: which gain.
        number: which delay counts.
        share: what has a factor of its own.
        required: the delay that the number must reach, s: safety times that of the design.
        bandwidth: of joint PD, rad/s; None for the largest.
        damping_ratio: of joint PD.
        limits: of transparency: least bandwidth of the locked joints, Hz; largest RMS of Γ_sea
            against its command along the motion, Nm; of shaping: largest gain of torque noise; of
            the quadratic index: the error (m or rad) that counts as much as the torque (Nm); of
            a schedule: the largest rate of log K_x, 1/s.
    """

    system: System
    motion: Motion | None
    aim: Aim
    number: Number
    share: Share
    required: float
    bandwidth: float | None
    damping_ratio: float
    limits: Mapping[Limit, float]

    def __post_init__(self) -> None:
        """Refuse what has no answer.

        Raises:
            InputError: the parts do not fit together, or the motion is too long.
        """
        self.system.require_law("Tuned gains are")
        if self.motion is not None and len(self.motion) > MOST_INSTANTS:
            raise InputError(
                f"The motion has {len(self.motion)} instants; tune takes {MOST_INSTANTS} at most. "
                "Tune for fewer of its rows, and certify the motion with the gains."
            )
        if self.share is not Share.COMMON and (
            self.aim not in _SHARED or self.number is not Number.PASSIVE
        ):
            raise InputError(
                f"A factor for each {self.share} is found for the largest or the optimal stiffness "
                "by the passive number only; let the share be common."
            )
        if self.aim in (Aim.OPTIMAL, Aim.FRONT, Aim.SCHEDULE) and self.number is not Number.PASSIVE:
            raise InputError(
                f"The aim {self.aim} is a program of the passive bound; let the number be passive."
            )
        if self.aim is not Aim.BANDWIDTH and self.bandwidth is not None:
            raise InputError(
                "A bandwidth is given, but the aim is another; leave one of them out, or aim at "
                "bandwidth."
            )
        if self.aim is Aim.DRAG and (self.motion is None or len(self.motion) < 2):
            raise InputError(
                "Drag is what motor damping takes along a motion; give a motion (--motion), or "
                "aim at damping."
            )
        if self.aim is Aim.BANDWIDTH and not pd_keys(self.system):
            raise InputError(
                f"{self.system.name} has no joint PD whose bandwidth could be set "
                '(controller.kind = "joint_pd"); aim at stiffness.'
            )
        if self.aim is Aim.MAPPING and not self.system.law.damped:
            raise InputError(
                f"No task of {self.system.name} has a damping, which drives could take over "
                '(damping in [[tasks]], or damping_at = "controller" of joint PD).'
            )
        self._check_limits()
        if self.aim is Aim.SHAPING and not self.system.delays.embedded_period > 0.0:
            raise InputError(
                f"{self.system.name} states no period of its drives' loop, which bounds the "
                "shaping; give embedded_period_ms in [delays]."
            )
        if self.aim is Aim.FRONT or set(self.limits) & _TRANSPARENCY:
            self._check_transparency()

    @property
    def moves(self) -> bool:
        """Whether it has a motion of two instants and more, of which there are means."""
        return self.motion is not None and len(self.motion) > 1

    def _check_limits(self) -> None:
        """Refuse limits that the aim does not keep."""
        taken = _TAKEN.get(self.aim, frozenset())
        for limit in self.limits:
            if limit not in taken:
                aims = [str(aim) for aim, limits in _TAKEN.items() if limit in limits]
                raise InputError(
                    f"The limit {limit} is for --aim {either(aims)}, not for {self.aim}; leave it "
                    "out."
                )
        if self.aim is Aim.OPTIMAL and set(self.limits) != taken:
            raise InputError(
                "The quadratic index weighs errors against torques; give the error that counts as "
                "much as the torque (--limit error=0.02 --limit torque=30Nm)."
            )
        if self.aim is Aim.SCHEDULE and not (self.limits and self.moves):
            raise InputError(
                "A schedule follows a motion, at a rate that is bounded; give both (--motion, "
                "--limit rate=2, in 1/s: at most twice its own size a second)."
            )
        if self.limits and self.number is not Number.PASSIVE and self.aim is not Aim.SHAPING:
            raise InputError(
                "Limits are kept for the passive number only; leave --limit out, or --number."
            )

    def _check_transparency(self) -> None:
        """Refuse what the closed forms of transparency leave out."""
        if Limit.RMS in self.limits and not self.moves:
            raise InputError(
                "The RMS of the torque against its command is one along a motion; give a motion "
                "(--motion), or limit the bandwidth."
            )
        drives = self.system.actuators
        for key, there in (
            ("spring_damping", drives.spring_damping > 0.0),
            ("viscous_friction", drives.viscous_friction > 0.0),
            ("torque_bandwidth", np.isfinite(drives.torque_bandwidth)),
        ):
            if there.any():
                joint = drives.joints[int(there.argmax())]
                raise InputError(
                    f"{joint} has {key}, which the closed forms of transparency leave out; remove "
                    "it, or leave --limit out."
                )


def pd_keys(system: System) -> object | None:
    """Return the keys of a project's joint PD; None if its law is another.

    Args:
        system: the design.
    """
    if system.source is None:
        return None
    keys = system.source.project.controller
    return keys if keys.kind == "joint_pd" else None
