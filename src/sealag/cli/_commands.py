"""Commands: each calls one function of the library and shows its answer."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path

from sealag import design
from sealag.cli._json import show_json
from sealag.cli._terminal import show
from sealag.errors import CertificateError, FileError, InputError, either
from sealag.files import check_output, opened, write_text
from sealag.passivity import Certificate, Status
from sealag.robot import Motion

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
