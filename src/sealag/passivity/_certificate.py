"""The certificate: it checks itself, and is written as JSON."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from sealag.errors import FileError
from sealag.files import Draft, written_whole
from sealag.passivity._checks import Check
from sealag.passivity._claims import claim_checks
from sealag.passivity._definite import Reader, doubles, rationals
from sealag.passivity._layout import LARGEST_BYTES, encoded
from sealag.passivity._shared import common_checks, window_checks
from sealag.passivity._stated import Stated
from sealag.passivity._supremum import worst_checks

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
class Certificate(Stated):
    """Answer of `sealag certify`. It has no truth value: read `answer.status`.

    Attributes:
        question: what was asked, and of which design.
        answer: what is claimed.
        evidence: the numbers from which the answer is checked.
        schema: layout of the file.
    """

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
        try:
            with np.errstate(all="ignore"):
                yield from worst_checks(self, number)
                for proof in self.evidence.proofs:
                    bound = self.evidence.bounds_s[proof.instant]
                    yield from proof.checks(self.question, number, bound_s=bound)
                yield from common_checks(self, number)
                yield from window_checks(self, number)
                yield from self._local_checks()
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            words = f"too large or too small to compute with: {error}"
            yield Check(name="numbers", ok=False, detail=words)

    def _local_checks(self) -> Iterator[Check]:
        loop, critical = self.evidence.local_loop, self.answer.critical.instant
        if loop is None:
            return
        yield from loop.checks(
            self.question,
            self.answer,
            margin_s=self.evidence.instant_margins_s[critical],
            proof=self.evidence.proof_of(critical),
        )

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
    content, digest = {**data, "hashes": others}, hashlib.sha256()
    for at, key in enumerate(sorted(content)):
        text = json.dumps(content[key], sort_keys=True, separators=(",", ":"), allow_nan=False)
        digest.update(f"{',' if at else '{'}{json.dumps(key)}:{text}".encode())
    digest.update(b"}")
    return digest.hexdigest()


def write_certificate(certificate: Certificate, path: Path | Draft) -> None:
    """Write a certificate as JSON, one field a line, through a temporary name.

    Args:
        certificate: what to write.
        path: where, or a draft of it; the folder is made if needed.

    Raises:
        FileError: it cannot be written, or is larger than what is read.
    """
    with written_whole(path) as file:
        size = 0
        for key, value in certificate.to_json_dict().items():
            text = f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}"
            line = f"{',' if size else '{'}\n{text}".encode()
            size += len(line)
            if size > LARGEST_BYTES:
                name = path.asked if isinstance(path, Draft) else path
                raise FileError(
                    f"{name} would be larger than {LARGEST_BYTES / 1e6:g} MB; ask for fewer proofs."
                )
            file.write(line)
        file.write(b"\n}\n")
