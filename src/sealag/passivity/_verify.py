"""Checking a certificate again from the numbers in its file, without the code that made it."""

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sealag.errors import CertificateError
from sealag.passivity._certificate import read_certificate
from sealag.typing import Array

SYMMETRY = 1e-7
"""Relative asymmetry up to which a certified stiffness counts as symmetric."""

AGREEMENT = 1e-9
"""Relative difference up to which redundant numbers of a file agree (they were rounded)."""

_FEEDBACKS = ("motor", "static_joint", "static_joint_tank", "joint")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that was checked.

    Attributes:
        name: what it is.
        ok: whether it holds.
        detail: numbers, or what is wrong.
    """

    name: str
    ok: bool
    detail: str

    def __post_init__(self) -> None:
        """Keep a plain truth value, which JSON can say."""
        object.__setattr__(self, "ok", bool(self.ok))


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Outcome of checking a certificate.

    Attributes:
        exact: whether inequalities were decided in rational arithmetic.
        checks: everything that was checked.
    """

    exact: bool
    checks: tuple[Check, ...]

    @property
    def valid(self) -> bool:
        """Whether every check holds: then what the file says follows from its numbers."""
        return all(check.ok for check in self.checks)

    def to_json_dict(self) -> dict[str, Any]:
        """Return the outcome as plain data with the key `valid`."""
        return {"valid": self.valid, **asdict(self)}


def verify(certificate: Path | str | dict[str, Any], *, exact: bool = False) -> Verification:
    """Check every inequality and every claim of a certificate from its own numbers.

    For each proof, from J*, S, the gravity gradient, K and D_θ in the file: S is symmetric
    positive semidefinite, F follows from them, F is symmetric, q̄(θ) contracts where it is fed
    back, and [[2D − Y, dF], [dFᵀ, Y]] is positive definite (criterion `certified`; for
    `published` only the last and that F follows). Then the claims: smallest bound, worst instant,
    verdict. Bounds of instants without a proof are the maker's word; the smallest one has one.
    Multipliers shared by the whole motion are checked at the instants with a proof.

    Args:
        certificate: a file, or what `read_certificate` returns.
        exact: decide definiteness in rational arithmetic instead of floating point with a
            rounding margin.

    Returns:
        All checks; `valid` only if each holds.

    Raises:
        FileError: the file cannot be read.
        CertificateError: it is not a certificate, or its arrays do not fit each other.
    """
    data = certificate if isinstance(certificate, dict) else read_certificate(Path(certificate))
    number = _rational if exact else _double
    try:
        checks = [*_claims(data), *_proofs(data, number)]
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise CertificateError(
            f"The certificate's numbers cannot be read: {type(error).__name__} {error}."
        ) from error
    return Verification(exact=exact, checks=tuple(checks))


def _double(values: Any) -> Array:
    array = np.array(values, dtype=float)
    if not np.isfinite(array).all():
        raise ValueError("a number is missing or not finite")
    return array


def _rational(values: Any) -> Array:
    from flint import fmpq

    array = _double(values)
    exact = np.empty(array.shape, dtype=object)
    for index, value in np.ndenumerate(array):
        exact[index] = fmpq(*float(value).as_integer_ratio())
    return exact


def _claims(data: dict[str, Any]) -> Iterator[Check]:
    bounds = [math.inf if b is None else float(b) for b in data["bounds_s"]]
    times = _double(data["time_s"])
    worst, claimed = data["worst"], data["max_delay_s"]
    smallest = min(bounds)
    largest = math.inf if claimed is None else float(claimed)
    yield Check(
        name="instants",
        ok=len(bounds) == len(times) == data["instants"] and bool((np.diff(times) > 0.0).all()),
        detail=f"{len(bounds)} bounds, {len(times)} times, {data['instants']} claimed",
    )
    yield Check(
        name="smallest bound",
        ok=largest == smallest and min(bounds) >= 0.0,
        detail=f"{largest:.9g} s claimed, {smallest:.9g} s in the list",
    )
    at = worst["instant"]
    yield Check(
        name="worst instant",
        ok=0 <= at < len(bounds) and bounds[at] == smallest and times[at] == worst["time_s"],
        detail=f"instant {at} at {worst['time_s']} s",
    )
    shares = _double(list(worst["direction"].values()))
    yield Check(
        name="limiting direction",
        ok=list(worst["direction"]) == list(data["joints"])
        and bool((shares >= 0.0).all())
        and abs(float(shares.sum()) - 1.0) < AGREEMENT,
        detail=f"shares of {len(shares)} joints sum to {float(shares.sum()):.12g}",
    )
    yes = not data["reasons"] and float(data["delay_s"]) <= largest
    yield Check(
        name="verdict",
        ok=data["status"] == ("certified" if yes else "not_certified")
        and data["criterion"] in ("certified", "published")
        and data["feedback"] in _FEEDBACKS
        and not (yes and data["criterion"] == "certified" and data["feedback"] == "joint"),
        detail=f"{data['status']} by the {data['criterion']} criterion at {data['delay_s']} s",
    )
    ratio = data["conservatism"]
    margin = data["local_margin_s"]
    expected = margin / largest if ratio is not None and margin is not None else ratio
    yield Check(
        name="conservatism",
        ok=ratio == expected
        and (ratio is None or ratio >= 1.0 or data["criterion"] == "published"),
        detail=f"local margin over bound is {ratio}",
    )
    proven = {proof["instant"] for proof in data["proofs"]}
    needed = 0.0 < largest < math.inf
    yield Check(
        name="proof of the worst instant",
        ok=not needed or at in proven,
        detail=f"{len(proven)} instants have proofs",
    )


def _proofs(data: dict[str, Any], number: Callable[[Any], Array]) -> Iterator[Check]:
    D, K = number(data["D_theta"]), number(data["spring_stiffness"])
    n = len(data["joints"])
    positive = len(D) == len(K) == n and all(v > 0 for v in (*D, *K))
    yield Check(
        name="damping and springs",
        ok=positive,
        detail=f"{n} joints, all positive" if positive else "not all are positive",
    )
    if not positive:
        return
    for proof in data["proofs"]:
        name = f"instant {proof['instant']}"
        bound = data["bounds_s"][proof["instant"]]
        yield Check(
            name=f"{name}: claimed delay",
            ok=bound == proof["delay_s"] and proof["delay_s"] > 0.0,
            detail=f"{proof['delay_s']:.9g} s",
        )
        J, S, G, F, Y = (number(proof[k]) for k in ("J_star", "stiffness", "F_gravity", "F", "Y"))
        if F.shape != (n, n) or Y.shape != (n, n) or G.shape != (n, n):
            raise ValueError(f"{name} has matrices of another size than its {n} joints")
        yield from _stiffness(name, data, J=J, S=S, G=G, F=F, K=K)
        d = number([proof["delay_s"]])[0]
        yield _inequality(f"{name}: matrix inequality", D=D, F=F, Y=Y, d=d)
        for words, longest, Y in _shared(data):
            d = number([longest])[0]
            yield _inequality(f"{name}: {words} multiplier", D=D, F=F, Y=number(Y), d=d)


def _shared(data: dict[str, Any]) -> Iterator[tuple[str, float, Any]]:
    """Multipliers that hold for the whole motion: name, delay, Y."""
    for words, key in (("common", "common_multiplier"), ("time-varying", "time_varying")):
        longest, Y = data[f"{key}_delay_s"], data[f"{key.removesuffix('_multiplier')}_multiplier"]
        if Y is not None and longest is not None:
            yield words, longest, Y


def _inequality(name: str, *, D: Array, F: Array, Y: Array, d: Any) -> Check:
    """Whether [[2D − Y, dF], [dFᵀ, Y]] ≻ 0."""
    block = np.block([[np.diag(2 * D) - Y, d * F], [(d * F).T, Y]])
    slack, ok = positive_definite(_scaled(block, D))
    holds = ok and bool((Y == Y.T).all())
    words = "is" if holds else "is not"
    return Check(
        name=name, ok=holds, detail=f"[[2D - Y, dF], [dF', Y]] {words} positive definite ({slack})"
    )


def _scaled(block: Array, D: Array) -> Array:
    """Congruence by powers of two near D^-½, so that units do not matter."""
    powers = [2.0 ** -round(math.log2(float(_float(value))) / 2.0) for value in (*D, *D)]
    scale = _rational(powers) if block.dtype == object else np.array(powers)
    return block * scale[:, None] * scale[None, :]


def _float(value: Any) -> float:
    return value if isinstance(value, float) else int(value.p) / int(value.q)


def _stiffness(
    name: str, data: dict[str, Any], *, J: Array, S: Array, G: Array, F: Array, K: Array
) -> Iterator[Check]:
    """That F is the stiffness of the law that the file names."""
    certified = data["criterion"] == "certified"
    F_q = J.T @ S @ J - (G if certified else 0 * G)
    if certified and data["feedback"] == "static_joint":
        difference, scale = F - F @ (F_q / K[:, None]) - F_q, _size(F) + _size(F_q)
    else:
        difference, scale = F - F_q, _size(F)
    yield Check(
        name=f"{name}: F follows from J*, S and K",
        ok=_size(difference) <= AGREEMENT * scale,
        detail=f"relative difference {_size(difference) / max(scale, 1e-300):.1e}",
    )
    if not certified:
        return
    skew = _size(F - F.T) / max(_size(F + F.T), 1e-300)
    yield Check(name=f"{name}: F is symmetric", ok=skew <= SYMMETRY, detail=f"{skew:.1e}")
    raised = (S + S.T) / 2 + _like(S, AGREEMENT * _size(S) + 1e-300) * _eye(S)
    slack, ok = positive_definite(raised)
    crooked = _size(S - S.T) / max(_size(S), 1e-300)
    yield Check(
        name=f"{name}: task stiffness is symmetric positive semidefinite",
        ok=ok and crooked <= SYMMETRY,
        detail=f"asymmetry {crooked:.1e}, {slack}",
    )
    if data["feedback"] == "static_joint":
        even = (F_q + F_q.T) / 2
        diagonal = np.diag(K)
        ok = positive_definite(diagonal - even)[1] and positive_definite(diagonal + even)[1]
        yield Check(
            name=f"{name}: q̄(θ) contracts",
            ok=ok,
            detail="K - F_q and K + F_q are positive definite",
        )


def _like(array: Array, value: float) -> Any:
    """A number of the kind that an array holds."""
    return _rational([value])[0] if array.dtype == object else value


def _eye(array: Array) -> Array:
    eye = np.eye(len(array))
    return _rational(eye) if array.dtype == object else eye


def _size(array: Array) -> float:
    """Frobenius norm, to double precision."""
    return math.sqrt(float(sum(_float(value * value) for value in array.ravel())))


def positive_definite(matrix: Array) -> tuple[str, bool]:
    """Decide whether a symmetric matrix is positive definite.

    Args:
        matrix: (N, N) doubles, decided by eigenvalues with a margin for rounding; or rationals,
            decided by the pivots of LDLᵀ without any error.

    Returns:
        What was found, in words, and the answer; a doubtful case is a no.
    """
    if matrix.dtype != object:
        lowest = float(np.linalg.eigvalsh((matrix + matrix.T) / 2.0)[0])
        room = 8.0 * len(matrix) * np.finfo(float).eps * float(np.linalg.norm(matrix))
        return f"lowest eigenvalue {lowest:.3e}, rounding {room:.1e}", lowest > room
    work = ((matrix + matrix.T) / 2).copy()
    for k in range(len(work)):
        if not work[k, k] > 0:
            return f"pivot {k} is {_float(work[k, k]):.3e}", False
        column = work[k + 1 :, k] / work[k, k]
        work[k + 1 :, k + 1 :] = work[k + 1 :, k + 1 :] - np.outer(column, work[k, k + 1 :])
    return "all pivots positive", True
