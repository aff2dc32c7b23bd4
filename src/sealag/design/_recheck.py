"""Checking a certificate against the design that it is said to be of."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sealag.design._certify import design_entries
from sealag.design._criteria import (
    Bounds,
    asymmetry,
    certified_bounds,
    published_bounds,
    task_stiffness,
)
from sealag.design._evidence import frozen_loop
from sealag.design._system import System
from sealag.passivity import Check, Criterion, Verification, read_certificate, verify
from sealag.robot import Motion
from sealag.typing import Array
from sealag.whole_body import WholeBodyStack

UNBOUNDED = "unbounded"

AGREEMENT = 1e-6
"""Relative difference up to which recomputed numbers agree: another machine rounds in another way,
and bounds are brackets of that width."""


def verify_design(
    certificate: Path | str | dict[str, Any],
    system: System,
    motion: Motion | None = None,
    *,
    exact: bool = False,
) -> Verification:
    """Check a certificate as `verify` does, and that it is of this design and motion.

    Besides the numbers in the file alone: the SHA-256 of URDF and project file; d_1, joints, D_θ,
    K, feedback, gravity, stiffness form, task inertia and priority levels as the project has them;
    the motion's times; and, recomputed from URDF, project and motion, that no instant's bound is
    longer than the criterion allows, J*, S, F of `proofs`, asymmetry, contraction, the published
    bound, local margin, first crossing and unstable modes, and the common multiplier at every
    instant. It shares code with what made the certificate: it shows that the numbers are the
    design's, `verify` that the answer follows from them. Instants without a proof that lie outside
    the windows of the time-varying bound are not looked for.

    Args:
        certificate: a file, or what `read_certificate` returns.
        system: the design.
        motion: the motion that was certified; the system's posture if None.
        exact: decide definiteness in rational arithmetic.

    Returns:
        All checks; `valid` only if each holds. A file that contradicts itself is not recomputed.

    Raises:
        FileError: the file cannot be read.
        CertificateError: it is not a certificate, or its arrays do not fit each other.
        RobotError: a mass matrix is not positive definite.
    """
    found = verify(certificate, exact=exact)
    data = certificate if isinstance(certificate, dict) else read_certificate(Path(certificate))
    checks = (*found.checks, *_project(data, system))
    if found.valid:
        checks += tuple(_recomputed(data, system, system.still() if motion is None else motion))
    return Verification(exact=exact, checks=checks)


def _project(data: dict[str, Any], system: System) -> Iterator[Check]:
    """What is in the project file, digit by digit."""
    wanted = design_entries(system)
    hashes = wanted.pop("hashes")
    for name, digest in hashes.items():
        same = data["hashes"].get(name) == digest
        words = "the file's SHA-256" if same else f"the certificate is of another {name} file"
        yield Check(name=f"{name} file", ok=same, detail=words)
    wanted["joints"] = list(wanted["joints"])
    for name, value in wanted.items():
        words = f"{data[name]} in the certificate, {value} in the project"
        yield Check(name=f"project: {name}", ok=data[name] == value, detail=words)


def _recomputed(data: dict[str, Any], system: System, motion: Motion) -> Iterator[Check]:
    """What follows from robot, project and motion."""
    times = motion.time.tolist()
    same = data["time_s"] == times
    words = f"{len(data['time_s'])} in the certificate, {len(times)} in the motion"
    yield Check(name="motion: times", ok=same, detail=words)
    if not same:
        return
    kind, stack = Criterion(data["criterion"]), system.evaluate(motion)
    published = published_bounds(stack, system)
    bounds = published if kind is Criterion.PUBLISHED else certified_bounds(stack, system)
    claimed = _finite(data["bounds_s"])
    longer = np.flatnonzero(claimed > bounds.upper * (1.0 + AGREEMENT))
    words = f"at {len(longer)} of {len(claimed)} instants the claim is longer"
    yield Check(name="motion: bounds", ok=not len(longer), detail=words)
    for name, value in (
        ("published_max_delay_s", published.delay.min()),
        ("contraction", stack.contraction.max()),
        ("asymmetry", asymmetry(stack, bounds, kind).max()),
    ):
        yield _number(f"motion: {name}", data[name], float(value))
    for proof in data["proofs"]:
        yield _matrices(proof, stack, bounds, S=task_stiffness(stack, system, kind))
    yield from _local(data, system, motion, stack)
    if data["common_multiplier"] is not None:
        yield _common(data, bounds.F)


def _finite(values: list[float | str]) -> Array:
    return np.array([np.inf if value == UNBOUNDED else value for value in values], dtype=float)


def _number(name: str, claimed: float | str | None, found: float | None) -> Check:
    """Equal to rounding; what is unknown or unbounded has to be so in both."""
    if found is not None and np.isinf(found):
        same = claimed == UNBOUNDED
    elif found is None or isinstance(claimed, str | None):
        same = claimed is found
    else:
        same = abs(claimed - found) <= AGREEMENT * max(abs(found), 0.1)
    return Check(name=name, ok=bool(same), detail=f"{claimed} claimed, {found} found")


def _matrices(proof: dict[str, Any], stack: WholeBodyStack, bounds: Bounds, *, S: Array) -> Check:
    k, gaps = proof["instant"], []
    for name, found in (
        ("J_star", stack.J_star[k]),
        ("stiffness", S[k]),
        ("F_gravity", stack.F_gravity[k]),
        ("F", bounds.F[k]),
    ):
        claimed, size = np.array(proof[name]), max(float(np.abs(found).max()), 1e-300)
        fits = claimed.shape == found.shape
        gaps.append(float(np.abs(claimed - found).max()) / size if fits else np.inf)
    words = f"to {max(gaps):.1e}"
    return Check(name=f"motion: J*, S, F at instant {k}", ok=max(gaps) <= AGREEMENT, detail=words)


def _local(
    data: dict[str, Any], system: System, motion: Motion, stack: WholeBodyStack
) -> Iterator[Check]:
    found = frozen_loop(system, motion, stack, instant=data["critical"]["instant"])
    yield _number("motion: local margin", data["local_margin_s"], found.margin_s)
    yield _number("motion: first crossing", data["first_crossing_s"], found.first_crossing_s)
    same = data["unstable_modes"] == found.unstable
    words = f"{found.unstable} unstable modes"
    yield Check(name="motion: stability without delay", ok=same, detail=words)


def _common(data: dict[str, Any], F: Array) -> Check:
    """[[2D − W, dF], [dFᵀ, W]] at every instant, in doubles."""
    d, W = data["common_multiplier_delay_s"], np.array(data["common_multiplier"])
    whole = np.broadcast_to(W, F.shape)
    corner = 2.0 * np.diag(data["D_theta"]) - whole
    rows = [np.concatenate([corner, d * F], axis=2)]
    rows.append(np.concatenate([d * np.swapaxes(F, 1, 2), whole], axis=2))
    lowest = np.linalg.eigvalsh(np.concatenate(rows, axis=1))[:, 0]
    room = AGREEMENT * max(data["D_theta"])
    return Check(
        name=f"motion: common multiplier at all {len(F)} instants",
        ok=bool((lowest >= -room).all()),
        detail=f"lowest eigenvalue {lowest.min():.3e}",
    )
