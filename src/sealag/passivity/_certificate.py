"""The certificate: question, answer, assumptions, and the numbers to check them by."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from enum import StrEnum
from pathlib import Path
from typing import Any, NoReturn

from sealag.errors import CertificateError, FileError
from sealag.files import write_text

SCHEMA = "sealag-certificate/1"
LARGEST_BYTES = 500_000_000


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

    With Y ≻ 0 and [[2D − Y, dF], [dFᵀ, Y]] ⪰ 0 the delayed loop dissipates for delays up to d
    ((29) in joint coordinates: Y is d times the multiplier Q of V_4).

    Attributes:
        instant: index of the instant.
        delay_s: d, s.
        J_star: (m, n).
        stiffness: (m, m) task stiffness S.
        F_gravity: (n, n) gradient of the fed-back gravity compensation.
        F: (n, n) delayed stiffness −∂τ_osc/∂θ of the criterion.
        Y: (n, n) multiplier.
    """

    instant: int
    delay_s: float
    J_star: list[list[float]]
    stiffness: list[list[float]]
    F_gravity: list[list[float]]
    F: list[list[float]]
    Y: list[list[float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """Answer of `sealag certify`. It has no truth value: read `status`.

    Attributes:
        status: certified or not.
        criterion: the criterion that was used.
        max_delay_s: smallest bound over the motion, s; 0 where a condition of the criterion fails.
        max_delay_upper_s: the same from the brackets' upper ends, s.
        delay_s: upper bound of the design's own delay d_1, s.
        asymmetry: largest ‖F − Fᵀ‖ / ‖F + Fᵀ‖ over the motion.
        contraction: largest contraction factor of q̄(θ) over the motion.
        worst: the instant that sets the answer.
        instants: number of instants.
        feedback: the signal that is fed back.
        gravity: how gravity is compensated.
        stiffness_form: how stiffness follows from K_x and Λ.
        task_inertia: which Λ that is.
        stable: whether the potential has a strict minimum at the worst instant, up to symmetries;
            None where that has no meaning.
        local_margin_s: exact local delay margin at the worst instant, s; None for infinity.
        first_crossing_s: delay at which one more pair of roots crosses there; None if none does.
        unstable_modes: roots with positive real part without delay, there.
        conservatism: local margin over max_delay_s; None where either is 0 or infinite.
        common_multiplier_delay_s: bound with one multiplier for the whole motion, which V_4 needs;
            None if it was not computed.
        common_multiplier: (n, n) that multiplier Y.
        time_varying_delay_s: bound for matrices that vary as they like inside polytopes around
            the motion, window by window, s; None if it was not asked for.
        time_varying_multiplier: (n, n) its multiplier Y.
        published_max_delay_s: what (29) or (31) as printed gives for the same design, s.
        reasons: why it is not certified.
        assumptions: what is taken for granted.
        joints: names, in the order of all arrays.
        D_theta: (n,) motor damping, Nms/rad.
        spring_stiffness: (n,) K, Nm/rad.
        time_s: (N,) instants.
        bounds_s: (N,) bound at each.
        proofs: numbers to check, for the worst instants.
        hashes: SHA-256 of the URDF and the project file.
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
    instants: int
    feedback: str
    gravity: str
    stiffness_form: str
    task_inertia: str
    stable: bool | None
    local_margin_s: float | None
    first_crossing_s: float | None
    unstable_modes: int
    conservatism: float | None
    common_multiplier_delay_s: float | None
    common_multiplier: list[list[float]] | None
    time_varying_delay_s: float | None
    time_varying_multiplier: list[list[float]] | None
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
        long = {"time_s", "bounds_s", "proofs", "common_multiplier", "time_varying_multiplier"}
        return _strict({k: v for k, v in asdict(self).items() if k not in long})

    def to_json_dict(self) -> dict[str, Any]:
        """Return everything, with null for numbers that are not finite."""
        return _strict(asdict(self))


def _strict(value: Any) -> Any:
    """Replace what JSON cannot say."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _strict(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(entry) for entry in value]
    return value


def write_certificate(certificate: Certificate, path: Path) -> None:
    """Write a certificate as JSON through a temporary name.

    Args:
        certificate: what to write.
        path: where; the folder is made if needed.

    Raises:
        FileError: it cannot be written.
    """
    text = json.dumps(certificate.to_json_dict(), allow_nan=False, indent=1)
    write_text(path, text)


def read_certificate(path: Path) -> dict[str, Any]:
    """Read a certificate file as plain data, checking its layout but none of its claims.

    Args:
        path: the file.

    Raises:
        FileError: it cannot be read.
        CertificateError: it is not a certificate of a known layout.
    """
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise CertificateError(f"{path} is too large to be a certificate.")
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise CertificateError(f"{path} is not a certificate: it is not JSON ({error}).") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise CertificateError(f"{path} is not a certificate of the layout {SCHEMA}.")
    missing = [entry.name for entry in fields(Certificate) if entry.name not in data]
    if missing:
        raise CertificateError(f"{path} lacks {', '.join(missing)}, so it is not a certificate.")
    return data
