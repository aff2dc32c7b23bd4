"""Checking a certificate again from the numbers in its file, without the code that made it."""

from pathlib import Path
from typing import Any

from sealag.errors import CertificateError
from sealag.passivity._certificate import parse_certificate
from sealag.passivity._checks import Verification
from sealag.passivity._claims import claim_checks, content_check
from sealag.passivity._definite import doubles, rationals
from sealag.passivity._inequalities import proof_checks, window_checks
from sealag.passivity._local import local_checks


def verify(certificate: Path | str | dict[str, Any], *, exact: bool = False) -> Verification:
    """Check every inequality and every claim of a certificate from its own numbers.

    Proven, in floating point with a rounding bound or, if `exact`, in rational arithmetic:

    - each instant in `proofs`: S is symmetric positive semidefinite, F follows from J*, S, K and
      the gravity gradient, F is symmetric, q̄(θ) contracts where it is fed back (these for criterion
      `certified`), and the matrix inequality of `Proof` holds at its delay, (29) or (31);
    - no delay above `max_delay_upper_s` satisfies the criterion at the worst instant;
    - the common multiplier at the instants in `proofs`, among them those that bind it;
    - the time-varying multiplier in every window, at all vertices with the ball around them.

    Shown in floating point, to rounding, whether or not `exact`: the windows hold the instants in
    `proofs`; the limiting direction; asymmetry and contraction are not below those of `proofs`, and
    equal to them if every instant has one; margin, first crossing, unstable modes and `stable`
    follow from the frozen loop, whose motors are the file's (crossings are excluded at four shorter
    delays). Redundant numbers agree, and no digit of the file differs from what was written.

    The maker's word stays: that the numbers are the robot's (URDF and project file are named by
    their hashes), with `delay_s`, times, where priority `levels` part and the link side of the
    frozen loop; bounds of instants without a proof, the common multiplier at them, and that they,
    and the motion between instants, lie in the windows; `published_max_delay_s` of a `certified`
    certificate; assumptions and versions; that something is null, is not certified, or why.
    `sealag.design.verify_design` checks most of these against project, URDF and motion.

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
    if isinstance(certificate, dict):
        data, odd = certificate, ()
    else:
        data, odd = parse_certificate(Path(certificate))
    number = rationals if exact else doubles
    try:
        checks = (
            content_check(data, odd),
            *claim_checks(data, number),
            *proof_checks(data, number),
            *window_checks(data, number),
            *local_checks(data),
        )
    except (
        ArithmeticError,
        AttributeError,
        IndexError,
        KeyError,
        TypeError,
        ValueError,
    ) as error:
        raise CertificateError(
            f"The certificate's numbers cannot be read: {type(error).__name__} {error}."
        ) from error
    return Verification(exact=exact, checks=checks)
