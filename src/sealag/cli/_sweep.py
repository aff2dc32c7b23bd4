"""`sealag sweep`: many designs of a project, one row each."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sealag.cli._commands import compile_kernels, note
from sealag.cli._json import show_json
from sealag.cli._pictures import check_picture
from sealag.cli._terminal import show
from sealag.sweep import Sweep

_PATIENCE = 10.0  # s between two lines of progress where there is no terminal


def sweep_project(
    project: str,
    over: Sequence[str],
    *,
    out: Path | None,
    jobs: int | None,
    scheduler: str | None,
    plot: Path | None,
    as_json: bool,
    **asked: Any,
) -> int:
    """Ask every point, write the dataset and show what it comes to.

    Returns:
        0 if every point has its row; 2 if all of them are refused; 3 if the tool itself failed at
        some.
    """
    sweep = Sweep.of(project, over, tell=note, **asked)
    folder = out or Path(f"{sweep.system.name}.sweep")
    if plot is not None:
        check_picture(plot, *sweep.system.files, beside=folder)
    compile_kernels()
    with _progress(sweep.sample.points) as progress:
        found = sweep.run(folder, jobs=jobs, scheduler=scheduler, progress=progress)
    if plot is not None:
        sweep.plot(folder, plot)
    if as_json:
        show_json({**found.summary(), "plot": None if plot is None else str(plot)})
    else:
        show(f"{'points':26} {found.points}, {found.computed} of them computed now")
        for verdict, count in found.verdicts.items():
            show(f"{'  ' + _verdict(verdict, found.verdict):26} {count}")
        show(f"{'refused':26} {found.refused}")
        if found.refusal is not None:
            show(f"{'  first of them':26} {found.refusal}")
        if found.smallest is not None:
            show(f"{found.column:26} {found.smallest:.6g} to {found.largest:.6g}")
        show(f"{'dataset':26} {found.folder}")
        if plot is not None:
            show(f"{'plot':26} {plot}")
    if found.failed:
        show(f"sealag: the tool itself failed at {found.failed} points; see error", error=True)
        return 3
    return 2 if found.refused == found.points else 0


def _verdict(word: str, column: str | None) -> str:
    """A verdict in words; yes and no by what was asked."""
    return {"True": f"{column}", "False": f"not {column}"}.get(word, word.replace("_", " "))


@contextmanager
def _progress(points: int) -> Iterator[Callable[[int], None]]:
    """Show points done and time left: a bar on a terminal, else a line now and then."""
    from rich import progress
    from rich.console import Console

    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield _Lines(points)
        return
    columns = (
        progress.TextColumn("sweeping"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        progress.TextColumn("left"),
        progress.TimeRemainingColumn(elapsed_when_finished=False),
    )
    with progress.Progress(*columns, console=console, transient=True) as bar:
        task: progress.TaskID | None = None

        def update(done: int) -> None:
            nonlocal task
            if task is None:  # what was finished before says nothing of the speed
                task = bar.add_task("sweeping", total=points, completed=done)
            bar.update(task, completed=done)

        yield update


class _Lines:
    """Progress in lines."""

    def __init__(self, points: int) -> None:
        self._points, self._first = points, -1
        self._start = self._last = time.monotonic()

    def __call__(self, done: int) -> None:
        now = time.monotonic()
        if self._first < 0:
            self._first = done
        elif now - self._last >= _PATIENCE and done < self._points:
            left = (now - self._start) * (self._points - done) / (done - self._first)
            self._last = now
            show(
                f"sealag: {done} of {self._points} points, {_length(left)} left",
                error=True,
            )


def _length(seconds: float) -> str:
    """A time in whole minutes or seconds."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
