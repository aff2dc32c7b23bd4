"""Checking a certificate against the design that it is said to be of."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sealag.design._certify import certify
from sealag.design._criteria import certified_bounds, published_bounds
from sealag.design._system import System
from sealag.errors import InputError
from sealag.passivity import Check, Criterion, Verification, read_certificate, verify
from sealag.robot import Motion
from sealag.typing import Array

AGREEMENT = 1e-6
"""Relative difference up to which recomputed numbers agree: another machine rounds in another way,
and bounds are brackets of that width."""

_PROBES = np.array([0.3 + 1.0j, 1.0 + 1.0j, 3.0 + 10.0j])
"""Places right of the axis, as multiples of the crossing's frequency, where loops are compared."""

_NOT_UNIQUE = frozenset(
    {"local_loop", "common_multiplier", "time_varying_multiplier", "time_varying_windows",
     "proofs", "worst_motion", "versions", "hashes", "common_multiplier_delay_s",
     "time_varying_delay_s", "conservatism"}
)  # fmt: skip
"""Fields that more than one value can be right for: coordinates and multipliers may be chosen, and
solvers end where they end. `verify` checks them from the file; what follows checks the rest."""


def verify_design(
    certificate: Path | str | dict[str, Any],
    system: System,
    motion: Motion | None = None,
    *,
    exact: bool = False,
) -> Verification:
    """Check a certificate as `verify` does, and that it is of this design and motion.

    The design is certified anew, and every field of the certificate that has one right value is
    compared with it: status, bounds and margins of all instants, limiting joints, stability,
    reasons, assumptions, gains, delays, hashes of URDF and project. Proofs are compared by their
    J*, S and F; the common multiplier is checked at every instant. It shares code with what made
    the certificate: it shows that the numbers are the design's, `verify` that the answer follows
    from them.

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
    if motion is None and data["instants"] > 1:
        raise InputError(
            f"The certificate is of a motion of {data['instants']} instants; name it (--motion)."
        )
    checks = found.checks
    if found.valid:
        checks += tuple(_recomputed(data, system, motion))
    return Verification(exact=exact, checks=checks)


def _recomputed(data: dict[str, Any], system: System, motion: Motion | None) -> Iterator[Check]:
    """What follows from robot, project and motion."""
    anew = certify(system, motion, criterion=data["criterion"], proofs=max(len(data["proofs"]), 1))
    fresh = json.loads(json.dumps(anew.to_json_dict()))
    for name in ("urdf", "project"):
        same = data["hashes"].get(name) == fresh["hashes"][name]
        words = "the file's SHA-256" if same else f"the certificate is of another {name} file"
        yield Check(name=f"{name} file", ok=same, detail=words)
    for name, value in fresh.items():
        if name not in _NOT_UNIQUE:
            where = _difference(data[name], value)
            words = where.removeprefix(":").strip() or "as computed anew"
            yield Check(name=f"design: {name}", ok=not where, detail=words)
    yield _versions(data["versions"], fresh["versions"])
    if data["time_s"] != fresh["time_s"]:
        return
    spaces = system.spaces(motion)
    printed = Criterion(data["criterion"]) is Criterion.PUBLISHED
    bounds = (published_bounds if printed else certified_bounds)(spaces, system)
    held = {proof["instant"]: proof for proof in fresh["proofs"]}
    for proof in data["proofs"]:
        yield _matrices(proof, held.get(proof["instant"]), bounds.F[proof["instant"]])
    if data["common_multiplier"] is not None:
        yield _common(data, bounds.F)
    yield _loop(data["local_loop"], fresh["local_loop"])


def _difference(claimed: Any, found: Any, where: str = "") -> str:
    """Where two JSON values differ by more than rounding; empty if they agree."""
    if isinstance(found, dict) and isinstance(claimed, dict):
        if set(found) != set(claimed):
            return f"{where}: {sorted(claimed)} in the certificate, {sorted(found)} computed anew"
        pairs = [(claimed[key], found[key], f"{where}.{key}") for key in found]
    elif isinstance(found, list) and isinstance(claimed, list):
        if len(found) != len(claimed):
            return f"{where}: {len(claimed)} entries in the certificate, {len(found)} computed anew"
        pairs = [(a, b, f"{where}[{i}]") for i, (a, b) in enumerate(zip(claimed, found))]
    else:
        return "" if _agrees(claimed, found) else f"{where} {claimed!r}, computed anew {found!r}"
    return next((words for a, b, at in pairs if (words := _difference(a, b, at))), "")


def _agrees(claimed: Any, found: Any) -> bool:
    if type(claimed) is float and type(found) is float:
        return abs(claimed - found) <= AGREEMENT * max(abs(found), 0.1)
    return type(claimed) is type(found) and claimed == found


def _matrices(proof: dict[str, Any], fresh: dict[str, Any] | None, F: Array) -> Check:
    name = f"design: J*, S, F at instant {proof['instant']}"
    pairs = {"F": F.tolist()}
    if fresh is not None:
        pairs |= {key: fresh[key] for key in ("J_star", "stiffness", "F_gravity")}
    gaps = []
    for key, value in pairs.items():
        claimed, found = np.array(proof[key]), np.array(value)
        size = max(float(np.abs(found).max(initial=0.0)), 1e-300)
        fits = claimed.shape == found.shape
        gaps.append(float(np.abs(claimed - found).max(initial=0.0)) / size if fits else np.inf)
    return Check(name=name, ok=max(gaps) <= AGREEMENT, detail=f"to {max(gaps):.1e}")


def _versions(claimed: dict[str, str], here: dict[str, str]) -> Check:
    """Another sealag answers in its own way; other libraries round in another way, and may."""
    same = set(claimed) == set(here) and claimed["sealag"] == here["sealag"]
    others = [f"{name} {v}" for name, v in claimed.items() if v != here.get(name)]
    words = f"others than here: {', '.join(others)}" if others else "those here"
    return Check(name="design: versions", ok=same, detail=words)


def _loop(claimed: dict[str, Any] | None, fresh: dict[str, Any] | None) -> Check:
    """The frozen loop, whatever the coordinates z: what torques of motors and drives do to them."""
    name = "design: local_loop"
    if claimed is None or fresh is None:
        words = "none" if fresh is None else "it has one"
        return Check(name=name, ok=claimed is fresh, detail=words)
    for key in ("at", "states", "frequency_rad_s", "embedded_delay_s"):
        if where := _difference(claimed[key], fresh[key], f"local_loop.{key}"):
            return Check(name=name, ok=False, detail=where)
    if (claimed["A_e"] is None) != (fresh["A_e"] is None):
        return Check(name=name, ok=False, detail="A_e is there in one of both only")
    gaps = []
    for s in _PROBES * (fresh["frequency_rad_s"] or 10.0):
        found, wanted = (_answers(loop, s) for loop in (claimed, fresh))
        gaps.append(float(np.abs(found - wanted).max() / np.abs(wanted).max()))
    words = f"motors answer to torques as computed anew, to {max(gaps):.1e}"
    return Check(name=name, ok=max(gaps) <= AGREEMENT, detail=words)


def _answers(loop: dict[str, Any], s: complex) -> Array:
    """Motors, drives and tank (m, m) under forces on their rates, at s with both delays at 1/|s|.

    A_0 and A_1 answer apart, so that neither can hide in the other.
    """
    kept = [k for k, name in enumerate(loop["states"]) if not name.startswith(("z", "d/dt z"))]
    A_0, A_1 = np.array(loop["A_0"]), np.array(loop["A_1"])
    A_e = 0.0 if loop["A_e"] is None else np.array(loop["A_e"])
    late = np.exp(-s / abs(s))
    whole = [A_0, A_0 + late * A_1, A_0 + late * A_e]
    answers = [np.linalg.inv(s * np.eye(len(A_0)) - A)[np.ix_(kept, kept)] for A in whole]
    return np.stack(answers)


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
        name=f"design: common multiplier at all {len(F)} instants",
        ok=bool((lowest >= -room).all()),
        detail=f"lowest eigenvalue {lowest.min():.3e}",
    )
