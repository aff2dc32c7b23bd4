"""Run the mutants: python -m mutants [--room delay] [--first N] [--count N] [--jobs 2].

Each is applied to a copy of the tree, and the tests of its room are run until one fails. A mutant
that none notices is a gap; so is one whose text stands nowhere any more.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

from mutants.catalogue import MUTANTS, TESTS, Mutant

ROOT = Path(__file__).resolve().parents[2]
WANTED = 0.95
"""Share of the mutants that must be noticed."""


def copied(folder: Path) -> Path:
    """Copy what the tests need, with the compiled kernels."""
    for name in ("src", "tests", "studies", "examples", "docs", "bench"):
        shutil.copytree(ROOT / name, folder / name)
    for name in ("pyproject.toml", "README.md", "CONTRIBUTING.md", "CITATION.cff"):
        shutil.copy(ROOT / name, folder)
    return folder


def noticed(mutant: Mutant, tree: Path) -> tuple[str, str]:
    """Apply a mutant to a tree, run its tests, undo it; how it ended, and which test noticed."""
    file = tree / "src" / "sealag" / mutant.file
    text = file.read_text()
    if text.count(mutant.old) != 1:
        return "stale", f"its text stands there {text.count(mutant.old)} times"
    file.write_text(text.replace(mutant.old, mutant.new))
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider",
             *TESTS[mutant.room].split()],
            cwd=tree, capture_output=True, text=True, timeout=600, check=False,
            env={"PATH": "/usr/bin:/bin", "HOME": str(tree), "OPENBLAS_NUM_THREADS": "1",
                 "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": f"{tree}/src:{tree}/studies:"
                 f"{tree}/tests:{tree}"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "killed", "the tests did not end"
    finally:
        file.write_text(text)
    if done.returncode == 0:
        return "survived", ""
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return "killed", (failed or done.stdout.splitlines()[-1:] or [""])[0][:120]


def main() -> int:
    """Run mutants and count what is noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", default=None, choices=sorted(TESTS))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=len(MUTANTS))
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    chosen = [one for one in MUTANTS if given.room in (None, one.room) and not one.same]
    chosen = chosen[given.first : given.first + given.count]
    trees: Queue[Path] = Queue()
    ends: list[str] = []

    def run(mutant: Mutant) -> None:
        tree, began = trees.get(), time.monotonic()
        end, words = noticed(mutant, tree)
        trees.put(tree)
        ends.append(end)
        print(f"{end:9} {time.monotonic() - began:4.0f} s  {mutant.file}: {mutant.falsifies}  "
              f"{words}", flush=True)  # fmt: skip

    with tempfile.TemporaryDirectory() as folder:
        for job in range(given.jobs):
            trees.put(copied(Path(folder) / str(job)))
        with ThreadPoolExecutor(given.jobs) as threads:
            list(threads.map(run, chosen))
    killed = ends.count("killed")
    print(f"{killed} of {len(ends)} mutants are noticed, {ends.count('survived')} survive, "
          f"{ends.count('stale')} are stale")  # fmt: skip
    return int(killed < WANTED * len(ends))


if __name__ == "__main__":
    raise SystemExit(main())
