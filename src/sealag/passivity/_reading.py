"""Reading a certificate strictly: layout, types and sizes, and none of its claims."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from sealag.errors import CertificateError
from sealag.files import read_whole
from sealag.passivity._certificate import (
    SCHEMA,
    Certificate,
    Criterion,
    LocalLoop,
    Proof,
    Window,
    content_digest,
)
from sealag.passivity._layout import LARGEST_BYTES, decoded, plain

MOST_AXES = 8
"""Of a window; each doubles the vertices to check."""

MOST_VERTICES = 200_000
"""Of all windows together; ten times more take an hour of rational arithmetic."""

Size = tuple[str, int, int]
"""A key, how long it is, and how long it must be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """A certificate as it was given.

    Attributes:
        certificate: what it says.
        sealed: whether its digest is that of its content.
        odd: numbers of the file whose digits are not those of their double.
    """

    certificate: Certificate
    sealed: bool
    odd: tuple[str, ...]


def read_certificate(path: Path) -> dict[str, Any]:
    """Read a certificate file as plain data, checking layout, types and sizes, none of its claims.

    Args:
        path: the file.

    Raises:
        FileError: it cannot be read, or is larger than 100 MB.
        CertificateError: it is not a certificate of this layout; the message names the key.
    """
    data, _ = _of_file(path)
    _typed(data, path)
    return data


def given(source: Path | str | dict[str, Any]) -> Given:
    """Read a certificate with what tells that it was changed.

    Args:
        source: a file, or its plain data.

    Raises:
        FileError: the file cannot be read.
        CertificateError: it is not a certificate of this layout.
    """
    if isinstance(source, dict):
        data, odd, name = source, (), "The data"
    else:
        data, odd = _of_file(Path(source))
        name = source
    certificate = _typed(data, name)
    sealed = content_digest(data) == certificate.hashes.get("content")
    return Given(certificate=certificate, sealed=sealed, odd=odd)


def _of_file(path: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    content = read_whole(path, what="The certificate", largest=LARGEST_BYTES)
    try:
        return plain(content)
    except CertificateError as error:
        raise CertificateError(f"{path} is not a certificate: {error}.") from error


def _typed(data: dict[str, Any], name: Any) -> Certificate:
    if data.get("schema") != SCHEMA:
        raise CertificateError(f"{name} is not a certificate of the layout {SCHEMA}.")
    try:
        certificate = decoded(data, Certificate)
        _fitting(certificate)
    except CertificateError as error:
        raise CertificateError(f"{name} is not a certificate: {error}.") from error
    return certificate


def _fitting(c: Certificate) -> None:
    """Refuse lists that do not fit each other, before anything is computed with them."""
    _levels(c)
    for key, length, wanted in _lengths(c):
        if length != wanted:
            raise CertificateError(f"`{key}` has {length} entries where {wanted} are needed")
    for k, window in enumerate(c.time_varying_windows):
        if len(window.axes) > MOST_AXES:
            raise CertificateError(
                f"`time_varying_windows[{k}].axes` has {len(window.axes)} entries; at most "
                f"{MOST_AXES} can be checked"
            )
    vertices = sum(2 ** len(window.axes) for window in c.time_varying_windows)
    if vertices > MOST_VERTICES:
        raise CertificateError(
            f"`time_varying_windows` has {vertices} vertices; at most {MOST_VERTICES} can be "
            "checked"
        )
    for key, instant in _instants(c):
        if not instant < c.instants:
            raise CertificateError(f"`{key}` is {instant}; there are {c.instants} instants")


def _levels(c: Certificate) -> None:
    edges = c.levels
    if len(edges) < 2 or edges[0] != 0 or any(after <= at for at, after in pairwise(edges)):
        raise CertificateError("`levels` must begin at 0 and increase")
    if not c.joints or len(set(c.joints)) < len(c.joints):
        raise CertificateError("`joints` must name each joint once")


def _lengths(c: Certificate) -> Iterator[Size]:
    n, count = len(c.joints), c.instants
    for key in ("time_s", "bounds_s", "instant_margins_s", "instant_basis"):
        yield key, len(getattr(c, key)), max(count, 1)
    for key in (
        "D_theta",
        "spring_stiffness",
        "spring_damping",
        "viscous_friction",
        "motor_inertia",
        "rotor_inertia",
        "torque_bandwidth",
    ):
        yield key, len(getattr(c, key)), n
    yield "worst.direction", len(c.worst.direction), n
    yield from _matrix("worst_motion", c.worst_motion, 2, n)
    for key in ("common_multiplier", "time_varying_multiplier"):
        if (multiplier := getattr(c, key)) is not None:
            yield from _matrix(key, multiplier, n, n)
    for k, proof in enumerate(c.proofs):
        yield from _proof(f"proofs[{k}]", proof, n, c)
    for k, window in enumerate(c.time_varying_windows):
        yield from _window(f"time_varying_windows[{k}]", window, n)
    if c.local_loop is not None:
        yield from _loop(c.local_loop)


def _matrix(key: str, values: Sequence[Sequence[float]], rows: int, columns: int) -> Iterator[Size]:
    yield key, len(values), rows
    for k, row in enumerate(values):
        yield f"{key}[{k}]", len(row), columns


def _proof(at: str, proof: Proof, n: int, c: Certificate) -> Iterator[Size]:
    m = c.levels[-1]
    yield from _matrix(f"{at}.J_star", proof.J_star, m, n)
    yield from _matrix(f"{at}.stiffness", proof.stiffness, m, m)
    for key in ("F", "F_gravity"):
        yield from _matrix(f"{at}.{key}", getattr(proof, key), n, n)
    certified = c.criterion is Criterion.CERTIFIED
    blocks = [n] if certified else [after - first for first, after in pairwise(c.levels)]
    for key in ("W", "Q"):
        found = getattr(proof, key)
        yield f"{at}.{key}", len(found), len(blocks)
        for k, (block, rows) in enumerate(zip(found, blocks)):
            yield from _matrix(f"{at}.{key}[{k}]", block, rows, rows)


def _window(at: str, window: Window, n: int) -> Iterator[Size]:
    yield from _matrix(f"{at}.centre", window.centre, n, n)
    for k, axis in enumerate(window.axes):
        yield from _matrix(f"{at}.axes[{k}]", axis, n, n)


def _loop(loop: LocalLoop) -> Iterator[Size]:
    s = len(loop.states)
    yield from _matrix("local_loop.A_0", loop.A_0, s, s)
    yield from _matrix("local_loop.A_1", loop.A_1, s, s)
    if loop.A_e is not None:
        yield from _matrix("local_loop.A_e", loop.A_e, s, s)
    if loop.symmetries:
        yield from _matrix("local_loop.symmetries", loop.symmetries, s, len(loop.symmetries[0]))
    yield "local_loop.states", len(set(loop.states)), s


def _instants(c: Certificate) -> Iterator[tuple[str, int]]:
    yield "worst.instant", c.worst.instant
    yield "critical.instant", c.critical.instant
    for k, proof in enumerate(c.proofs):
        yield f"proofs[{k}].instant", proof.instant
    for k, window in enumerate(c.time_varying_windows):
        yield f"time_varying_windows[{k}].first", window.first
        yield f"time_varying_windows[{k}].last", window.last
