"""A sweep: many designs, one question, one dataset."""

import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sealag.design import System, load
from sealag.errors import InputError, SealagError
from sealag.sweep._axis import Axis, Choices
from sealag.sweep._cluster import on_cluster
from sealag.sweep._dataset import Dataset
from sealag.sweep._job import ERROR, KIND, POINT, Bench, Job, asked, digest_of
from sealag.sweep._plot import draw
from sealag.sweep._question import Question
from sealag.sweep._sample import Sample
from sealag.sweep._swept import Swept, summed_up
from sealag.version import __version__
from sealag.workers import in_parallel

MOST_BLOCKS = 1000
"""Parts of a sweep that has few points; one of very many has parts of LARGEST_BLOCK."""
LARGEST_BLOCK = 250


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Many designs of one project, and what each is asked.

    Attributes:
        system: the project's own design.
        sample: which points are taken.
        job: what workers know.
    """

    system: System
    sample: Sample
    job: Job

    @classmethod
    def of(
        cls,
        project: str | Path,
        over: Sequence[str],
        *,
        ask: str = "certify",
        motion: str | Path | None = None,
        sample: str = "grid",
        tell: Callable[[str], None] | None = None,
    ) -> "Sweep":
        """Describe a sweep, and refuse one that no point could answer.

        Args:
            project: the project file, or `bundled:hume`.
            over: expressions KEY=1,2,5 or KEY=LOW:HIGH:log40 (lin40, int; without the number for
                samples); KEY is a dotted path in the file, with places from 0 or names in lists.
            ask: certify, bound, margin, simulate, tune, or tune:aim=damping,number=jitter.
            motion: a motion's file; the project's own, or its posture, if None.
            sample: grid, lhs:POINTS, lhs:POINTS:SEED, or sobol likewise.
            tell: called with each sentence on what was left out of the motion.

        Returns:
            The sweep.

        Raises:
            InputError: an expression is none, a key takes none of its values, or the question has
                no answer.
            FileError: a file cannot be read.
        """
        system = load(project)
        given = [Axis.of(text) for text in over]
        # Designs that differ in their delays alone lie side by side: they share what is computed.
        axes = tuple(sorted(given, key=lambda axis: axis.key.table == "delays"))
        if not axes:
            raise InputError("Nothing is swept; say what, such as --over KEY=LOW:HIGH:lin10.")
        question = Question.of(ask)
        question.check(system)
        if motion is not None:
            system.motion_of(motion, tell=tell or warnings.warn)
        plain = Job(
            path=system.files[0].absolute(),
            text=system.text,
            keys=tuple(axis.key for axis in axes),
            question=question,
            motion=None if motion is None else Path(motion).absolute(),
            digests={},
        )
        _require_apart(axes, system.text)
        files = {*system.files, *([plain.motion] if plain.motion else [])}
        for axis in axes:
            files |= _tried(axis, plain)
        digests = {str(file.absolute()): digest_of(file) for file in sorted(files)}
        job = Job(
            path=plain.path,
            text=plain.text,
            keys=plain.keys,
            question=question,
            motion=plain.motion,
            digests=digests,
        )
        return cls(system=system, sample=Sample.of(sample, axes), job=job)

    @property
    def block(self) -> int:
        """Points of a part of the dataset; a grid's designs that differ in their delays alone are
        not divided among workers, if they are few."""
        least = max(1, -(-self.sample.points // MOST_BLOCKS))
        alike = self.sample.alike if self.job.question.spans_delays else 1
        return min(-(-least // alike) * alike, LARGEST_BLOCK)

    def run(
        self,
        folder: Path,
        *,
        jobs: int | None = None,
        scheduler: str | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Swept:
        """Ask every point that has no answer yet, and write the answers.

        A part is written whole when its points are done: a process that is killed loses the blocks
        under way and nothing else, and the same sweep into the same folder goes on from there. Rows
        do not depend on where they are computed.

        Args:
            folder: where the dataset is; it is made if needed.
            jobs: processes; one for each core if None.
            scheduler: address of a cluster of dask.distributed instead.
            progress: called with the number of points that have answers.

        Returns:
            What the whole dataset comes to.

        Raises:
            FileError: the folder holds something else, or a file changed meanwhile.
            InputError: the number of jobs is none, or the cluster does not answer.
        """
        if jobs is not None and (jobs < 1 or scheduler is not None):
            raise InputError("--jobs is a number from 1 up, and does not go with --scheduler.")
        dataset = self.dataset(folder)
        with dataset.held():
            finished = dataset.finished()
            done = sum(len(self._numbers(block)) for block in finished)
            before = done
            if progress is not None:
                progress(done)
            cases = self._cases(finished)
            if scheduler is not None:
                answers = on_cluster(_block, cases, scheduler=scheduler)
            else:
                answers = in_parallel(_block, cases, jobs=jobs or cores(), ordered=False)
            for block, rows in answers:
                dataset.write(block, rows)
                done += len(rows)
                if progress is not None:
                    progress(done)
            return summed_up(dataset, self.job.question, computed=done - before)

    def plot(self, folder: Path, path: Path) -> None:
        """Draw the dataset: a curve over one key, a heat map over two, else parallel coordinates.

        Args:
            folder: where the dataset is.
            path: the picture: PNG, SVG, PDF or HTML by its ending.

        Raises:
            InputError: the ending is another.
            FileError: the picture cannot be written.
        """
        draw(self.dataset(folder), self.sample, self.job.question, path)

    def dataset(self, folder: Path) -> Dataset:
        """Return the sweep's dataset in a folder.

        Args:
            folder: where it is.
        """
        columns = {POINT: int}
        columns |= {axis.key.text: _type(axis) for axis in self.sample.axes}
        columns |= {**self.job.question.columns, KIND: str, ERROR: str}
        return Dataset(folder=folder, columns=columns, about=self._about())

    def _about(self) -> dict[str, Any]:
        """What makes a sweep another one."""
        job, sample = self.job, self.sample
        first = sample.block(0, min(self.block, sample.points))
        return {
            "version": __version__,
            "question": {"ask": job.question.ask.value, **job.question.options},
            "keys": {axis.key.text: repr(axis.values) for axis in sample.axes},
            "sample": [sample.kind.value, sample.points, sample.seed],
            "points": [[repr(value) for value in values] for values in first],
            "block": self.block,
            "files": sorted(job.digests.values()),
        }

    def _numbers(self, block: int) -> range:
        return range(block * self.block, min((block + 1) * self.block, self.sample.points))

    def _cases(self, finished: frozenset[int]) -> Iterator[tuple[Any, ...]]:
        for block in range(-(-self.sample.points // self.block)):
            if block not in finished:
                numbers = self._numbers(block)
                points = self.sample.block(numbers.start, numbers.stop)
                yield block, self.job, numbers.start, points


def _block(block: int, job: Job, first: int, points: Any) -> tuple[int, list[dict[str, Any]]]:
    return block, asked(job, first, points)


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _type(axis: Axis) -> type:
    if isinstance(axis.values, Choices):
        return type(axis.values.values[0])
    return type(axis.values.at(0.0))


def _require_apart(axes: Sequence[Axis], text: str) -> None:
    """Refuse two keys that are one value, or of which one holds the other."""
    import tomlkit

    document = tomlkit.parse(text)
    places = [axis.key.place(document) for axis in axes]
    for i, (axis, place) in enumerate(zip(axes, places)):
        for other, there in zip(axes[:i], places[:i]):
            shared = min(len(place), len(there))
            if place[:shared] == there[:shared]:
                raise InputError(
                    f"--over {other.key.text} and --over {axis.key.text} are of one value; give "
                    "each value one --over."
                )


def _tried(axis: Axis, job: Job) -> set[Path]:
    """Files of the design with some of a key's values, the other keys as the file has them.

    Raises:
        InputError: none is accepted.
    """
    alone = Job(
        path=job.path,
        text=job.text,
        keys=(axis.key,),
        question=job.question,
        motion=None,
        digests={},
    )
    bench, files = Bench(alone), set[Path]()
    refused: SealagError | None = None
    for value in axis.probes():
        try:
            files |= {*bench.system([value]).files}
        except SealagError as error:
            refused = refused or error
    if not files and refused is not None:
        raise InputError(
            f"--over {axis.key.text}: the project takes none of its values: {refused}"
        ) from refused
    return files
