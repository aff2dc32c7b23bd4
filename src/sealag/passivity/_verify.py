"""Checking a certificate again from the numbers in its file, without the code that made it."""

from pathlib import Path
from typing import Any

import numpy as np

from sealag.passivity._certificate import Certificate
from sealag.passivity._checks import Check, Verification
from sealag.passivity._claims import claim_checks, content_check, worst_proof
from sealag.passivity._definite import Reader, doubles, rationals
from sealag.passivity._inequalities import proof_checks, window_checks
from sealag.passivity._local import local_checks
from sealag.passivity._reading import given
from sealag.passivity._supremum import worst_checks

MAKERS_WORD = (
    "delay_s",
    "joints",
    "time_s",
    "bounds_s",
    "instant_margins_s",
    "instant_basis",
    "published_max_delay_s",
    "asymmetry",
    "contraction",
    "task_inertia",
    "stiffness_form",
    "gravity",
    "feedback",
    "levels",
    "spring_damping",
    "viscous_friction",
    "motor_inertia",
    "rotor_inertia",
    "torque_bandwidth",
    "equilibrium",
    "local_loop",
    "reasons",
    "assumptions",
    "left_open",
    "hashes",
    "versions",
)
"""Keys some of whose values the file alone cannot contradict; `verify` says when."""


def verify(certificate: Path | str | dict[str, Any], *, exact: bool = False) -> Verification:
    """Check every inequality and every claim of a certificate from its own numbers.

    Read strictly: keys that are unknown, missing or there twice, other types, numbers that are not
    finite, lists that do not fit each other are errors and no failed checks.

    Proven, in floating point with a rounding bound or, if `exact`, in rational arithmetic:

    - each instant in `proofs`: S is symmetric positive semidefinite, F follows from J*, S, K and
      the gravity gradient, F is symmetric, q̄(θ) contracts where it is fed back (these for criterion
      `certified`), and the matrix inequality of `Proof` holds at its delay, (29) or (31);
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

    The maker's word, as far as the file's other numbers do not contradict it: that the numbers are
    the robot's and the design's (`hashes`, `joints`, `delay_s`, `time_s`, `feedback`, `gravity`,
    `stiffness_form`, `task_inertia`, `levels`, `spring_damping`, `viscous_friction`,
    `motor_inertia`, `rotor_inertia`, `torque_bandwidth`, the link side of `local_loop`,
    `equilibrium`); what is said of instants without a proof (`bounds_s`, `asymmetry`,
    `contraction`) and of others than the critical one (`instant_margins_s`, `instant_basis`);
    `published_max_delay_s` of a `certified` certificate; and the words of `reasons`, `left_open`,
    `assumptions` and `versions`. `sealag.design.verify_design` checks these against project, URDF
    and motion.

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
    source = given(certificate)
    claims = (content_check(source), *claim_checks(source.certificate))
    computed = _computed(source.certificate, rationals if exact else doubles)
    return Verification(exact=exact, checks=(*claims, *computed))


def _computed(c: Certificate, number: Reader) -> tuple[Check, ...]:
    """What needs positive damping and springs to be computed at all."""
    if not all(value > 0.0 for value in (*c.D_theta, *c.spring_stiffness, *c.motor_inertia)):
        return ()
    checks: list[Check] = []
    try:
        with np.errstate(all="ignore"):
            checks += worst_checks(c, number, worst_proof(c))
            checks += proof_checks(c, number)
            checks += window_checks(c, number)
            checks += local_checks(c)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        words = f"too large or too small to compute with: {error}"
        checks.append(Check(name="numbers", ok=False, detail=words))
    return tuple(checks)
