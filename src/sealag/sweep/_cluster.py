"""Blocks of points on a cluster of dask.distributed that is there already."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from sealag.errors import InputError
from sealag.extras import extra
from sealag.version import __version__

_PATIENCE = "10s"
_AHEAD = 2
"""Blocks a worker thread has in hand; more only fill the scheduler's memory."""


def on_cluster(
    call: Callable[..., Any], cases: Iterable[tuple[Any, ...]], *, scheduler: str
) -> Iterator[Any]:
    """Call a function for many cases on a cluster and yield what it answers as it comes.

    Args:
        call: a function of a module.
        cases: its arguments, case by case; taken a few ahead of the answers.
        scheduler: address of the cluster's scheduler, such as tcp://10.0.0.1:8786.

    Yields:
        Answers.

    Raises:
        InputError: dask.distributed is not installed, nobody answers at the address, there are no
            workers, or they have no sealag or another version.
    """
    distributed = extra("distributed", use="--scheduler")
    try:
        # A client of what is no address would wait and print a traceback as it is dropped.
        distributed.comm.get_address_host_port(scheduler)
        client = distributed.Client(scheduler, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--scheduler is {scheduler!r}, and no scheduler answers there; give the address that "
            "`dask scheduler` prints, such as tcp://10.0.0.1:8786."
        ) from error
    with client:
        threads = _threads(client, scheduler)
        waiting = iter(cases)
        running = distributed.as_completed(with_results=True, loop=client.loop)
        for _ in range(_AHEAD * threads):
            _send(client, running, call, waiting)
        for _, answer in running:
            yield answer
            _send(client, running, call, waiting)


def _send(client: Any, running: Any, call: Any, waiting: Iterator[tuple[Any, ...]]) -> None:
    case = next(waiting, None)
    if case is not None:
        running.add(client.submit(call, *case, pure=False))


def _threads(client: Any, scheduler: str) -> int:
    """How many threads the workers have, which must be able to answer as this process does."""
    try:
        versions = client.run(_version)
    except ModuleNotFoundError:
        versions = {"": "no sealag"}
    if not versions:
        raise InputError(f"--scheduler is {scheduler!r}; it has no workers: start some.")
    for worker, found in versions.items():
        if found != __version__:
            raise InputError(
                f"--scheduler is {scheduler!r}; its worker {worker} has {found}, and this is sealag"
                f" {__version__}: install the same there."
            )
    return sum(client.nthreads().values())


def _version() -> str:
    return __version__
