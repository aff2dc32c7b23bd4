"""Ctrl-C between compiled calls."""

import signal
import threading
from typing import Any, Self


class Interrupt:
    """Keeps Ctrl-C until it is asked for.

    Python's own handler raises wherever Python code runs next: also inside a compiled call, where
    Numba turns answers into Python objects and crashes. Other threads and processes with handlers
    of their own are left alone.

    Use it as a context manager.
    """

    def __init__(self) -> None:
        self._asked = False
        self._ours = False

    def __enter__(self) -> Self:
        here = threading.current_thread() is threading.main_thread()
        self._ours = here and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._ours:
            signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if kind is None:
            self.check()

    def _note(self, *_: Any) -> None:
        self._asked = True

    def check(self) -> None:
        """Raise what was kept, once.

        Raises:
            KeyboardInterrupt: Ctrl-C was pressed.
        """
        if self._asked:
            self._asked = False
            raise KeyboardInterrupt
