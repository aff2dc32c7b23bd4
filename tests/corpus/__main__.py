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
    """Yield Markdown: what each folder's files gave, why files are refused, and each robot.

    Args:
        outcomes: of all robots.
        folder: where they are.
    """
    listed = list(outcomes)
    counts: dict[str, Counter[str]] = {}
    for one in listed:
        part = one.robot.relative_to(folder).parts[0]
        counts.setdefault(part, Counter())[one.verdict or "finding"] += 1
    yield from ("| folder | answers |", "|---|---|")
    for part, found in counts.items():
        yield f"| {part} | {', '.join(f'{n} {word}' for word, n in found.most_common())} |"
    reasons = Counter(_said(one, name="it") for one in listed if one.refusal)
    if reasons:
        yield from ("", "| files | refused, and why |", "|---|---|")
        yield from (f"| {count} | {_cell(why)} |" for why, count in reasons.most_common())
    if any(one.verdict not in ("read", "refused") for one in listed):
        yield from ("", "| robot | joints | answer | s |", "|---|---|---|---|")
        for one in listed:
            if one.joints:
                name = one.robot.relative_to(folder)
                yield f"| {name} | {one.joints} | {_cell(_said(one))} | {one.seconds:.1f} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _said(one: Outcome, *, name: str = "") -> str:
    file = name or one.robot.name
    refusal = one.refusal.removeprefix("sealag: ")
    for written in (str(one.robot), one.robot.name):
        refusal = refusal.replace(written, file)
    verdict = "" if one.verdict == "refused" and name else one.verdict
    return ": ".join(filter(None, (verdict, refusal, "; ".join(one.findings))))


if __name__ == "__main__":
    raise SystemExit(main())
