"""The process: exit statuses, and what is said when something goes wrong."""

import errno
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import suppress

from typer.exceptions import TyperException

from sealag.cli._app import app
from sealag.cli._json import show_json_error
from sealag.cli._terminal import open_streams, show, write_no_more
from sealag.errors import SealagError, SolverError
from sealag.version import __version__

WRONG, FAILED = 2, 3
"""Exit statuses besides 0, yes, and 1, a decided no."""

INTERRUPTED = 130
"""Exit status with which Typer answers Ctrl-C."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""How a disk answers that takes no more."""


def _report(error: Exception, words: Sequence[str]) -> str:
    """Write what a failure of the tool itself leaves to know; return where, or an empty text."""
    lines = [
        f"sealag {__version__}, Python {sys.version}, {sys.platform}",
        f"command: {shlex.join(['sealag', *words])}",
        f"folder: {os.getcwd()}",
        "",
        *traceback.format_exception(error),
    ]
    try:
        handle, path = tempfile.mkstemp(prefix="sealag-failure-", suffix=".txt")
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write("\n".join(lines))
    except OSError:
        return ""
    return path


def _tell(words: Sequence[str], kind: str, message: str, error: SealagError | None = None) -> None:
    """Show what went wrong: one sentence on standard error, and one object where one was asked for.

    A full disk takes no object either: the status alone says it then.
    """
    show(f"sealag: {message}", error=True)
    if "--json" in words:
        with suppress(OSError):
            file, key = (error.file, error.key) if error else (None, None)
            show_json_error(kind, message, file=file, key=key)


def _status(words: Sequence[str]) -> int:
    """Run the command line and return its status; what goes wrong is one sentence."""
    try:
        status = app(args=words, prog_name="sealag", standalone_mode=False)
        sys.stdout.flush()
    except SealagError as error:
        _tell(words, type(error).__name__, str(error), error)
        return FAILED if isinstance(error, SolverError) else WRONG
    except TyperException as error:
        known = {
            command.callback.__name__ for command in app.registered_commands if command.callback
        }
        asked = f"{words[0]} " if words[0] in known else ""
        problem = error.format_message().rstrip(".")
        _tell(words, "UsageError", f"{problem}; see sealag {asked}--help.")
        return WRONG
    except (BrokenPipeError, SystemExit):  # Typer ends with 1, a no, when the reader is gone
        return WRONG
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _FULL:
            show(f"sealag: the answer cannot be written: {error.strerror}.", error=True)
            return WRONG
        said = " ".join(str(error).split())[:300]
        report = _report(error, words)
        _tell(
            words,
            "ToolFailure",
            f"the tool itself failed ({type(error).__name__}: {said}); this is no answer "
            f"about the design. Please report it with {report or 'the command'} and its files.",
        )
        return FAILED
    if status == INTERRUPTED:
        show("sealag: interrupted", error=True)
    return status or 0


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and end the process with its status.

    0 yes or done, 1 no, 2 wrong input or an answer that cannot be written, 3 the tool failed, 130
    interrupted. What goes wrong is one sentence on standard error; with --json also one object on
    standard output, `{"status": "error", "error": {"kind", "file", "key", "message"}}`, but for
    Ctrl-C and an answer that cannot be written.

    Args:
        arguments: what follows the program's name; the process's own if None.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    answered = open_streams()
    status = _status(list(sys.argv[1:] if arguments is None else arguments) or ["--help"])
    if not answered and status in (0, 1):
        show("sealag: standard output is closed; nobody can read the answer", error=True)
        status = WRONG
    write_no_more(sys.stdout)
    raise SystemExit(status)
