"""The certificate: question, answer, and the evidence to check the answer by."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np

from sealag.errors import FileError
from sealag.files import write_text
from sealag.passivity._checks import Check
from sealag.passivity._claims import claim_checks
from sealag.passivity._definite import Reader, doubles, rationals
from sealag.passivity._kinds import Basis, Criterion, Status
from sealag.passivity._layout import LARGEST_BYTES, SECTION, Matrix, Time, Vector, encoded
from sealag.passivity._local import LocalLoop, without_loop
from sealag.passivity._proofs import InstantProof, Window, common_checks, window_checks
from sealag.passivity._supremum import worst_checks
from sealag.typing import Array

SCHEMA = "sealag-certificate/4"

_LONG = {
    "time_s",
    "bounds_s",
    "instant_margins_s",
    "instant_basis",
    "proofs",
    "worst_motion",
    "local_loop",
    "common_multiplier",
    "time_varying_multiplier",
    "time_varying_windows",
}
"""The evidence, which a summary leaves out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumption:
    """Something that is assumed and not checked.

    Attributes:
        key: a short name that stays the same from one certificate to the next.
        text: the assumption, in a sentence.
    """

    key: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """Where the loop of a single posture rests.

    Attributes:
        found: whether an equilibrium was found near the posture.
        moved_rad: largest joint distance between the posture and where the loop rests, rad.
    """

    found: bool
    moved_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Critical:
    """The instant that sets the local margin: the smallest, among zeros the most unstable.

    Attributes:
        instant: its index.
        time_s: its time, s.
    """

    instant: int
    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Worst:
    """The instant with the smallest bound.

    Attributes:
        instant: its index.
        time_s: its time, s.
        direction: share of each joint in the motion that first turns the delayed loop active.
    """

    instant: int
    time_s: float
    direction: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What was asked, and of which design.

    Attributes:
        criterion: published or certified.
        delay_s: upper bound of the design's own delay d_1, s.
        joints: names, in the order of all arrays.
        instants: number of instants.
        levels: (k + 1,) first task row of each priority level, then m.
        feedback: the signal that is fed back.
        gravity: how gravity is compensated.
        stiffness_form: how stiffness follows from K_x and Λ.
        task_inertia: which Λ that is.
        D_theta: (n,) motor damping, Nms/rad.
        spring_stiffness: (n,) K, Nm/rad.
        spring_damping: (n,) D_s beside the springs, Nms/rad.
        viscous_friction: (n,) at the motors, Nms/rad.
        motor_inertia: (n,) B_s, kg m².
        rotor_inertia: (n,) B, kg m².
        torque_bandwidth: (n,) of the drives, rad/s; None for an ideal one.
        hashes: SHA-256 of the URDF and the project file; in a file also of its own content.
    """

    criterion: Criterion
    delay_s: float
    joints: Annotated[tuple[str, ...], "n"]
    instants: Annotated[int, "N"]
    levels: tuple[int, ...]
    feedback: str
    gravity: str
    stiffness_form: str
    task_inertia: str
    D_theta: Vector
    spring_stiffness: Vector
    spring_damping: Vector
    viscous_friction: Vector
    motor_inertia: Vector
    rotor_inertia: Vector
    torque_bandwidth: Annotated[tuple[float | None, ...], "n"]
    hashes: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What is claimed.

    A time is inf, and "unbounded" in the file, where no delay is too long; None, and null in the
    file, means not known, or not asked for where it says so.

    Attributes:
        status: certified or not.
        reasons: why it is not certified.
        max_delay_s: smallest bound over the motion, s; 0 where a condition of the criterion fails.
        max_delay_upper_s: no longer delay satisfies the criterion at the worst instant, s.
        worst: the instant that sets the bound.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖ over the motion, F the criterion's stiffness.
        contraction: largest contraction factor of q̄(θ) over the motion.
        published_max_delay_s: what (29) or (31) as printed gives for the same design, s.
        common_multiplier_delay_s: bound with one multiplier for the whole motion, which V_4 needs;
            None if it was not asked for.
        time_varying_delay_s: bound for matrices that vary as they like inside polytopes around
            the motion, window by window, s; None if it was not asked for.
        left_open: why a solver proved no longer delay, by the name of the bound: `max_delay_s`,
            `common_multiplier_delay_s`, `time_varying_delay_s`. Such a bound below the design's
            delay decides nothing, and the design is not certified.
        stable: whether the loop is stable without delay at all instants; None where that is not
            decided at one of them, and unstable at none.
        unstable_modes: roots with positive real part without delay, the most over all instants.
        local_margin_s: smallest exact local delay margin over all instants, s; 0 where a mode is
            unstable without delay.
        critical: the instant that sets the local margin.
        first_crossing_s: delay at which one more pair of roots crosses at the critical instant, s;
            the local margin where no root is unstable without delay.
        equilibrium: where the loop rests; None for a motion.
        conservatism: local margin over max_delay_s; None where either is 0 or unbounded too.
        assumptions: what is assumed and not checked.
        versions: of sealag and the libraries that computed it.
    """

    status: Status
    reasons: tuple[str, ...]
    max_delay_s: Time
    max_delay_upper_s: Time
    worst: Worst
    asymmetry: float | None
    contraction: float | None
    published_max_delay_s: Time
    common_multiplier_delay_s: Time | None
    time_varying_delay_s: Time | None
    left_open: Mapping[str, str]
    stable: bool | None
    unstable_modes: int
    local_margin_s: Time | None
    critical: Critical
    first_crossing_s: Time | None
    equilibrium: Rest | None
    conservatism: float | None
    assumptions: tuple[Assumption, ...]
    versions: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The numbers from which the answer is checked.

    Attributes:
        time_s: (N,) instants.
        bounds_s: (N,) bound at each.
        instant_margins_s: (N,) local margin at each instant, or what is known not to exceed it.
        instant_basis: (N,) what each of these rests on.
        worst_motion: (2, n) real and imaginary part of the motor velocities y in the motion that
            turns active first at the worst instant: d |y* F y| = y* D_θ y = 1 at the supremum d.
        proofs: of the instants with the smallest bounds and those that bind the common multiplier.
        common_multiplier: (n, n) W of the bound with one multiplier, in joint coordinates.
        time_varying_multiplier: (n, n) W of the time-varying bound.
        time_varying_windows: its polytopes, each with the ball around it.
        local_loop: the frozen loop at the critical instant.
    """

    time_s: Annotated[Array, "N"]
    bounds_s: Annotated[tuple[Time, ...], "N"]
    instant_margins_s: Annotated[tuple[Time | None, ...], "N"]
    instant_basis: Annotated[tuple[Basis, ...], "N"]
    worst_motion: Annotated[Array, "2", "n"]
    proofs: tuple[InstantProof, ...]
    common_multiplier: Matrix | None
    time_varying_multiplier: Matrix | None
    time_varying_windows: tuple[Window, ...]
    local_loop: LocalLoop | None

    def proof_of(self, instant: int) -> InstantProof | None:
        """Return the proof of an instant, if there is one.

        Args:
            instant: its index.
        """
        return next((proof for proof in self.proofs if proof.instant == instant), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """Answer of `sealag certify`. It has no truth value: read `answer.status`.

    In a file the fields of all three parts stand side by side.

    Attributes:
        question: what was asked, and of which design.
        answer: what is claimed.
        evidence: the numbers from which the answer is checked.
        schema: layout of the file.
    """

    question: Annotated[Question, SECTION]
    answer: Annotated[Answer, SECTION]
    evidence: Annotated[Evidence, SECTION]
    schema: str = field(default=SCHEMA)

    def __bool__(self) -> NoReturn:
        """Refuse to be a truth value: a certificate that says no is still a certificate."""
        raise TypeError("A certificate has no truth value; read its `answer.status`.")

    def checks(self, *, exact: bool = False) -> Iterator[Check]:
        """Check every claim and every inequality again from the certificate's own numbers.

        Args:
            exact: decide definiteness in rational arithmetic instead of floating point with a
                rounding bound.
        """
        yield from claim_checks(self)
        q = self.question
        if all((values > 0.0).all() for values in (q.D_theta, q.spring_stiffness, q.motor_inertia)):
            yield from self._computed(rationals if exact else doubles)

    def _computed(self, number: Reader) -> Iterator[Check]:
        """What needs positive damping, springs and inertia to be computed at all."""
        evidence = self.evidence
        try:
            with np.errstate(all="ignore"):
                yield from worst_checks(self, number)
                for proof in evidence.proofs:
                    yield from proof.checks(self, number)
                yield from common_checks(self, number)
                yield from window_checks(self, number)
                if evidence.local_loop is None:
                    yield without_loop(self)
                else:
                    yield from evidence.local_loop.checks(self)
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            words = f"too large or too small to compute with: {error}"
            yield Check(name="numbers", ok=False, detail=words)

    def summary(self) -> dict[str, Any]:
        """Return question and answer, as `sealag certify --json` prints them."""
        return {key: value for key, value in encoded(self).items() if key not in _LONG}

    def to_json_dict(self) -> dict[str, Any]:
        """Return everything, as the file says it, with the digest of it."""
        data = encoded(self)
        return {**data, "hashes": {**data["hashes"], "content": content_digest(data)}}


def content_digest(data: Mapping[str, Any]) -> str:
    """SHA-256 of a certificate's canonical JSON without this digest itself.

    Args:
        data: the certificate as plain data; doubles have one shortest decimal form, so that
            equal numbers give equal digests.
    """
    others = {key: value for key, value in data["hashes"].items() if key != "content"}
    content = {**data, "hashes": others}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def write_certificate(certificate: Certificate, path: Path) -> None:
    """Write a certificate as JSON, one field a line, through a temporary name.

    Args:
        certificate: what to write.
        path: where; the folder is made if needed.

    Raises:
        FileError: it cannot be written, or is larger than what is read.
    """
    entries = certificate.to_json_dict().items()
    lines = (f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in entries)
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    if len(text) > LARGEST_BYTES:
        raise FileError(
            f"{path} would be larger than {LARGEST_BYTES / 1e6:g} MB; ask for fewer proofs."
        )
    write_text(path, text)
