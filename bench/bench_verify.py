"""The check of a certificate's first crossing, beside the margin that it checks."""

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import sealag
from sealag.passivity import Certificate

PROJECTS = ("examples/go2.toml", "examples/baxter.toml", "examples/talos.toml")
REPEATS = 3


def _fastest(call: Callable[[], object]) -> float:
    """Processor seconds, the best of some runs."""
    costs = []
    for _ in range(REPEATS):
        start = time.process_time()
        call()
        costs.append(time.process_time() - start)
    return min(costs)


def _checked(path: Path) -> None:
    assert all(check.ok for check in Certificate.verify(path).checks)


def run() -> None:
    """Print verification of stable loops as a multiple of the search for all their crossings."""
    print("\nVerification of a certificate beside the search for all crossings of its loop")
    for project in PROJECTS:
        system = sealag.load(project)
        certificate = sealag.certify(system)
        loop = system.frozen()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "certificate.json"
            certificate.write(path)
            check = _fastest(partial(_checked, path))
        margin = _fastest(loop.margin)
        print(
            f"  {project:24}{len(loop.states):4d} states {check * 1e3:7.0f} ms, "
            f"{check / margin:5.2f} x the margin's"
        )


if __name__ == "__main__":
    run()
