"""Reading a certificate strictly: layout, types and sizes, none of its claims."""

import hashlib
import json
import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from sealag.errors import CertificateError
from sealag.files import read_whole
from sealag.passivity._checks import Check
from sealag.passivity._kinds import Criterion
from sealag.passivity._layout import LARGEST_BYTES, decoded, plain
from sealag.passivity._stated import Stated

T = TypeVar("T", bound=Stated)

SCHEMA = "sealag-certificate/6"
_OLD = re.compile(r"sealag-certificate/[0-5]")

MOST_AXES = 8
"""Of a window; each doubles the vertices to check."""

MOST_VERTICES = 200_000
"""Of all windows together; ten times more take an hour of rational arithmetic."""


def plain_of(source: Path | str | Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the plain data, and numbers of the file whose digits are not those of their double.

    Args:
        source: a file, or the plain data in it.

    Raises:
        FileError: it cannot be read, or is larger than 100 MB.
        CertificateError: it is no file, or not JSON.
    """
    if isinstance(source, Mapping):
        return dict(source), ()
    if not isinstance(source, Path | str):
        raise CertificateError(
            f"A {type(source).__name__} is no file of a certificate: `Certificate.write` writes "
            "one; a Certificate checks itself with `checks`."
        )
    content = read_whole(Path(source), what="The certificate", largest=LARGEST_BYTES)
    try:
        return plain(content)
    except CertificateError as error:
        raise CertificateError(f"{source} is not a certificate: {error}.") from error


def content_check(data: dict[str, Any], found: Stated, odd: tuple[str, ...]) -> Check:
    """Check that no digit differs from what was written: digest and form of every number.

    Args:
        data: the plain data.
        found: what it states.
        odd: numbers whose digits are not those of their double.
    """
    sealed = content_digest(data) == found.question.hashes.get("content")
    if odd:
        detail = f"the number {odd[0]} is {float(odd[0])!r}"
    else:
        detail = "the digest agrees" if sealed else "the digest is of other content"
    return Check(name="content is as written", ok=sealed and not odd, detail=detail)


def typed(data: dict[str, Any], source: Any, kind: type[T]) -> T:
    """Return what plain data states, if its types and sizes are those of a certificate.

    Args:
        data: the plain data.
        source: what messages call it: a file, or the data itself.
        kind: the class of certificates.

    Raises:
        CertificateError: it is not a certificate of this layout; the message names the key.
    """
    name = "The data" if isinstance(source, Mapping) else source
    schema = data.get("schema")
    if schema != SCHEMA:
        if isinstance(schema, str) and _OLD.fullmatch(schema):
            raise CertificateError(
                f"{name} has the layout {schema}, which states no jitter margin; certify the "
                "project again with this sealag, or verify the file with the version that it names "
                "in `versions`."
            )
        raise CertificateError(f"{name} is not a certificate of the layout {SCHEMA}.")
    try:
        certificate = decoded(data, kind)
        _check_sizes(certificate)
    except CertificateError as error:
        raise CertificateError(f"{name} is not a certificate: {error}.") from error
    return certificate


def content_digest(data: Mapping[str, Any]) -> str:
    """SHA-256 of a certificate's canonical JSON without this digest itself.

    Args:
        data: the certificate as plain data; doubles have one shortest decimal form, so that
            equal numbers give equal digests.
    """
    others = {key: value for key, value in data["hashes"].items() if key != "content"}
    content, digest = {**data, "hashes": others}, hashlib.sha256()
    for at, key in enumerate(sorted(content)):
        text = json.dumps(content[key], sort_keys=True, separators=(",", ":"), allow_nan=False)
        digest.update(f"{',' if at else '{'}{json.dumps(key)}:{text}".encode())
    digest.update(b"}")
    return digest.hexdigest()


def _check_sizes(c: Stated) -> None:
    """Refuse lists that do not fit each other, before anything is computed with them."""
    question, evidence = c.question, c.evidence
    edges = question.levels
    if len(edges) < 2 or edges[0] != 0 or any(after <= at for at, after in pairwise(edges)):
        raise CertificateError("`levels` must begin at 0 and increase")
    if not question.joints or len(set(question.joints)) < len(question.joints):
        raise CertificateError("`joints` must name each joint once")
    if len(c.answer.worst.direction) != len(question.joints):
        raise CertificateError("`worst.direction` must have a share for each joint")
    _check_proofs(c)
    vertices = 0
    for k, window in enumerate(evidence.time_varying_windows):
        if len(window.axes) > MOST_AXES:
            raise CertificateError(
                f"`time_varying_windows[{k}].axes` has {len(window.axes)} entries; at most "
                f"{MOST_AXES} can be checked"
            )
        vertices += 2 ** len(window.axes)
    if vertices > MOST_VERTICES:
        raise CertificateError(
            f"`time_varying_windows` has {vertices} vertices; at most {MOST_VERTICES} can be "
            "checked"
        )
    loop = evidence.local_loop
    if loop is not None and len(set(loop.states)) < len(loop.states):
        raise CertificateError("`local_loop.states` must name each state once")
    _check_instants(c)


def _check_proofs(c: Stated) -> None:
    """Rows of J* and sizes of W and Q follow from levels and criterion."""
    edges = c.question.levels
    certified = c.question.criterion is Criterion.CERTIFIED
    sizes = [after - first for first, after in pairwise(edges)]
    blocks = [len(c.question.joints)] if certified else sizes
    for k, proof in enumerate(c.evidence.proofs):
        wanted = [(f"proofs[{k}].J_star", len(proof.J_star), edges[-1])]
        for key, found in (("W", proof.W), ("Q", proof.Q)):
            wanted.append((f"proofs[{k}].{key}", len(found), len(blocks)))
            wanted += [
                (f"proofs[{k}].{key}[{i}]", length, rows)
                for i, (block, rows) in enumerate(zip(found, blocks))
                for length in block.shape
            ]
        for key, length, rows in wanted:
            if length != rows:
                raise CertificateError(f"`{key}` has {length} entries where {rows} are needed")


def _check_instants(c: Stated) -> None:
    answer, evidence, count = c.answer, c.evidence, c.question.instants
    if not count:
        raise CertificateError("`instants` is 0; there must be one")
    named = {"worst.instant": answer.worst.instant, "critical.instant": answer.critical.instant}
    for k, proof in enumerate(evidence.proofs):
        named[f"proofs[{k}].instant"] = proof.instant
    for k, window in enumerate(evidence.time_varying_windows):
        named[f"time_varying_windows[{k}].first"] = window.first
        named[f"time_varying_windows[{k}].last"] = window.last
    for key, instant in named.items():
        if not instant < count:
            raise CertificateError(f"`{key}` is {instant}; there are {count} instants")
