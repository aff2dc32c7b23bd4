"""Tables of named columns: CSV, NPZ, Parquet, and recordings of runs."""

import csv
import io
import itertools
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from sealag.errors import FileError, MotionError, SealagError
from sealag.files import opened
from sealag.typing import Array
from sealag.units import number_of

CONTACT = "contact:"
VELOCITY = ":velocity"
STIFFNESS = "stiffness_factor"
RECORDING = ".mcap"
LARGEST_BYTES = 2_000_000_000
_CSV_BLOCK = 10_000  # rows that are lists of Python numbers at a time
Choose = Callable[[Sequence[str]], Mapping[str, str]]
"""Which columns of a table are read, and what they are called then."""


def read_table(path: Path, choose: Choose, tell: Callable[[str], None]) -> dict[str, Array]:
    """Read some columns of a file.

    Args:
        path: the file; its ending tells the format.
        choose: given the names of all columns, those that are read and their new names.
        tell: called with a sentence if a recording was cut off.

    Returns:
        The columns by their new names, each (N,): whole numbers as they are, others as doubles.

    Raises:
        FileError: it cannot be read.
        MotionError: it is none of these formats, or a column that is read is not one real number a
            row.
    """
    ending = path.suffix.lower()
    if ending == RECORDING:
        columns = recorded_columns(_recorded(path, tell))
        return {new: columns[old] for old, new in choose(list(columns)).items()}
    if ending not in _READERS:
        raise MotionError(
            f"{path}: motions end in .csv, .npz, .parquet or .mcap, not {ending or 'nothing'!r}."
        )
    with opened(path, what="The motion", largest=LARGEST_BYTES) as file:
        try:
            table = _READERS[ending](file, path, choose)
        except SealagError:
            raise
        except Exception as error:
            reason = " ".join(str(error).split())[:200].rstrip(".")
            if "allow_pickle" in reason:
                reason = "it holds Python objects; save names by np.array(names, dtype=str)"
            raise MotionError(f"{path} cannot be read as a motion: {reason}.") from error
        return {name: _column(values, name, path) for name, values in table.items()}


def _column(values: Array, name: str, path: Path) -> Array:
    """A column, (N,)."""
    rows = max(values.shape, default=1)
    if values.dtype.kind not in "fiub" or values.size != rows:
        raise MotionError(
            f"{path}: the column {name} has type {values.dtype} and shape {values.shape}; one real "
            "number a row is needed."
        ).at(path, name)
    return values.ravel() if values.dtype.kind in "iu" else values.astype(float, copy=False).ravel()


def _read_npz(file: BinaryIO, path: Path, choose: Choose) -> dict[str, Array]:
    if not zipfile.is_zipfile(file):
        raise MotionError(f"{path} is not an NPZ file of named columns; np.savez writes one.")
    file.seek(0)
    data = np.load(file, allow_pickle=False)
    states = _joint_states(data, path)
    names = [name for name in data.files if not states or name not in ("name", *_STATES)]
    twice = next((name for name in names if name in states), None)
    if twice is not None:
        raise MotionError(f"{path}: {twice} stands there as a column and in name; keep one.")
    chosen = choose([*names, *states])
    return {new: states[old] if old in states else data[old] for old, new in chosen.items()}


_STATES = {"position": "", "velocity": VELOCITY, "effort": ":effort"}
"""Matrices of ROS's JointState, and how their columns are called after the joint."""


def _joint_states(data: Mapping[str, Array], path: Path) -> dict[str, Array]:
    """Columns of name (n,) and position, velocity, effort (N, n), as a list of JointState has them;
    empty where there are none."""
    if "name" not in data or "position" not in data:
        return {}
    joints = [str(joint) for joint in np.ravel(data["name"])]
    columns: dict[str, Array] = {}
    for key, ending in _STATES.items():
        values = data[key] if key in data else np.zeros((0, 0))
        if not values.size:
            continue
        if values.ndim != 2 or values.shape[1] != len(joints):
            raise MotionError(
                f"{path}: {key} has shape {values.shape}; with {len(joints)} joints in name it "
                f"must be (N, {len(joints)})."
            )
        columns |= {joint + ending: column for joint, column in zip(joints, values.T, strict=True)}
    if len(set(joints)) < len(joints):
        raise MotionError(f"{path}: name lists a joint twice.")
    return columns


def _read_parquet(file: BinaryIO, path: Path, choose: Choose) -> dict[str, Array]:
    from pyarrow import parquet

    found = parquet.ParquetFile(file)
    chosen = choose(found.schema_arrow.names)
    return {new: found.read([old])[old].to_numpy() for old, new in chosen.items()}


def _read_csv(file: BinaryIO, path: Path, choose: Choose) -> dict[str, Array]:
    text = io.TextIOWrapper(file, encoding="utf-8-sig", newline="")
    lines = csv.reader(text, strict=True)
    names = [name.strip() for name in next(lines, [])]
    if len(names) > 1:
        names[0] = names[0].removeprefix("#").strip()  # as np.savetxt writes it
    if not names or number_of(names[0]) is not None or names[0].startswith("#"):
        raise MotionError(f"{path} does not begin with a row of column names, such as time_s.")
    for mark, called in ((";", "semicolons"), ("\t", "tabs")):
        if len(names) == 1 and mark in names[0]:
            raise MotionError(f"{path} has {called} between its cells; commas are right.")
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise MotionError(f"{path}: the column name {twice!r} occurs twice.")
    chosen = choose(names)
    places = [names.index(name) for name in chosen]
    whole: list[Array] = []
    rows = _csv_rows(lines, names, places, path)
    while block := list(itertools.islice(rows, _CSV_BLOCK)):
        whole.append(np.array(block, dtype=float))
    text.detach()
    columns = np.concatenate([np.zeros((0, len(places))), *whole])
    return dict(zip(chosen.values(), columns.T, strict=True))


def _csv_rows(
    lines: Iterator[list[str]], names: list[str], places: list[int], path: Path
) -> Iterator[list[float | None]]:
    """The numbers of each row that stand in some places."""
    row = 0
    for cells in lines:
        if not cells:
            continue
        row += 1
        if len(cells) != len(names):
            raise MotionError(
                f"{path}: row {row} has {len(cells)} cells, but there are {len(names)} "
                "column names; cells are separated by commas, decimals by points."
            )
        numbers = [number_of(cells[place]) for place in places]
        if None in numbers:
            at = places[numbers.index(None)]
            raise MotionError(
                f"{path}: the column {names[at]} is {cells[at]!r} in row {row}; it must "
                "be a number."
            ).at(path, names[at])
        yield numbers


_READERS = {".csv": _read_csv, ".npz": _read_npz, ".parquet": _read_parquet}


def _recorded(path: Path, tell: Callable[[str], None]) -> dict[str, dict[str, Array]]:
    """Signals of a recording by topic and name, as far as all of them go, and its time."""
    from sealag.report import read_recording

    recording = read_recording(path)
    found = {
        topic: signal
        for topic, signal in recording.signals.items()
        if topic in ("/joint_states", "/base", "/contact")
    }
    if "/joint_states" not in found:
        raise FileError(f"{path} holds no joint states; no motion can be read from it.")
    rows = min(len(signal.time) for signal in found.values())
    if not recording.complete:
        tell(f"{path}: the recording was cut off; its first {rows} rows are read")
    signals = {
        topic: dict(zip(signal.names, signal.values[:rows].T, strict=True))
        for topic, signal in found.items()
    }
    signals["/time"] = {"time_s": found["/joint_states"].time[:rows]}
    return signals


def recorded_columns(signals: Mapping[str, Mapping[str, Array]]) -> dict[str, Array]:
    """Return a run's signals as the columns of a motion.

    Args:
        signals: by topic and name: /time, /joint_states with `<joint>:position` and
            `<joint>:velocity`, and as far as there are any /base and /contact as `Run.signals` has
            them.
    """
    from sealag.simulation import Run

    columns = dict(signals["/time"])
    columns |= signals.get("/base", {})
    for name, values in signals["/joint_states"].items():
        if not name.endswith(":effort"):
            columns[name.removesuffix(":position")] = values
    held = Run.held(signals.get("/contact", {}))
    return columns | {CONTACT + frame: values.astype(float) for frame, values in held.items()}
