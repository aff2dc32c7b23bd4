"""Reading a certificate strictly, and checking it from the numbers in its file alone."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from sealag.errors import CertificateError
from sealag.files import read_whole
from sealag.passivity._certificate import SCHEMA, Certificate, content_digest
from sealag.passivity._checks import Check, Verification
from sealag.passivity._kinds import Criterion
from sealag.passivity._layout import LARGEST_BYTES, decoded, plain

MOST_AXES = 8
"""Of a window; each doubles the vertices to check."""

MOST_VERTICES = 200_000
"""Of all windows together; ten times more take an hour of rational arithmetic."""


def verify(certificate: Path | str | Mapping[str, Any], *, exact: bool = False) -> Verification:
    """Check every inequality and every claim of a certificate from its own numbers.

    Keys that are unknown, missing or there twice, other types, numbers that are not finite, and
    lists that do not fit each other are errors, not failed checks.

    Proven, in floating point with a rounding bound or, if `exact`, in rational arithmetic:

    - each instant in `proofs`: S is symmetric positive semidefinite, F follows from J*, S, K and
      the gravity gradient, F is symmetric, q̄(θ) contracts where it is fed back (these for criterion
      `certified`), and the matrix inequality of `InstantProof` holds at its delay, (29) or (31);
    - no delay above `max_delay_upper_s` satisfies the criterion at the worst instant;
    - the common multiplier at the instants in `proofs`, among them those that bind it;
    - the time-varying multiplier in every window, at all vertices with the ball around them.

    Computed anew in floating point, whether or not `exact`: the supremum of the criterion at the
    worst instant, the motion that reaches it and the limiting direction; that the windows hold the
    instants in `proofs`; unstable modes, margin and first crossing from the frozen loop of the
    critical instant: jω is a root there, and discs around all eigenvalues exclude a shorter delay
    (where a mode is unstable, or an embedded delay is in the loop, roots are counted at four
    shorter delays instead). Status, smallest bound and margin, stability, conservatism and all that
    follows from other keys are compared with what follows, and no digit of the file differs from
    what was written.

    Stated, not proven, as far as the file's other numbers do not contradict it: that the numbers
    are the robot's and the design's (`hashes`, `joints`, `delay_s`, `time_s`, `feedback`,
    `gravity`, `stiffness_form`, `task_inertia`, `levels`, `spring_damping`, `viscous_friction`,
    `motor_inertia`, `rotor_inertia`, `torque_bandwidth`, the link side of `local_loop`,
    `equilibrium`); what is said of instants without a proof (`bounds_s`, `asymmetry`,
    `contraction`) and of others than the critical one (`instant_margins_s`, `instant_basis`);
    `published_max_delay_s` of a `certified` certificate; and the words of `reasons`, `left_open`,
    `assumptions` and `versions`. `sealag.design.verify_design` checks these against project, URDF
    and motion.

    Args:
        certificate: a file, or the plain data in it.
        exact: decide definiteness in rational arithmetic instead of floating point with a
            rounding margin.

    Returns:
        All checks; `valid` only if each holds.

    Raises:
        FileError: the file cannot be read.
        CertificateError: it is not a certificate, or its arrays do not fit each other.
    """
    data, odd = _plain(certificate)
    found = _typed(data, certificate)
    first = _content_check(data, found, odd)
    checks = (first, *found.checks(exact=exact))
    return Verification(status=found.answer.status, exact=exact, checks=checks)


def read_certificate(certificate: Path | str | Mapping[str, Any]) -> Certificate:
    """Read a certificate, checking layout, types and sizes, but none of its claims.

    Args:
        certificate: a file, or the plain data in it.

    Raises:
        FileError: it cannot be read, or is larger than 100 MB.
        CertificateError: it is not a certificate of this layout; the message names the key.
    """
    return _typed(_plain(certificate)[0], certificate)


def _plain(source: Path | str | Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The plain data, and numbers of the file whose digits are not those of their double."""
    if isinstance(source, Mapping):
        return dict(source), ()
    if not isinstance(source, Path | str):
        raise CertificateError(
            f"A {type(source).__name__} is no file of a certificate: `write_certificate` writes "
            "one; a Certificate checks itself with `checks`."
        )
    content = read_whole(Path(source), what="The certificate", largest=LARGEST_BYTES)
    try:
        return plain(content)
    except CertificateError as error:
        raise CertificateError(f"{source} is not a certificate: {error}.") from error


def _content_check(data: dict[str, Any], found: Certificate, odd: tuple[str, ...]) -> Check:
    """No digit differs from what was written: digest and form of every number."""
    sealed = content_digest(data) == found.question.hashes.get("content")
    if odd:
        detail = f"the number {odd[0]} is {float(odd[0])!r}"
    else:
        detail = "the digest agrees" if sealed else "the digest is of other content"
    return Check(name="content is as written", ok=sealed and not odd, detail=detail)


def _typed(data: dict[str, Any], source: Any) -> Certificate:
    name = "The data" if isinstance(source, Mapping) else source
    if data.get("schema") != SCHEMA:
        raise CertificateError(f"{name} is not a certificate of the layout {SCHEMA}.")
    try:
        certificate = decoded(data, Certificate)
        _check_sizes(certificate)
    except CertificateError as error:
        raise CertificateError(f"{name} is not a certificate: {error}.") from error
    return certificate


def _check_sizes(c: Certificate) -> None:
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


def _check_proofs(c: Certificate) -> None:
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


def _check_instants(c: Certificate) -> None:
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
