"""`sealag certify`: the certificate, its sentence and its numbers."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

from sealag import design
from sealag.cli._commands import busy, compile_kernels, note
from sealag.cli._json import show_json
from sealag.cli._pictures import (
    check_picture,
    drawn,
    of_certificate,
    require_motion,
    show_picture,
)
from sealag.cli._terminal import show
from sealag.errors import InputError
from sealag.files import Draft, check_output
from sealag.passivity import Answer, Certificate, Criterion, Status
from sealag.units import time_text

LONGEST_COUNT = 9
"""Digits of a number of instants: no motion has more."""


def _count(proofs: str) -> int:
    """How many instants --proofs asks for."""
    number = proofs.isascii() and proofs.isdigit() and len(proofs) <= LONGEST_COUNT
    if not number or int(proofs) < 1:
        raise InputError(
            f"--proofs is {proofs!r}; it must be a whole number from 1 up with at most "
            f"{LONGEST_COUNT} digits, or all."
        )
    return int(proofs)


class Reading(TypedDict):
    """How a motion's file is read.

    Attributes:
        columns: names in the file; None for its own.
        quaternion: order of the base's; None for xyzw.
    """

    columns: str | None
    quaternion: str | None


def certify_project(
    project: str,
    motion: Path | None,
    *,
    reading: Reading,
    criterion: str | None,
    time_varying: bool,
    proofs: str,
    out: Path | None,
    allow_unstable: bool,
    plot: Path | None,
    as_json: bool,
) -> int:
    """Certify, write what the certificate's own check confirms and show the answer.

    Returns:
        0 if the design is certified, or passive only where that is enough; else 1.
    """
    if criterion is not None and criterion not in set(Criterion):
        raise InputError(f"--criterion is {criterion!r}; it must be certified or published.")
    count = None if proofs == "all" else _count(proofs)
    system = design.load(project)
    path = out or Path(f"{system.name}.certificate.json")
    inputs = [*system.files, *([motion] if motion else [])]
    check_output(path, *inputs)
    check_picture(plot, *inputs, beside=path)
    along = system.motion_of(motion, **reading, tell=note)
    require_motion(plot, len(along))
    system.criterion_asked(along, criterion, time_varying=time_varying, proofs=count)
    with Draft(path) as draft:
        compile_kernels()
        with busy("certifying", along):
            certificate = design.certify(
                system, along, criterion=criterion, time_varying=time_varying, proofs=count
            ).confirmed()
        certificate.write(draft)
    if plot is not None:
        of_certificate(certificate, system.name).write(plot)
    warnings = system.warnings(along)
    if as_json:
        show_json({**certificate.summary(), "warnings": warnings, **drawn(plot)})
    else:
        _show_certificate(certificate, path, warnings)
        show_picture(plot)
    enough = {Status.CERTIFIED, *([Status.PASSIVE_ONLY] if allow_unstable else [])}
    return 0 if certificate.answer.status in enough else 1


def _stability(answer: Answer) -> str:
    """Stability without delay, in words; a passive loop need not be stable."""
    if answer.unstable_modes:
        count = answer.unstable_modes
        return f"no: {count} unstable root{'s' * (count > 1)} without delay"
    if answer.stable is None:
        return "not known"
    return "yes" if answer.stable else "no"


def _published(answer: Answer) -> str:
    """The printed criterion's bound; not computed by itself where a large program takes minutes."""
    if answer.published_max_delay_s is None:
        return "not asked; --criterion published tells, by a semidefinite program"
    return time_text(answer.published_max_delay_s)


def _show_certificate(certificate: Certificate, path: Path, warnings: Sequence[str]) -> None:
    question, answer = certificate.question, certificate.answer
    worst = answer.worst
    shares = sorted(worst.direction.items(), key=lambda item: -item[1])
    limiting = ", ".join(f"{name} {share:.0%}" for name, share in shares[:3] if share >= 0.01)
    verdict = answer.status.value.replace("_", " ")
    show(certificate.headline)
    for warning in warnings:
        show(f"warning: {warning}")
    rows = [
        ("verdict", f"{verdict} ({question.criterion} criterion)"),
        ("stable", _stability(answer)),
        ("largest delay", time_text(answer.max_delay_s)),
        ("delay of the design", time_text(question.delay_s)),
        (
            "worst instant",
            f"{worst.instant} of {question.instants}, at {worst.time_s:.3f} s",
        ),
        ("limiting joints", limiting),
        ("jitter margin", time_text(answer.jitter_margin_s)),
        ("exact local margin", time_text(answer.local_margin_s)),
        ("first crossing", time_text(answer.first_crossing_s)),
        ("published criterion says", _published(answer)),
        ("certificate", str(path)),
    ]
    if answer.common_multiplier_delay_s is not None:
        rows.insert(3, ("one multiplier for all", time_text(answer.common_multiplier_delay_s)))
    if answer.time_varying_delay_s is not None:
        rows.insert(4, ("time-varying matrices", time_text(answer.time_varying_delay_s)))
    for name, value in rows:
        show(f"{name:26} {value}")
    for reason in answer.reasons:
        show(f"{verdict} because {reason}")
    for bound, reason in answer.left_open.items():
        show(f"open whether {bound} is longer: {reason}")
    for assumption in answer.assumptions:
        show(f"assumed: {assumption.text}")
