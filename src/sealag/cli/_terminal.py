"""What reaches the terminal: one line at a time, without what a terminal takes for an order."""

import io
import os
import sys
import unicodedata
from contextlib import suppress
from typing import TextIO

_HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories of characters that are not shown but act: control characters, C1 and those
that turn the direction of writing among them."""
_LONGEST = 2000
"""Letters of a message."""


def plain(text: str) -> str:
    """Return a text with hidden characters written out, such as \\x1b and \\u202e.

    Args:
        text: a message, with names and paths that somebody else chose.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(repr(one)[1:-1] if unicodedata.category(one) in _HIDDEN else one for one in text)


def show(text: str = "", *, error: bool = False) -> None:
    """Print one line, whatever the names in it are made of.

    Args:
        text: the line.
        error: whether it goes to standard error, where the middle of a long one is left out: a
            message may quote what a file says.
    """
    if error and len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"
    if not error:
        print(plain(text))
        return
    with suppress(OSError):  # a full disk: what it was about changes no status
        print(plain(text), file=sys.stderr, flush=True)
    write_no_more(sys.stderr)


def write_no_more(stream: TextIO) -> None:
    """Write what a stream holds, or discard it: failing to do so at exit would change the status.

    Args:
        stream: standard output or standard error.
    """
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def open_streams() -> bool:
    """Make standard streams usable that the caller has closed or that cannot spell a name.

    A file that is opened meanwhile must not get the number of a standard stream: what is printed
    would land in it.

    Returns:
        Whether standard output was open.
    """
    was_open = sys.stdout is not None
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            if handle != number:
                os.dup2(handle, number)
                os.close(handle)
            setattr(sys, name, os.fdopen(number, mode))
    for stream in (sys.stdout, sys.stderr):
        _spell(stream)
    return was_open


def _spell(stream: TextIO) -> None:
    """Let a stream write out letters that its encoding does not have."""
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="backslashreplace")
