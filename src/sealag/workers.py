"""Independent computations on several processes, which end with the one that asked."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from typing import Any

_LOOK = 0.5  # s between two looks of a worker for the process that it works for


def in_parallel(
    call: Callable[..., Any], cases: Iterable[tuple[Any, ...]], *, jobs: int, ordered: bool = True
) -> Iterator[Any]:
    """Call a function for many cases and yield what it answers as it comes.

    Cases are taken from the iterable a few ahead of the answers, so that neither has to fit into
    memory. A worker ends half a second after the process that asked, also if that was killed;
    Ctrl-C is left to that process. With one job there is no worker.

    Args:
        call: a function of a module.
        cases: its arguments, case by case.
        jobs: number of processes.
        ordered: whether answers come in the order of the cases, or as soon as they are there.

    Yields:
        Answers.
    """
    if jobs == 1:
        yield from (call(*case) for case in cases)
        return
    from joblib import Parallel, delayed

    work = (delayed(_answer)(os.getpid(), call, case) for case in cases)
    order = "generator" if ordered else "generator_unordered"
    choices: dict[str, Any] = {"return_as": order, "batch_size": 1}
    yield from Parallel(n_jobs=jobs, **choices)(work)


def _answer(parent: int, call: Callable[..., Any], case: tuple[Any, ...]) -> Any:
    if os.getpid() != parent:
        _end_with(parent)
    return call(*case)


@cache
def _end_with(parent: int) -> None:
    """Watch the parent from now on, once in a process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)


__all__ = ["in_parallel"]
