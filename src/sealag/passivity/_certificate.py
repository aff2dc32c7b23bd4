"""The certificate: it checks itself, is written as JSON, read strictly and verified."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn, Self

import numpy as np

from sealag.errors import FileError, SolverError
from sealag.files import Draft, written_whole
from sealag.passivity._checks import Check, Verification
from sealag.passivity._claims import claim_checks
from sealag.passivity._definite import Reader, doubles, rationals
from sealag.passivity._headline import headline
from sealag.passivity._kinds import Basis, Status
from sealag.passivity._layout import LARGEST_BYTES, encoded
from sealag.passivity._reading import SCHEMA, content_check, content_digest, plain_of, typed
from sealag.passivity._shared import common_checks, window_checks
from sealag.passivity._stated import Stated
from sealag.passivity._supremum import worst_checks

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

_NO_DIGEST = "0" * 64
"""Stands for the digest of a certificate that is not written yet."""


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

    @property
    def headline(self) -> str:
        """One sentence: the tolerated delay, the design's own, what limits, and stability."""
        return headline(self.question, self.answer)

    @classmethod
    def read(cls, source: Path | str | Mapping[str, Any]) -> Self:
        """Read a certificate, checking layout, types and sizes, but none of its claims.

        Args:
            source: a file, or the plain data in it.

        Raises:
            FileError: it cannot be read, or is larger than 100 MB.
            CertificateError: it is not a certificate of this layout; the message names the key.
        """
        return typed(plain_of(source)[0], source, cls)

    @classmethod
    def verify(cls, source: Path | str | Mapping[str, Any], *, exact: bool = False) -> Verification:
        """Check every inequality and every claim of a certificate from its own numbers.

        Keys that are unknown, missing or there twice, other types, numbers that are not finite, and
        lists that do not fit each other are errors, not failed checks.

        Proven, in floating point with a rounding bound or, if `exact`, in rational arithmetic:

        - each instant in `proofs`: S is symmetric positive semidefinite, F follows from J*, S, K
          and the gravity gradient, F is symmetric, q̄(θ) contracts where it is fed back (these for
          criterion `certified`), and the matrix inequality of `InstantProof` holds at its delay,
          (29) or (31);
        - no delay above `max_delay_upper_s` satisfies the criterion at the worst instant;
        - the common multiplier at the instants in `proofs`, among them those that bind it;
        - the time-varying multiplier in every window, at all vertices with the ball around them.

        Computed anew in floating point, whether or not `exact`: the supremum of the criterion at
        the worst instant, the motion that reaches it and the limiting direction; that the windows
        hold the instants in `proofs`; unstable modes, margin and first crossing from the frozen
        loop of the critical instant: jω is a root there, and discs around all eigenvalues exclude a
        shorter delay (where a mode is unstable, or an embedded delay is in the loop, roots are
        counted at four shorter delays instead). Status, smallest bound and margin, stability,
        conservatism and all that follows from other keys are compared with what follows, and no
        digit of the file differs from what was written.

        Stated, not proven, as far as the file's other numbers do not contradict it: that the
        numbers are the robot's and the design's (`hashes`, `joints`, `delay_s`, `time_s`,
        `feedback`, `gravity`, `stiffness_form`, `task_inertia`, `levels`, `spring_damping`,
        `viscous_friction`, `motor_inertia`, `rotor_inertia`, `torque_bandwidth`, the link side of
        `local_loop`, `equilibrium`); what is said of instants without a proof (`bounds_s`,
        `asymmetry`, `contraction`) and of others than the critical one (`instant_margins_s`,
        `instant_basis`); `published_max_delay_s` of a `certified` certificate; and the words of
        `reasons`, `left_open`, `assumptions` and `versions`. `sealag.design.verify_design` checks
        these against project, URDF and motion.

        Args:
            source: a file, or the plain data in it.
            exact: decide definiteness in rational arithmetic instead of floating point with a
                rounding margin.

        Returns:
            All checks; `valid` only if each holds.

        Raises:
            FileError: the file cannot be read.
            CertificateError: it is not a certificate, or its arrays do not fit each other.
        """
        data, odd = plain_of(source)
        found = typed(data, source, cls)
        checks = (content_check(data, found, odd), *found.checks(exact=exact))
        return Verification(status=found.answer.status, exact=exact, checks=checks)

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

    def confirmed(self, *, proven: bool = False) -> Self:
        """Return what the verifier confirms of this certificate, before anybody else asks it.

        Where only the frozen loop's checks fail, as at roots that rounding leaves on the axis, the
        claims of stability and local margin are withdrawn: the design is at most passive only, and
        `reasons` says what could not be confirmed.

        Args:
            proven: whether proofs and frozen loop are those of a certificate that was confirmed for
                another delay: they hold at any, and only the claims are checked.

        Returns:
            This certificate if all its checks hold; else the one with the lower claim.

        Raises:
            SolverError: something else could not be confirmed, so that nothing can be claimed.
        """
        if proven and all(check.ok for check in claim_checks(self._sealed())):
            return self
        found = self._refused()
        if not found:
            return self
        lower = self._without_loop(f"{found[0].name}: {found[0].detail}")
        rest = lower._refused()
        if rest:
            raise SolverError(
                f"The certificate's own check does not confirm {rest[0].name} ({rest[0].detail}), "
                "so that nothing is claimed; please report it with the project and its URDF."
            )
        return lower

    def _sealed(self) -> Self:
        """The same as a file would say it, which has a digest."""
        hashes = {**self.question.hashes, "content": _NO_DIGEST}
        return replace(self, question=replace(self.question, hashes=hashes))

    def _refused(self) -> list[Check]:
        """Checks that fail in doubles; what they leave in doubt is decided in rationals."""
        sealed = self._sealed()
        found = [check for check in sealed.checks() if not check.ok]
        return [check for check in sealed.checks(exact=True) if not check.ok] if found else []

    def _without_loop(self, why: str) -> Self:
        """The same without any claim of stability and local margin."""
        answer, evidence, count = self.answer, self.evidence, self.question.instants
        reason = (
            "stability and local margin are left open: this certificate's own check does not "
            f"confirm them ({why})"
        )
        certified = answer.status is Status.CERTIFIED
        return replace(
            self,
            answer=replace(
                answer,
                status=Status.PASSIVE_ONLY if certified else answer.status,
                reasons=(*answer.reasons, reason),
                stable=None,
                unstable_modes=0,
                local_margin_s=None,
                first_crossing_s=None,
                conservatism=None,
            ),
            evidence=replace(
                evidence,
                instant_margins_s=(None,) * count,
                instant_basis=(Basis.OPEN,) * count,
                local_loop=None,
            ),
        )

    def summary(self) -> dict[str, Any]:
        """Return question and answer, as `sealag certify --json` prints them."""
        return {key: value for key, value in encoded(self).items() if key not in _LONG}

    def to_json_dict(self) -> dict[str, Any]:
        """Return everything, as the file says it, with the digest of it."""
        data = encoded(self)
        return {**data, "hashes": {**data["hashes"], "content": content_digest(data)}}

    def write(self, path: Path | Draft) -> None:
        """Write it as JSON, one field a line, through a temporary name.

        Args:
            path: where, or a draft of it; the folder is made if needed.

        Raises:
            FileError: it cannot be written, or is larger than what is read.
        """
        with written_whole(path) as file:
            size = 0
            for key, value in self.to_json_dict().items():
                text = f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}"
                line = f"{',' if size else '{'}\n{text}".encode()
                size += len(line)
                if size > LARGEST_BYTES:
                    name = path.asked if isinstance(path, Draft) else path
                    raise FileError(
                        f"{name} would be larger than {LARGEST_BYTES / 1e6:g} MB; "
                        "ask for fewer proofs."
                    )
                file.write(line)
            file.write(b"\n}\n")
