"""Compile and cache every kernel, so that no user waits for the compiler at a first command."""

import importlib
import pkgutil
import sys
import time

import sealag.kernels


def main() -> None:
    """Import each kernel module and call its ``warm()``."""
    for module in pkgutil.iter_modules(sealag.kernels.__path__):
        if module.name.startswith("__"):
            continue
        start = time.perf_counter()
        importlib.import_module(f"sealag.kernels.{module.name}").warm()
        seconds = time.perf_counter() - start
        print(f"  kernels/{module.name}: {seconds:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
