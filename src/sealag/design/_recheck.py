"""Checking a certificate against the design that it names."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sealag.design._along import Along
from sealag.design._certify import certify
from sealag.design._criteria import delayed_stiffness
from sealag.design._project import loaded
from sealag.design._system import System
from sealag.errors import InputError
from sealag.passivity import Certificate, Criterion, InstantProof, LocalLoop, Verification
from sealag.robot import Motion
from sealag.typing import Array

if TYPE_CHECKING:
    from sealag.simulation import Run

_Check = tuple[str, bool, str]
"""Name, whether it holds, and detail."""

AGREEMENT = 1e-6
"""Relative difference up to which recomputed numbers agree: machines round differently, and bounds
are brackets of that width. Ten times less accuses other machines; ten times more hides a change in
the sixth digit."""

_PROBES = np.array([0.3 + 1.0j, 1.0 + 1.0j, 3.0 + 10.0j])
"""Places right of the axis, as multiples of the crossing's frequency, where loops are compared."""

_NOT_UNIQUE = frozenset(
    {"local_loop", "common_multiplier", "time_varying_multiplier", "time_varying_windows",
     "proofs", "worst_motion", "versions", "hashes", "common_multiplier_delay_s",
     "time_varying_delay_s", "jitter_margin_s",
     "conservatism"}
)  # fmt: skip
"""Fields with more than one right value: coordinates and multipliers are a choice, and solvers stop
at different points. `verify` checks them from the file; the checks below compare the rest."""


def verify_design(
    certificate: Path | str | Mapping[str, Any],
    project: System | str | Path,
    motion: "Motion | Run | str | Path | None" = None,
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
        certificate: a file, or the plain data in it.
        project: the design, or its project file.
        motion: the motion that was certified, or its file; as `certify` takes it.
        exact: decide definiteness in rational arithmetic.

    Returns:
        All checks; `valid` only if each holds. A file that contradicts itself is not recomputed.

    Raises:
        FileError: the file cannot be read.
        CertificateError: it is not a certificate, or its arrays do not fit each other.
        RobotError: a mass matrix is not positive definite.
    """
    found = Certificate.verify(certificate, exact=exact)
    claimed = Certificate.read(certificate)
    count = claimed.question.instants
    system = loaded(project)
    along = system.motion_of(motion)
    if len(along) == 1 < count:
        raise InputError(f"The certificate is of a motion of {count} instants; name it (--motion).")
    return found.extended(_recomputed(claimed, system, along)) if found.valid else found


def _recomputed(claimed: Certificate, system: System, motion: Motion) -> Iterator[_Check]:
    """What follows from robot, project and motion."""
    proofs, kind = claimed.evidence.proofs, claimed.question.criterion
    fresh = certify(system, motion, criterion=kind, proofs=max(len(proofs), 1)).confirmed()
    for name, digest in fresh.question.hashes.items():
        same = claimed.question.hashes.get(name) == digest
        words = "the file's SHA-256" if same else f"the certificate is of another {name} file"
        yield (f"{name} file", same, words)
    data = claimed.to_json_dict()
    for name, value in fresh.to_json_dict().items():
        if name not in _NOT_UNIQUE:
            where = _difference(data[name], value)
            words = where.removeprefix(":").strip() or "as computed anew"
            yield (f"design: {name}", not where, words)
    yield _versions(claimed.answer.versions, fresh.answer.versions)
    if not np.array_equal(claimed.evidence.time_s, fresh.evidence.time_s):
        return
    along = Along.of(system, motion)
    F = delayed_stiffness(along.at([proof.instant for proof in proofs]), system, kind)
    for proof, found in zip(proofs, F, strict=True):
        yield _matrices(proof, fresh.evidence.proof_of(proof.instant), found)
    if claimed.evidence.common_multiplier is not None:
        yield _common(claimed, claimed.evidence.common_multiplier, along)
    yield _loop(claimed.evidence.local_loop, fresh.evidence.local_loop)


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


def _matrices(claimed: InstantProof, fresh: InstantProof | None, F: Array) -> _Check:
    pairs = [(claimed.F, F)]
    if fresh is not None:
        pairs += [
            (claimed.J_star, fresh.J_star),
            (claimed.stiffness, fresh.stiffness),
            (claimed.F_gravity, fresh.F_gravity),
        ]
    gap = max(_gap(one, other) for one, other in pairs)
    name = f"design: J*, S, F at instant {claimed.instant}"
    return (name, gap <= AGREEMENT, f"to {gap:.1e}")


def _gap(claimed: Array, found: Array) -> float:
    """Largest difference over the largest entry; inf for other shapes."""
    if claimed.shape != found.shape:
        return np.inf
    size = max(float(np.abs(found).max(initial=0.0)), 1e-300)
    return float(np.abs(claimed - found).max(initial=0.0)) / size


def _versions(claimed: Mapping[str, str], here: Mapping[str, str]) -> _Check:
    """Another sealag answers in its own way; other libraries round in another way, and may."""
    same = set(claimed) == set(here) and claimed["sealag"] == here["sealag"]
    others = [f"{name} {v}" for name, v in claimed.items() if v != here.get(name)]
    words = f"others than here: {', '.join(others)}" if others else "those here"
    return ("design: versions", same, words)


def _loop(claimed: LocalLoop | None, fresh: LocalLoop | None) -> _Check:
    """The frozen loop, whatever the coordinates z: what torques of motors and drives do to them."""
    name = "design: local_loop"
    if claimed is None or fresh is None:
        words = "none" if fresh is None else "it has one"
        return (name, claimed is fresh, words)
    pairs = (
        ("at", claimed.at, fresh.at),
        ("states", list(claimed.states), list(fresh.states)),
        ("frequency_rad_s", claimed.frequency_rad_s, fresh.frequency_rad_s),
        ("embedded_delay_s", claimed.embedded_delay_s, fresh.embedded_delay_s),
    )
    for key, one, other in pairs:
        if where := _difference(one, other, f"local_loop.{key}"):
            return (name, False, where)
    if (claimed.A_e is None) != (fresh.A_e is None):
        return (name, False, "A_e is there in one of both only")
    gap = max(
        _gap(_answers(claimed, s), _answers(fresh, s))
        for s in _PROBES * (fresh.frequency_rad_s or 10.0)
    )
    words = f"motors answer to torques as computed anew, to {gap:.1e}"
    return (name, gap <= AGREEMENT, words)


def _answers(loop: LocalLoop, s: complex) -> Array:
    """Motors, drives and tank (m, m) under forces on their rates, at s with both delays at 1/|s|.

    A_0 and A_1 answer apart, so that neither can hide in the other.
    """
    kept = [k for k, name in enumerate(loop.states) if not name.startswith(("z", "d/dt z"))]
    late = np.exp(-s / abs(s))
    A_e = 0.0 if loop.A_e is None else loop.A_e
    whole = [loop.A_0, loop.A_0 + late * loop.A_1, loop.A_0 + late * A_e]
    answers = [np.linalg.inv(s * np.eye(len(A)) - A)[np.ix_(kept, kept)] for A in whole]
    return np.stack(answers)


def _common(claimed: Certificate, W: Array, along: Along) -> _Check:
    """[[2D − W, dF], [dFᵀ, W]] at every instant, in doubles."""
    d, D = claimed.answer.common_multiplier_delay_s, claimed.question.D_theta
    lowest = np.inf
    for _, spaces in along.parts():
        F = delayed_stiffness(spaces, along.system, Criterion.CERTIFIED)
        whole = np.broadcast_to(W, F.shape)
        corner = np.broadcast_to(2.0 * np.diag(D) - W, F.shape)
        both = np.block([[corner, d * F], [d * np.swapaxes(F, 1, 2), whole]])
        lowest = min(lowest, float(np.linalg.eigvalsh(both).min()))
    return (
        f"design: common multiplier at all {len(along.motion)} instants",
        bool(lowest >= -AGREEMENT * D.max()),
        f"lowest eigenvalue {lowest:.3e}",
    )
