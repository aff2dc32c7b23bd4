"""A folder of Parquet parts, one a block of points, each written whole or not at all."""

import fcntl
import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.dataset
import pyarrow.parquet

from sealag.errors import FileError
from sealag.files import make_folder, read_whole, write_text, written_whole

_SHEET = "_sweep.json"
"""What the folder holds; readers of Parquet folders pass over names that begin with _."""
_PART = re.compile(r"part-(\d{8})\.parquet")
_LARGEST_SHEET = 10_000_000
_MARK = b"sealag_sweep"
_TYPES = {
    float: pyarrow.float64(),
    int: pyarrow.int64(),
    bool: pyarrow.bool_(),
    str: pyarrow.string(),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """A sweep's folder.

    Attributes:
        folder: where it is.
        columns: names and types of the columns.
        about: what was asked, by words that a message can name; equal for equal sweeps.
    """

    folder: Path
    columns: Mapping[str, type]
    about: Mapping[str, Any]

    @property
    def fingerprint(self) -> str:
        """SHA-256 of what was asked."""
        return hashlib.sha256(json.dumps(self.about, sort_keys=True).encode()).hexdigest()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Make the folder and keep others out; what an earlier sweep finished stays.

        Raises:
            FileError: it holds something else, or somebody else is sweeping into it.
        """
        make_folder(self.folder)
        sheet = self.folder / _SHEET
        strangers = [name for name in os.listdir(self.folder) if not name.startswith((".", "_"))]
        if not sheet.exists():
            if strangers:
                raise FileError(
                    f"{self.folder} holds other files, such as {min(strangers)}; choose an empty "
                    "folder with --out."
                )
            write_text(sheet, json.dumps(self.about, indent=1) + "\n")
        with open(sheet, "rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise FileError(
                    f"{self.folder} is being filled by another sweep; wait for it, or choose "
                    "another --out."
                ) from None
            self._require_same(sheet)
            yield

    def _require_same(self, sheet: Path) -> None:
        there = None
        with suppress(ValueError):
            there = json.loads(read_whole(sheet, what="The sweep", largest=_LARGEST_SHEET))
        if not isinstance(there, dict):
            raise FileError(f"{sheet} is not a sweep's; choose another --out.").at(sheet)
        mine = json.loads(json.dumps(self.about))
        other = [name for name in {**there, **mine} if there.get(name) != mine.get(name)]
        if other:
            raise FileError(
                f"{self.folder} holds another sweep, which differs in its {', '.join(other)}; "
                "choose another --out."
            ).at(sheet)

    def finished(self) -> frozenset[int]:
        """Return the blocks that are there.

        Raises:
            FileError: a part is damaged or of another sweep.
        """
        found = set()
        for name in os.listdir(self.folder):
            if match := _PART.fullmatch(name):
                self._require_mine(self.folder / name)
                found.add(int(match[1]))
        return frozenset(found)

    def _require_mine(self, part: Path) -> None:
        try:
            marks = pyarrow.parquet.read_schema(part).metadata or {}
        except (pyarrow.ArrowInvalid, OSError) as error:
            raise FileError(f"{part} is damaged; remove it and sweep again.").at(part) from error
        if marks.get(_MARK) != self.fingerprint.encode():
            raise FileError(f"{part} is of another sweep; remove it and sweep again.").at(part)

    def write(self, block: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write a part; it has its name when it is complete.

        Args:
            block: its number.
            rows: by column; what is left out is null.

        Raises:
            FileError: it cannot be written.
        """
        schema = pyarrow.schema([(name, _TYPES[kind]) for name, kind in self.columns.items()])
        schema = schema.with_metadata({_MARK: self.fingerprint.encode()})
        columns = [[row.get(name) for row in rows] for name in self.columns]
        arrays = [pyarrow.array(c, type=kind.type) for c, kind in zip(columns, schema)]
        table = pyarrow.Table.from_arrays(arrays, schema=schema)
        with written_whole(self.folder / f"part-{block:08d}.parquet") as file:
            pyarrow.parquet.write_table(table, file)

    def read(self, names: Sequence[str]) -> Iterator[Mapping[str, list[Any]]]:
        """Yield some columns, part by part in the order of the points.

        Args:
            names: of the columns.
        """
        found = pyarrow.dataset.dataset(self.folder, format="parquet")
        for batch in found.to_batches(columns=list(names), batch_readahead=1, fragment_readahead=1):
            yield batch.to_pydict()
