"""The certificate: question, answer, assumptions, and the numbers to check them by."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from enum import StrEnum
from pathlib import Path
from typing import Any, NoReturn

from sealag.errors import CertificateError
from sealag.files import read_whole, write_text

SCHEMA = "sealag-certificate/3"
LARGEST_BYTES = 500_000_000

_LONG = {
    "time_s",
    "bounds_s",
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

    published: (29), (31) as printed. certified: THEORY section 6, for the law that is run.
    """

    PUBLISHED = "published"
    CERTIFIED = "certified"


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
    """The frozen loop at the worst instant, ẍ + R ẋ + P x + L x(t − d) = 0, x = [z, θ].

    z are k coordinates of the motions that the contacts leave free, θ the n motor angles.

    Attributes:
        P: (k + n, k + n) restoring forces over inertia, 1/s².
        R: (k + n, k + n) damping over inertia, 1/s.
        L: (k + n, k + n) delayed stiffness over inertia, 1/s².
        symmetries: (k + n, s) x along which nothing acts: P x = R x = L x = 0.
        motor_inertia: (n,) B_s, kg m²: P, R and L hold K, D_θ + D_s and F over it.
        spring_damping: (n,) D_s, Nms/rad.
        frequency_rad_s: of the roots that cross at `first_crossing_s`; None where none is known.
    """

    P: list[list[float]]
    R: list[list[float]]
    L: list[list[float]]
    symmetries: list[list[float]]
    motor_inertia: list[float]
    spring_damping: list[float]
    frequency_rad_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """Answer of `sealag certify`. It has no truth value: read `status`.

    Attributes:
        status: certified or not.
        criterion: the criterion that was used.
        max_delay_s: smallest bound over the motion, s; 0 where a condition of the criterion fails.
        max_delay_upper_s: no longer delay satisfies the criterion at the worst instant, s.
        delay_s: upper bound of the design's own delay d_1, s.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖ over the motion, F the criterion's stiffness.
        contraction: largest contraction factor of q̄(θ) over the motion.
        worst: the instant that sets the answer.
        worst_motion: (2, n) real and imaginary part of the motor velocities y in the motion that
            turns active first there: d |y* F y| = y* D_θ y at the supremum d.
        instants: number of instants.
        feedback: the signal that is fed back.
        gravity: how gravity is compensated.
        stiffness_form: how stiffness follows from K_x and Λ.
        task_inertia: which Λ that is.
        levels: (k + 1,) first task row of each priority level, then m.
        stable: whether the potential has a strict minimum at the worst instant, up to symmetries;
            None where that has no meaning.
        local_margin_s: exact local delay margin at the worst instant, s; None for infinity, or
            where it could not be decided.
        first_crossing_s: delay at which one more pair of roots crosses there; None if none does,
            or where it could not be decided.
        unstable_modes: roots with positive real part without delay, there.
        local_loop: the frozen loop there; None where the fed-back signal has none.
        conservatism: local margin over max_delay_s; None where either is 0 or infinite.
        common_multiplier_delay_s: bound with one multiplier for the whole motion, which V_4 needs;
            None if it was not computed.
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
    max_delay_s: float
    max_delay_upper_s: float
    delay_s: float
    asymmetry: float
    contraction: float
    worst: Worst
    worst_motion: list[list[float]]
    instants: int
    feedback: str
    gravity: str
    stiffness_form: str
    task_inertia: str
    levels: list[int]
    stable: bool | None
    local_margin_s: float | None
    first_crossing_s: float | None
    unstable_modes: int
    local_loop: LocalLoop | None
    conservatism: float | None
    common_multiplier_delay_s: float | None
    common_multiplier: list[list[float]] | None
    time_varying_delay_s: float | None
    time_varying_multiplier: list[list[float]] | None
    time_varying_windows: tuple[Window, ...]
    left_open: Mapping[str, str]
    published_max_delay_s: float
    reasons: tuple[str, ...]
    assumptions: tuple[str, ...]
    joints: tuple[str, ...]
    D_theta: list[float]
    spring_stiffness: list[float]
    time_s: list[float]
    bounds_s: list[float]
    proofs: tuple[Proof, ...]
    hashes: Mapping[str, str]
    versions: Mapping[str, str]
    schema: str = field(default=SCHEMA)

    def __bool__(self) -> NoReturn:
        """Refuse to be a truth value: a certificate that says no is still a certificate."""
        raise TypeError("A certificate has no truth value; read its `status`.")

    def summary(self) -> dict[str, Any]:
        """Return the answer without the long arrays, as `sealag certify --json` prints it.

        Numbers that are not finite become null: a delay-independent bound has no number.
        """
        return _strict({k: v for k, v in asdict(self).items() if k not in _LONG})

    def to_json_dict(self) -> dict[str, Any]:
        """Return everything with the digest of it, and null for numbers that are not finite."""
        data = _strict(asdict(self))
        return {**data, "hashes": {**data["hashes"], "content": content_digest(data)}}


def _strict(value: Any) -> Any:
    """Replace what JSON cannot say."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _strict(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(entry) for entry in value]
    return value


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
        FileError: it cannot be written.
    """
    entries = certificate.to_json_dict().items()
    lines = (f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in entries)
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def read_certificate(path: Path) -> dict[str, Any]:
    """Read a certificate file as plain data, checking its layout but none of its claims.

    Args:
        path: the file.

    Raises:
        FileError: it cannot be read.
        CertificateError: it is not a certificate of a known layout.
    """
    return parse_certificate(path)[0]


def parse_certificate(path: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Read a certificate file, and tell which of its numbers are not written as `repr` writes them.

    Such a number has a changed digit that its double does not show.

    Args:
        path: the file.

    Returns:
        The plain data, and those numbers.

    Raises:
        FileError: it cannot be read.
        CertificateError: it is not a certificate of a known layout.
    """
    odd: list[str] = []

    def number(text: str) -> float:
        value = float(text)
        if repr(value) != text:
            odd.append(text)
        return value

    content = read_whole(path, what="The certificate", largest=LARGEST_BYTES)
    try:
        data = json.loads(content.decode("utf-8"), parse_float=number)
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CertificateError(f"{path} is not a certificate: it is not JSON ({error}).") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise CertificateError(f"{path} is not a certificate of the layout {SCHEMA}.")
    missing = [entry.name for entry in fields(Certificate) if entry.name not in data]
    if missing:
        raise CertificateError(f"{path} lacks {', '.join(missing)}, so it is not a certificate.")
    return data, tuple(odd)
