"""Compiled kernels: `@njit` functions over arrays, nothing else.

Each kernel has a slow twin in plain NumPy under ``tests/reference``. Importing this package
compiles nothing; ``python -m sealag.kernels`` compiles and caches every kernel.
"""

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType


def compile_all(progress: Callable[[str], None], *, missing_only: bool = False) -> None:
    """Compile and cache kernels: two minutes after an installation, then never again.

    Args:
        progress: called with the name of each module before it is compiled.
        missing_only: leave out modules that are in the cache.
    """
    for module in _modules():
        if not (missing_only and _cached(module)):
            progress(module.__name__.rpartition(".")[2])
            module.warm()


def compiled() -> bool:
    """Return whether every kernel module is in the cache."""
    return all(_cached(module) for module in _modules())


def _modules() -> Iterator[ModuleType]:
    for found in pkgutil.iter_modules(__path__):
        if not found.name.startswith("__"):
            yield importlib.import_module(f"{__name__}.{found.name}")


def _cached(module: ModuleType) -> bool:
    """Whether the newest index of a module's kernels is younger than its source."""
    from numba.core.dispatcher import Dispatcher

    own = [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    own = [kernel for kernel in own if kernel.py_func.__module__ == module.__name__]
    if not own:
        return True
    name = module.__name__.rpartition(".")[2]
    indices = Path(str(own[0].stats.cache_path)).glob(f"{name}.*.nbi")
    source = Path(str(module.__file__)).stat().st_mtime
    return any(index.stat().st_mtime > source for index in indices)
