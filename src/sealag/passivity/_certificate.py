"""The certificate: question, answer, assumptions, and the numbers to check them by."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

from sealag.errors import FileError
from sealag.files import write_text
from sealag.passivity._layout import LARGEST_BYTES, UNBOUNDED, encoded

SCHEMA = "sealag-certificate/4"

Time = Annotated[float, UNBOUNDED]
"""A time in s that may be inf: "unbounded" in a file, for what no delay reaches."""

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
"""What a summary leaves out."""


class Status(StrEnum):
    """The answer to the question that was asked."""

    CERTIFIED = "certified"
    NOT_CERTIFIED = "not_certified"


class Criterion(StrEnum):
    """Which criterion was used.

    published: (29), (31) as printed. certified: docs/theory section 6, for the law that is run.
    """

    PUBLISHED = "published"
    CERTIFIED = "certified"


class Basis(StrEnum):
    """What an instant's local margin rests on.

    exact: the margin itself. bound: the passive bound of that instant, which is not above its
    margin, where the loop without delay was decided to be stable. searched: stable likewise, and
    no root crosses at a delay up to this one. open: not decided.
    """

    EXACT = "exact"
    BOUND = "bound"
    SEARCHED = "searched"
    OPEN = "open"


class Place(StrEnum):
    """Where a loop is frozen.

    posture: in the instant's configuration, tasks without error. rest: where it comes to rest with
    the references as they are, with an error where springs sag.
    """

    POSTURE = "posture"
    REST = "rest"


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumption:
    """Something that is taken for granted.

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
    """The instant that sets the answer.

    Attributes:
        instant: its index.
        time_s: its time, s.
        direction: share of each joint in the motion that turns active first.
    """

    instant: int
    time_s: float
    direction: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """The numbers of one instant from which everything can be checked again.

    With W_i = d Q_i ≻ 0 and

        [[2D − Σ J_iᵀ W_i J_i, d M_1, …, d M_k], [⋆, diag(W_1 … W_k)]] ⪰ 0

    the delayed loop dissipates for delays up to d: (29), or (31) for several priority levels, times
    −2. Criterion published: J_i are the levels' rows of J*, M_i = J_iᵀ S_i, and W_i is (m_i, m_i).
    Criterion certified: one multiplier in joint coordinates, J_1 = I, M_1 = F, W_1 is (n, n).

    Attributes:
        instant: index of the instant.
        delay_s: d, s.
        J_star: (m, n).
        stiffness: (m, m) task stiffness S.
        F_gravity: (n, n) gradient of the fed-back gravity compensation.
        F: (n, n) delayed stiffness −∂τ_osc/∂θ of the criterion.
        W: multipliers W_i.
        Q: multipliers Q_i = W_i / d of (29), (31) and of the storage function V_4.
    """

    instant: int
    delay_s: float
    J_star: list[list[float]]
    stiffness: list[list[float]]
    F_gravity: list[list[float]]
    F: list[list[float]]
    W: list[list[list[float]]]
    Q: list[list[list[float]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A set of delayed stiffnesses that the motion stays in for a while.

    All F = centre + Σ c_k axis_k + Δ with |c_k| ≤ 1 and ‖d D^-½ Δ W^-½‖₂ ≤ radius, where d and W
    are delay and multiplier of the time-varying bound.

    Attributes:
        first: first instant.
        last: last instant.
        centre: (n, n) Nm/rad.
        axes: half edges of the box, (n, n) each, Nm/rad.
        radius: of the ball around it.
    """

    first: int
    last: int
    centre: list[list[float]]
    axes: list[list[list[float]]]
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalLoop:
    """The frozen loop at the critical instant, ẋ = A_0 x + A_1 x(t − d) + A_e x(t − e).

    Attributes:
        A_0: (s, s) what acts at once, 1/s.
        A_1: (s, s) what the delay d makes late, 1/s.
        A_e: (s, s) what the embedded delay e makes late, 1/s; None if nothing is.
        embedded_delay_s: e, s.
        symmetries: (s, k) x along which nothing acts: A_0 x = A_1 x = A_e x = 0.
        states: (s,) names: z0 … coordinates of the motions that the contacts leave free,
            theta:JOINT motor angles, `d/dt` of each, drive:JOINT the torque of a motor with a
            bandwidth, tank:ROW the states of the energy tank.
        at: where it is frozen. In the posture A_1 holds the F of the bound; at rest J* and S are
            those of the configuration there.
        frequency_rad_s: of the roots that cross at `first_crossing_s`; None where none does, or
            none is known.
    """

    A_0: list[list[float]]
    A_1: list[list[float]]
    A_e: list[list[float]] | None
    embedded_delay_s: float
    symmetries: list[list[float]]
    states: list[str]
    at: Place
    frequency_rad_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """Answer of `sealag certify`. It has no truth value: read `status`.

    A time is inf, and "unbounded" in the file, where no delay is too long; None, and null in the
    file, means not known, or not asked for where it says so.

    Attributes:
        status: certified or not.
        criterion: the criterion that was used.
        max_delay_s: smallest bound over the motion, s; 0 where a condition of the criterion fails.
        max_delay_upper_s: no longer delay satisfies the criterion at the worst instant, s.
        delay_s: upper bound of the design's own delay d_1, s.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖ over the motion, F the criterion's stiffness.
        contraction: largest contraction factor of q̄(θ) over the motion.
        worst: the instant that sets the bound.
        critical: the instant that sets the local margin.
        worst_motion: (2, n) real and imaginary part of the motor velocities y in the motion that
            turns active first at the worst instant: d |y* F y| = y* D_θ y = 1 at the supremum d.
        instants: number of instants.
        feedback: the signal that is fed back.
        gravity: how gravity is compensated.
        stiffness_form: how stiffness follows from K_x and Λ.
        task_inertia: which Λ that is.
        levels: (k + 1,) first task row of each priority level, then m.
        stable: whether the loop is stable without delay at all instants; None where that is not
            decided at one of them, and unstable at none.
        local_margin_s: smallest exact local delay margin over all instants, s; 0 where a mode is
            unstable without delay.
        first_crossing_s: delay at which one more pair of roots crosses at the critical instant, s;
            the local margin where no root is unstable without delay.
        unstable_modes: roots with positive real part without delay, the most over all instants.
        instant_margins_s: (N,) local margin at each instant, or what is known not to exceed it.
        instant_basis: (N,) what each of these rests on.
        local_loop: the frozen loop at the critical instant.
        equilibrium: where the loop rests; None for a motion.
        conservatism: local margin over max_delay_s; None where either is 0 or unbounded too.
        common_multiplier_delay_s: bound with one multiplier for the whole motion, which V_4 needs;
            None if it was not asked for.
        common_multiplier: (n, n) that multiplier W, in joint coordinates.
        time_varying_delay_s: bound for matrices that vary as they like inside polytopes around
            the motion, window by window, s; None if it was not asked for.
        time_varying_multiplier: (n, n) its multiplier W.
        time_varying_windows: those polytopes, each with the ball around it.
        left_open: why a solver proved no longer delay, by the name of the bound: `max_delay_s`,
            `common_multiplier_delay_s`, `time_varying_delay_s`. Such a bound below the design's
            delay is no answer, and the design is not certified.
        published_max_delay_s: what (29) or (31) as printed gives for the same design, s.
        reasons: why it is not certified.
        assumptions: what is taken for granted.
        joints: names, in the order of all arrays.
        D_theta: (n,) motor damping, Nms/rad.
        spring_stiffness: (n,) K, Nm/rad.
        spring_damping: (n,) D_s beside the springs, Nms/rad.
        viscous_friction: (n,) at the motors, Nms/rad.
        motor_inertia: (n,) B_s, kg m².
        rotor_inertia: (n,) B, kg m².
        torque_bandwidth: (n,) of the drives, rad/s; None for an ideal one.
        time_s: (N,) instants.
        bounds_s: (N,) bound at each.
        proofs: numbers to check, for the instants with the smallest bounds and those that bind the
            common multiplier.
        hashes: SHA-256 of the URDF and the project file; in a file also of its own content.
        versions: of sealag and the libraries that computed it.
        schema: layout of this file.
    """

    status: Status
    criterion: Criterion
    max_delay_s: Time
    max_delay_upper_s: Time
    delay_s: float
    asymmetry: float | None
    contraction: float | None
    worst: Worst
    critical: Critical
    worst_motion: list[list[float]]
    instants: int
    feedback: str
    gravity: str
    stiffness_form: str
    task_inertia: str
    levels: list[int]
    stable: bool | None
    local_margin_s: Time | None
    first_crossing_s: Time | None
    unstable_modes: int
    instant_margins_s: list[Time | None]
    instant_basis: list[Basis]
    local_loop: LocalLoop | None
    equilibrium: Rest | None
    conservatism: float | None
    common_multiplier_delay_s: Time | None
    common_multiplier: list[list[float]] | None
    time_varying_delay_s: Time | None
    time_varying_multiplier: list[list[float]] | None
    time_varying_windows: tuple[Window, ...]
    left_open: Mapping[str, str]
    published_max_delay_s: Time
    reasons: tuple[str, ...]
    assumptions: tuple[Assumption, ...]
    joints: tuple[str, ...]
    D_theta: list[float]
    spring_stiffness: list[float]
    spring_damping: list[float]
    viscous_friction: list[float]
    motor_inertia: list[float]
    rotor_inertia: list[float]
    torque_bandwidth: list[float | None]
    time_s: list[float]
    bounds_s: list[Time]
    proofs: tuple[Proof, ...]
    hashes: Mapping[str, str]
    versions: Mapping[str, str]
    schema: str = field(default=SCHEMA)

    def __bool__(self) -> NoReturn:
        """Refuse to be a truth value: a certificate that says no is still a certificate."""
        raise TypeError("A certificate has no truth value; read its `status`.")

    def summary(self) -> dict[str, Any]:
        """Return the answer without the long arrays, as `sealag certify --json` prints it."""
        return {key: value for key, value in encoded(self, Certificate).items() if key not in _LONG}

    def to_json_dict(self) -> dict[str, Any]:
        """Return everything, as the file says it, with the digest of it."""
        data = encoded(self, Certificate)
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
