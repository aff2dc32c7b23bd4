"""Take every robot below a folder through sealag: python -m corpus FOLDER [--out TABLE.md]."""

import argparse
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from corpus.find import robots
from corpus.run import Outcome, taken


def main() -> int:
    """Print a line for each robot; 1 if something must not be."""
    parser = argparse.ArgumentParser(prog="corpus", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, help="Markdown table to write.")
    parser.add_argument("--word", default="", help="Only files with this in their path.")
    parser.add_argument("--read", action="store_true", help="Stop when the robot is read.")
    given = parser.parse_args()
    if not given.folder.is_dir():
        parser.error(f"{given.folder} is no folder")
    outcomes = []
    for path in robots(given.folder):
        name = str(path.relative_to(given.folder))
        if given.word in name:
            with tempfile.TemporaryDirectory() as folder:
                outcomes.append(taken(path, Path(folder), read_only=given.read))
            print(f"{outcomes[-1].seconds:7.1f} s  {name}: {_said(outcomes[-1])}", flush=True)
    if given.out:
        given.out.write_text("\n".join(table(outcomes, given.folder)) + "\n")
    found = sum(bool(one.findings) for one in outcomes)
    print(f"{len(outcomes)} robots, {found} with findings")
    return int(found > 0)


def table(outcomes: Iterable[Outcome], folder: Path) -> Iterator[str]:
    """Yield the lines of a Markdown table, after a count of the verdicts.

    Args:
        outcomes: of all robots.
        folder: where they are.
    """
    listed = list(outcomes)
    counts = Counter(one.verdict or "finding" for one in listed)
    yield f"{len(listed)} robots: " + ", ".join(f"{n} {word}" for word, n in counts.most_common())
    yield ""
    yield "| robot | joints | answer | s |"
    yield "|---|---|---|---|"
    for one in listed:
        name = one.robot.relative_to(folder)
        answer = _said(one).replace(str(one.robot.parent), "").replace("|", "\\|")
        yield f"| {name} | {one.joints or ''} | {answer} | {one.seconds:.1f} |"


def _said(one: Outcome) -> str:
    refusal = one.refusal.removeprefix("sealag: ").replace(f"{one.robot}", one.robot.name)
    return ": ".join(filter(None, (one.verdict, refusal, "; ".join(one.findings))))


if __name__ == "__main__":
    raise SystemExit(main())
