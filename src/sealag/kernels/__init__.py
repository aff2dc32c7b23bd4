"""Compiled kernels: `@njit` functions over arrays, nothing else.

What a kernel needs at every call is a NamedTuple that is handed over once, by `keep`: to pass a
hundred arrays at every call costs more than a simulation step. Each kernel has a slow twin in plain
NumPy under ``tests/reference``. Importing this package compiles nothing; ``python -m
sealag.kernels`` compiles and caches every kernel.
"""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any


def keep(parts: Any) -> Any:
    """Return a NamedTuple of arrays, numbers and such NamedTuples as kernels take it.

    Arrays stay live: what a kernel writes is seen through the NamedTuple, and the other way round.

    Args:
        parts: the NamedTuple.
    """
    from sealag.kernels._jit import keep as compiled

    return compiled(parts)


def compile_all(progress: Callable[[str], None], *, missing_only: bool = False) -> None:
    """Compile and cache kernels: one to two minutes after an installation, then never again.

    Args:
        progress: called with the name of each module before it is compiled.
        missing_only: leave out modules that are in the cache.
    """
    from sealag.kernels._tiny import entries

    for name, call in entries():
        if not (missing_only and _cached(name)):
            progress(name)
            call()


def compiled() -> bool:
    """Return whether nothing is left to compile beforehand: every kernel is in the cache, or there
    is none, so that each process compiles what it needs."""
    from sealag.kernels._jit import KEPT_ON_DISK
    from sealag.kernels._tiny import entries

    return not KEPT_ON_DISK or all(_cached(name) for name, _ in entries())


def _cached(name: str) -> bool:
    """Whether the newest index of a module's kernels is younger than its source."""
    from numba.core.dispatcher import Dispatcher

    module = importlib.import_module(f"{__name__}.{name}")
    kernels = [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    own = [kernel for kernel in kernels if kernel.py_func.__module__ == module.__name__]
    # Inner kernels are not cached and have no path.
    place = next(path for kernel in own if (path := kernel.stats.cache_path))
    indices = Path(str(place)).glob(f"{name}.*.nbi")
    source = Path(str(module.__file__)).stat().st_mtime
    return any(index.stat().st_mtime > source for index in indices)
