"""From gains to an answer: the number that they reach, what stops them, the certificate."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from sealag.design import System, certify
from sealag.errors import ContractionError, InputError, SolverError
from sealag.passivity import Certificate, Criterion, Status
from sealag.tune._curve import number_along
from sealag.tune._findings import Index, Point, Replaced
from sealag.tune._question import Aim, Number, Question, pd_keys
from sealag.tune._room import transparency_of
from sealag.tune._write import as_file, kd_of_file
from sealag.typing import Array
from sealag.units import time_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Binding:
    """What stops a gain.

    Attributes:
        kind: "delay"; "index" where the quadratic index is least; "transparency" where its limit
            keeps damping away that the delay asks for;
            "period" or "noise" where it bounds the shaping; "spring" where the springs have more of
            the limiting compliance; "stability" where the loop loses its stability before its
            passivity, or even without delay.
        instant: index of the instant.
        time_s: its time, s.
        joint: the joint with the largest share in the limiting motion.
        joints: that share of each joint.
        spring_share: part of the limiting compliance that is the springs'; the delay has the rest.
            0 where a margin is searched.
    """

    kind: str
    instant: int
    time_s: float
    joint: str
    joints: Mapping[str, float]
    spring_share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """Gains for a delay.

    Attributes:
        question: what was asked.
        system: the design with the gains; its `text` is the project file with them. The design
            itself where nothing was found.
        reached_s: the delay that counts, with the gains, s; None if not known.
        found: whether it is as long as required, and the design certified where the number is the
            passive one.
        scale: common factor of the old stiffness; None for other aims and shares.
        limit: at the boundary itself: the common factor, the mean of the groups' factors, the
            bandwidth (rad/s), the cost of the damping (Nms/rad, or J), or by how much less than
            the passive damping a margin needs, or the quadratic index; None where nothing bounds
            it.
        bandwidth_rad_s: of joint PD; None for other aims.
        factors: of each group of gains; empty for other aims.
        binding: what stops the gains; None where they reach no delay.
        certificate: of the design with the gains, or with those that fail whatever they are; None
            if none were tried.
        reasons: why the delay is not reached, in words.
        mapping: how well drives replace the controller's damping; None for other aims.
        index: the quadratic index; None for other aims.
        front: designs that no other one beats; empty for other aims.
    """

    question: Question
    system: System
    reached_s: float | None = None
    found: bool = False
    scale: float | None = None
    limit: float | None = None
    bandwidth_rad_s: float | None = None
    factors: Mapping[str, float]
    binding: Binding | None = None
    certificate: Certificate | None = None
    reasons: tuple[str, ...] = ()
    mapping: Replaced | None = None
    index: Index | None = None
    front: tuple[Point, ...] = ()

    @classmethod
    def none(cls, question: Question, *reasons: str) -> "Tuned":
        """Return that there are no gains.

        Args:
            question: what was asked.
            reasons: why, in words.
        """
        return cls(question=question, system=question.system, factors={}, reasons=reasons)

    @classmethod
    def of(
        cls,
        question: Question,
        design: System,
        *,
        kind: str = "delay",
        spring_share: float = 0.0,
        factors: Mapping[str, float] | None = None,
        **known: Any,
    ) -> "Tuned":
        """Certify a design as its file will describe it, and say what stops its gains.

        Args:
            question: what was asked.
            design: the design with the gains.
            kind: what stops them, as `Binding` says it.
            spring_share: as `Binding` says it.
            factors: of each group of gains.
            known: scale, limit and bandwidth_rad_s.

        Raises:
            SolverError: the certificate's own check could not confirm it.
        """
        design = as_file(question.system, design)
        certificate = certify(design, question.motion, criterion=Criterion.CERTIFIED).confirmed()
        reached, binding, reasons = _judged(question, design, certificate)
        if not reached and reasons:  # a condition fails, whatever the gains
            none = cls.none(question, *reasons)
            return replace(none, reached_s=reached, certificate=certificate)
        found = reached is not None and reached >= question.required and not reasons
        if not (found or reasons):
            reasons = (
                f"the gains tolerate {time_text(reached)}, and {time_text(question.required)} are "
                "required",
            )
        if binding is not None:
            kind = "spring" if spring_share > 0.5 else kind
            binding = Binding(**{**asdict(binding), "kind": kind, "spring_share": spring_share})
        return cls(
            question=question,
            system=design,
            reached_s=reached,
            found=found,
            factors=factors or {},
            binding=binding,
            certificate=certificate,
            reasons=reasons,
            **known,
        )

    @property
    def passive_only(self) -> bool:
        """Whether the gains are passive as required and no equilibrium is shown to be stable, as of
        a walk on point feet, which something else must hold."""
        certificate, reached = self.certificate, self.reached_s
        return (
            self.question.number is Number.PASSIVE
            and certificate is not None
            and certificate.answer.status is Status.PASSIVE_ONLY
            and reached is not None
            and reached >= self.question.required
        )

    def pick(self, number: int) -> "Tuned":
        """Return the certified design of a point of the front.

        Args:
            number: of the point.

        Raises:
            InputError: there is no such point.
        """
        if not 1 <= number <= len(self.front):
            raise InputError(f"The front has no point {number}; it has 1 … {len(self.front)}.")
        point = self.front[number - 1]
        design = Tuned.of(self.question, point.system, scale=point.scale)
        return replace(design, front=self.front)

    def tolerated(self, shares: Sequence[float]) -> Array:
        """Return the question's number of the gains times each share, (N,) s; NaN where not known.

        Shares are those of the stiffness; of the damping where the least was asked for, and of the
        bandwidth of joint PD at its damping ratio.

        Args:
            shares: positive factors.

        Raises:
            InputError: shaping was asked for, of which no delay depends.
        """
        return number_along(self.question, self.system, shares)

    def gains(self) -> dict[str, Any]:
        """Return the design's gains by the names that its project file has for them."""
        law, joints = self.system.law, self.system.robot.joints
        found: dict[str, Any] = {}
        if pd_keys(self.system):
            found["kp"] = dict(zip(joints, np.asarray(law.tasks[0].stiffness).tolist()))
            found["kd"] = dict(zip(joints, kd_of_file(self.system).tolist()))
        else:
            found["K_x"] = {task.name: np.asarray(task.stiffness).tolist() for task in law.tasks}
        found["D_theta"] = dict(zip(joints, self.system.actuators.motor_damping.tolist()))
        if self.question.aim is Aim.SHAPING:
            found["inertia_shaping"] = dict(
                zip(joints, self.system.actuators.inertia_shaping.tolist())
            )
        return found

    def summary(self) -> dict[str, Any]:
        """Return everything as JSON says it: None for what is not known or does not exist."""
        asked, reached, certificate = self.question, self.reached_s, self.certificate
        joints = self.system.robot.joints
        return {
            "found": self.found,
            "aim": asked.aim.value,
            "number": asked.number.value,
            "share": asked.share.value,
            "delay_s": asked.system.delays.d_1,
            "required_s": asked.required,
            "reached_s": "unbounded" if reached == np.inf else reached,
            "scale": self.scale,
            "limit": self.limit,
            "bandwidth_rad_s": self.bandwidth_rad_s,
            "factors": dict(self.factors),
            **self.gains(),
            "limits": dict(asked.limits),
            "transparency": transparency_of(asked, self.system),
            "binding": None if self.binding is None else asdict(self.binding),
            "mapping": None if self.mapping is None else self.mapping.summary(joints),
            "index": None if self.index is None else asdict(self.index),
            "front": [point.summary() for point in self.front],
            "certificate": None if certificate is None else certificate.summary(),
            "reasons": list(self.reasons),
        }


def _of(question: Question, margins: Any) -> float | None:
    """The jitter or the constant margin, s."""
    return margins.jitter_s if question.number is Number.JITTER else margins.delay_s


def _judged(
    question: Question, design: System, certificate: Certificate
) -> tuple[float | None, Binding | None, tuple[str, ...]]:
    """The number that is reached, where and by which joint it is limited, and what fails."""
    if question.number is Number.PASSIVE:
        answer = certificate.answer
        reached: float | None = answer.max_delay_s
        place = (answer.worst.instant, answer.worst.time_s, answer.worst.direction)
        failing = () if answer.status is Status.CERTIFIED else answer.reasons
    else:
        try:
            margins = design.local_margins(question.motion)
        except (ContractionError, SolverError) as error:
            return None, None, (str(error),)
        reached, failing = _of(question, margins), ()
        place = (margins.instant, margins.time_s, margins.mode)
    if not reached:
        return reached, None, failing
    instant, time_s, joints = place
    joint = max(joints, key=lambda name: joints[name])
    binding = Binding(
        kind="delay", instant=instant, time_s=time_s, joint=joint, joints=joints, spring_share=0.0
    )
    return reached, binding, failing
