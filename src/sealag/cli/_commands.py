"""Commands: each calls one function of the library and shows its answer."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

from sealag import design
from sealag.cli._json import show_json
from sealag.cli._pictures import check_picture, drawn, of_margins, of_rates, show_picture
from sealag.cli._terminal import show
from sealag.errors import CertificateError, FileError, InputError, either
from sealag.files import check_output, opened, write_text
from sealag.passivity import Certificate, Status
from sealag.robot import Motion
from sealag.units import seconds_from_ms, time_text

LONGEST_HORIZON_MS = 1e6
STUDY = "humanoids2016"
"""The package that reproduces the paper: a guest, which the library does not import."""
LARGEST_LIST = 250
"""Checks that hold and are shown one by one."""
MANY_INSTANTS = 20_000
"""Instants from which a motion takes so long that a log says so."""
SLOWEST_INSTANT_S = 0.03
"""Search of one instant of ANYmal for crossings. Where bounds decide, it takes a hundredth."""

_STATED = {
    Status.CERTIFIED: "",
    Status.PASSIVE_ONLY: ": as it states, the design is passive only, not shown to be stable",
    Status.NOT_CERTIFIED: ": as it states, the design is not certified",
}

_BASES = {"auto": None, "floating": True, "fixed": False}


def init_project(urdf: str, out: Path | None, *, base: str) -> Path:
    """Write a starter project and say what was decided; an existing file is not overwritten."""
    if base not in _BASES:
        raise InputError(f"--base is {base!r}; it must be {either(list(_BASES))}.")
    stem = Path(urdf.rsplit(":", 1)[-1].removesuffix(".xacro")).stem
    path = out or Path(f"{stem}.toml")
    check_output(path)
    if path.exists():
        raise FileError(f"{path} exists already; choose another name with --out.")
    named = urdf
    if ":" not in urdf:
        named = os.path.relpath(Path(urdf).resolve(), path.resolve().parent)
    said: list[str] = []
    text = design.starter_project(urdf, floating_base=_BASES[base], named=named, tell=said.append)
    write_text(path, text, replace=False)
    for sentence in said:
        show(f"sealag: {sentence}", error=True)
    return path


def compile_kernels() -> None:
    """Compile kernels that are not cached, with a message: minutes, once an installation."""
    from sealag.kernels import compile_all, compiled

    if compiled():
        return
    show("sealag: compiling its kernels, once after the installation (minutes)", error=True)
    compile_all(
        lambda name: show(f"sealag: compiling {name}", error=True),
        missing_only=True,
    )


@contextmanager
def busy(what: str, motion: Motion | None = None) -> Iterator[None]:
    """Show a spinner on standard error if it is a terminal; elsewhere say that a long motion takes
    long.

    Args:
        what: what is being done.
        motion: the motion that it is done for, if there is one.
    """
    from rich.console import Console

    console = Console(stderr=True)
    instants = 1 if motion is None else len(motion)
    if instants >= MANY_INSTANTS:
        most = max(1, round(instants * SLOWEST_INSTANT_S / 60.0))
        what = f"{what} {instants} instants: up to {most} min, Ctrl-C ends it"
        if not console.is_terminal:
            show(f"sealag: {what}", error=True)
    with console.status(what) if console.is_terminal else nullcontext():
        yield


def note(text: str) -> None:
    """Show what was done with a file beside the answer.

    Args:
        text: the sentence.
    """
    show(f"sealag: {text}", error=True)


def margin_project(
    project: str,
    motion: Path | None,
    *,
    columns: str | None,
    quaternion: str | None,
    horizon_ms: float | None,
    rate_sweep: bool,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Show the exact local margin at every instant, or at a sample of a long motion."""
    if rate_sweep:
        if any(given is not None for given in (motion, columns, quaternion, horizon_ms)):
            raise InputError("--rate-sweep is of the project's posture: leave out the others.")
        _sweep_rates(project, plot=plot, as_json=as_json)
        return
    if plot is not None and horizon_ms is None:
        raise InputError(
            "--plot of a margin shows unstable roots against delay, or what sample rates tolerate; "
            "give --horizon-ms or --rate-sweep."
        )
    if horizon_ms is not None and not 0.0 < horizon_ms <= LONGEST_HORIZON_MS:
        raise InputError(
            f"--horizon-ms is {horizon_ms:g}; it must be more than 0 and at most "
            f"{LONGEST_HORIZON_MS:g}."
        )
    system = design.load(project)
    horizon = None if horizon_ms is None else seconds_from_ms(horizon_ms)
    check_picture(plot, *system.files, *([motion] if motion else []))
    along = system.motion_of(motion, columns=columns, quaternion=quaternion, tell=note)
    compile_kernels()
    with busy("computing margins", along):
        found = system.local_margins(along, horizon=horizon)
    if plot is not None:
        of_margins(found, system.name).write(plot)
    answer: dict[str, Any] = found.summary()
    if as_json:
        show_json({**answer, **drawn(plot)})
        return
    covers = "any passive robot and environment, every delay below it"
    passive = f"{time_text(found.passive_s):12} {covers}"
    if found.not_passive:
        passive = f"none: {found.not_passive}"
    show(f"{'passive bound':26} {passive}")
    varies = "one way varies, every delay below it" if found.memory else "every delay below it"
    show(f"{'jitter margin':26} {time_text(found.jitter_s):12} this robot, {varies}")
    show(f"{'local margin':26} {time_text(found.delay_s):12} this robot, a constant delay: exact")
    for name, value in found.channels_s.items():
        show(f"{f'  only {name} late':26} {time_text(value)}")
    if system.program is not None:
        states = f"{found.memory} states" if found.memory else "no memory"
        show(f"{'controller':26} {states}; nonlinear by {max(found.bend, 1e-6):.1g} of its answers")
    show(f"{'delay of the design':26} {time_text(system.delays.d_1)}")
    show(f"{'first crossing':26} {time_text(found.first_crossing_s)}")
    if found.frequency_rad_s is not None:
        show(f"{'frequency':26} {found.frequency_rad_s:.3f} rad/s")
    show(f"{'unstable roots':26} {found.unstable_modes} without delay")
    if found.falling:
        show(f"{'  grows without delay':26} {_largest(found.falling)}")
    show(f"{'zero roots of symmetries':26} {found.neutral}")
    show(f"{'instant':26} {found.instant} of {found.instants}, at {found.time_s:.3f} s")
    show(f"{'mode of first crossing':26} {_largest(found.mode)}")
    for low, high, count in found.intervals:
        show(f"{time_text(low):>14} to {time_text(high):14} {count} unstable roots")
    show_picture(plot)


def _largest(shares: Mapping[str, float]) -> str:
    """The three joints that take the largest part in a motion."""
    largest = sorted(shares.items(), key=lambda item: -item[1])[:3]
    return ", ".join(f"{name} {share:.0%}" for name, share in largest)


def _sweep_rates(project: str, *, plot: Path | None, as_json: bool) -> None:
    """Show what each sample rate tolerates."""
    system = design.load(project)
    check_picture(plot, *system.files)
    compile_kernels()
    with busy("sampling the loop at each rate"):
        rates = system.rate_sweep()
    if plot is not None:
        of_rates(rates, system.name).write(plot)
    if as_json:
        show_json({"rates": [rate.summary() for rate in rates], **drawn(plot)})
        return
    show("rate          largest delay   proven          the design's, without the hold")
    for rate in rates:
        # too many commands wait for the exact loop: only the proven delay is known
        largest = "not found" if rate.largest_s is None else time_text(rate.largest_s)
        verdict = {True: "stable", False: "unstable", None: "open"}[rate.stable]
        show(
            f"{rate.rate_hz:7.1f} Hz    {largest:15} {time_text(rate.proven_s):15} "
            f"{time_text(rate.way_s)}, {verdict}"
        )
    lost = [f"{rate.rate_hz:g}" for rate in rates if rate.stable is False]
    kept = [f"{rate.rate_hz:g}" for rate in rates if rate.stable]
    parts = ((lost, "unstable"), (kept, "stable"))
    show("; ".join(f"{', '.join(some)} Hz: {word}" for some, word in parts if some))
    show_picture(plot)


def verify_certificate(
    path: Path,
    *,
    exact: bool,
    second: bool,
    project: str | None,
    motion: Path | None,
    columns: str | None,
    quaternion: str | None,
    as_json: bool,
) -> int:
    """Check a certificate, against its project if one is given; 1 if it does not hold."""
    if second:
        if exact or any(given is not None for given in (project, motion, columns, quaternion)):
            raise InputError(
                "--second takes no --exact, --project or --motion: it reads the file alone."
            )
        return _second(path, as_json=as_json)
    if project is None:
        if any(given is not None for given in (motion, columns, quaternion)):
            raise InputError("--motion, --columns and --quaternion need --project.")
        result = Certificate.verify(path, exact=exact)
    else:
        Certificate.read(path)
        system = design.load(project)
        along = system.motion_of(motion, columns=columns, quaternion=quaternion, tell=note)
        compile_kernels()
        result = design.verify_design(path, system, along, exact=exact)
    if as_json:
        show_json(result.to_json_dict())
    else:
        good = [check for check in result.checks if check.ok]
        for check in good[:LARGEST_LIST]:
            show(f"ok   {check.name}: {check.detail}")
        if len(good) > LARGEST_LIST:
            show(f"ok   {len(good) - LARGEST_LIST} more checks (--json lists them)")
        for check in result.checks:
            if not check.ok:
                show(f"BAD  {check.name}: {check.detail}")
        stated = _STATED[result.status]
        show(f"the certificate holds{stated}" if result.valid else "the certificate does not hold")
    return 0 if result.valid else 1


def _second(path: Path, *, as_json: bool) -> int:
    """Show what the second verifier decides; 1 if a claim does not hold."""
    from sealag.second_verifier import LARGEST_FILE, WrongInputError, decided

    with opened(path, what="The certificate", largest=LARGEST_FILE):
        pass  # the verifier itself would wait for a named pipe
    try:
        found = decided(str(path))
    except WrongInputError as error:
        raise CertificateError(f"{path} is not a certificate: {error}.") from error
    valid = all(holds is not False for _, holds, _ in found)
    if as_json:
        names = ("name", "holds", "detail")
        show_json({"valid": valid, "claims": [dict(zip(names, one)) for one in found]})
    else:
        words = {True: "holds", False: "does not hold", None: "cannot decide"}
        for name, holds, detail in found:
            show(f"{words[holds]:14} {name}: {detail}".rstrip(": "))
        show("no claim fails" if valid else "the certificate does not hold")
    return 0 if valid else 1


def write_paper(project: str, out: Path, *, quick: bool, as_json: bool) -> None:
    """Let the study of the paper compute and write its page."""
    try:
        study = import_module(STUDY)
    except ModuleNotFoundError as error:
        if error.name != STUDY:
            raise
        raise FileError(
            f"The study of the paper is not installed: Python finds no package {STUDY}. It comes "
            "with sealag's wheel; in a checkout run make setup."
        ) from error
    answer = study.reproduce(
        out,
        project=project,
        quick=quick,
        progress=lambda text: show(text, error=True),
    )
    if as_json:
        show_json(answer)
    else:
        show(f"Wrote {answer['page']}")
