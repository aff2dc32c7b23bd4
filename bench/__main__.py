"""Run every benchmark: each module `bench_*.py` here has a `run()`."""

import importlib
import pkgutil
import sys

import bench


def main() -> None:
    """Run the benchmarks named on the command line, or all."""
    names = sorted(m.name for m in pkgutil.iter_modules(bench.__path__) if m.name[:6] == "bench_")
    wanted = [f"bench_{name}" for name in sys.argv[1:]] or names
    for name in wanted:
        importlib.import_module(f"bench.{name}").run()


if __name__ == "__main__":
    main()
