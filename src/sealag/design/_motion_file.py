"""Motions as tables with named columns: CSV, NPZ or Parquet."""

import csv
import io
import itertools
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from sealag.errors import InputError, MotionError
from sealag.files import opened, written_whole
from sealag.robot import Contact, Motion, Robot
from sealag.store import Store, blocks, release
from sealag.typing import Array
from sealag.units import number_of

BASE_COLUMNS = ("base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw")
BASE_RATES = ("base_vx", "base_vy", "base_vz", "base_wx", "base_wy", "base_wz")
CONTACT = "contact:"
VELOCITY = ":velocity"
LARGEST_BYTES = 2_000_000_000
_LATEST = 1e12  # s
_SHORTEST = 1e-9  # s between two rows, that velocities stay numbers
_CSV_BLOCK = 10_000  # rows that are lists of Python numbers at a time


def load_motion(path: str | Path, robot: Robot, *, contacts: Sequence[Contact] = ()) -> Motion:
    """Read what `System.load_motion` reads.

    Args:
        path: the file.
        robot: whose motion it is.
        contacts: those that hold or not.
    """
    path = Path(path)
    table = _read_table(path)
    known = _known_columns(robot, contacts)
    unknown = [name for name in table if name not in known]
    if unknown:
        raise MotionError(
            f"{path}: the column {unknown[0]!r} is not known; expected are time_s, "
            f"{'base_x … base_qw, ' if robot.floating_base else ''}{', '.join(robot.joints)}."
        )
    needed = ["time_s", *(BASE_COLUMNS if robot.floating_base else ()), *robot.joints]
    missing = [name for name in needed if name not in table]
    if missing:
        raise MotionError(f"{path}: the column {missing[0]} is missing ({len(missing)} in all).")
    _check_rows(table, path)
    time = table["time_s"]
    store = Store.of(
        len(time), robot.nq + robot.nv, what="A motion", remedy="give fewer of its rows"
    )
    q = _filled(store, [table[name] for name in needed[1:]])
    if robot.floating_base:
        q[:, 3:7] = _unit(q[:, 3:7], path)
        release(q)
    try:
        robot.require_within_limits(q)
    except InputError as error:
        raise MotionError(f"{path}: {error}") from error
    sets, index = _contact_sets(table, contacts)
    motion = Motion(
        time=time,
        q=q,
        v=_velocities(table, robot, q, path=path, store=store),
        contact_sets=sets,
        contact_index=index,
    )
    release(motion.q, motion.v)
    return motion


def _check_rows(table: dict[str, Array], path: Path) -> None:
    """Refuse rows that are no numbers, times that do not increase, and half a contact."""
    if len({len(column) for column in table.values()}) != 1:
        raise MotionError(f"{path}: the columns must have one common length.")
    for name, column in table.items():
        if not len(column):
            raise MotionError(f"{path} has no rows below its column names; at least one is needed.")
        bad, need = ~np.isfinite(column), "a finite number"
        if name == "time_s":
            bad |= np.abs(column) > _LATEST
            if not bad.any():
                bad[1:] = np.diff(column) < _SHORTEST
                need = f"at least {_SHORTEST:g} s more than in the row before: time must increase"
            else:
                need = f"a number within ± {_LATEST:g} s"
        elif name.startswith(CONTACT):
            bad, need = (column != 0.0) & (column != 1.0), "0 or 1"
        if bad.any():
            row = int(bad.argmax())
            raise MotionError(
                f"{path}: the column {name} is {column[row]:g} in row {row + 1}; it must be {need}."
            )


def _unit(quaternions: Array, path: Path) -> Array:
    norm = np.linalg.norm(quaternions, axis=1)
    bad = np.abs(norm - 1.0) > Robot.UNIT_TOLERANCE
    if bad.any():
        row = int(bad.argmax())
        raise MotionError(
            f"{path}: the base quaternion of row {row + 1} has length {norm[row]:.4g}; 1 is "
            "right (columns base_qx, base_qy, base_qz, base_qw)."
        )
    return quaternions / norm[:, None]


def _known_columns(robot: Robot, contacts: Sequence[Contact]) -> set[str]:
    known = {"time_s", *robot.joints, *(name + VELOCITY for name in robot.joints)}
    known |= {CONTACT + contact.frame for contact in contacts}
    return known | {*BASE_COLUMNS, *BASE_RATES} if robot.floating_base else known


def _read_table(path: Path) -> dict[str, Array]:
    ending = path.suffix.lower()
    if ending not in _READERS:
        raise MotionError(
            f"{path}: motions end in .csv, .npz or .parquet, not {ending or 'nothing'!r}."
        )
    with opened(path, what="The motion", largest=LARGEST_BYTES) as file:
        try:
            table = _READERS[ending](file, path)
        except MotionError:
            raise
        except Exception as error:
            reason = " ".join(str(error).split())[:200].rstrip(".")
            raise MotionError(f"{path} cannot be read as a motion: {reason}.") from error
    return {name: _column(values, name, path) for name, values in table.items()}


def _column(values: Array, name: str, path: Path) -> Array:
    """A column as doubles, (N,)."""
    rows = max(values.shape, default=1)
    if values.dtype.kind not in "fiub" or values.size != rows:
        raise MotionError(
            f"{path}: the column {name} has type {values.dtype} and shape {values.shape}; one real "
            "number a row is needed."
        )
    return values.astype(float, copy=False).ravel()


def _read_npz(file: BinaryIO, path: Path) -> dict[str, Array]:
    if not zipfile.is_zipfile(file):
        raise MotionError(f"{path} is not an NPZ file of named columns; np.savez writes one.")
    file.seek(0)
    data = np.load(file, allow_pickle=False)
    return {name: data[name] for name in data}


def _read_parquet(file: BinaryIO, path: Path) -> dict[str, Array]:
    from pyarrow import parquet

    found = parquet.ParquetFile(file)
    names = found.schema_arrow.names
    return {name: found.read([name])[name].to_numpy() for name in names}


def _read_csv(file: BinaryIO, path: Path) -> dict[str, Array]:
    text = io.TextIOWrapper(file, encoding="utf-8-sig", newline="")
    lines = csv.reader(text, strict=True)
    names = [name.strip() for name in next(lines, [])]
    if not names or number_of(names[0]) is not None:
        raise MotionError(f"{path} does not begin with a row of column names, such as time_s.")
    if ";" in names[0]:
        raise MotionError(f"{path} has semicolons between its cells; commas are right.")
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise MotionError(f"{path}: the column name {twice!r} occurs twice.")
    whole: list[Array] = []
    rows = _csv_rows(lines, names, path)
    while block := list(itertools.islice(rows, _CSV_BLOCK)):
        whole.append(np.array(block, dtype=float))
    text.detach()
    columns = np.concatenate([np.zeros((0, len(names))), *whole])
    return dict(zip(names, columns.T, strict=True))


def _csv_rows(
    lines: Iterator[list[str]], names: list[str], path: Path
) -> Iterator[list[float | None]]:
    """The numbers of each row."""
    row = 0
    for cells in lines:
        if not cells:
            continue
        row += 1
        numbers = [number_of(cell) for cell in cells]
        if len(cells) != len(names):
            raise MotionError(
                f"{path}: row {row} has {len(cells)} cells, but there are {len(names)} "
                "column names; cells are separated by commas, decimals by points."
            )
        if None in numbers:
            at = numbers.index(None)
            raise MotionError(
                f"{path}: the column {names[at]} is {cells[at]!r} in row {row}; it must "
                "be a number."
            )
        yield numbers


_READERS = {".csv": _read_csv, ".npz": _read_npz, ".parquet": _read_parquet}


def _filled(store: Store, columns: list[Array]) -> Array:
    """The columns side by side, (N, k)."""
    array = store.zeros((len(columns[0]), len(columns)))
    for rows in blocks(len(array)):
        array[rows] = np.column_stack([column[rows] for column in columns])
        release(array)
    return array


def _velocities(
    table: dict[str, Array], robot: Robot, q: Array, *, path: Path, store: Store
) -> Array:
    names = [*(BASE_RATES if robot.floating_base else ()), *(j + VELOCITY for j in robot.joints)]
    missing = [name for name in names if name not in table]
    if not missing:
        return _filled(store, [table[name] for name in names])
    given = [name for name in names if name in table]
    if given:
        raise MotionError(
            f"{path}: the velocity {given[0]} is given without {missing[0]}; give all velocities, "
            "or none, then they are differences of the positions."
        )
    time, v = table["time_s"], store.zeros((len(q), robot.nv))
    rate = None
    for rows in blocks(len(time) - 1):
        for row in range(rows.start, rows.stop):
            before = rate
            rate = robot.difference(q[row], q[row + 1]) / (time[row + 1] - time[row])
            v[row] = rate if before is None else (before + rate) / 2.0
            v[row + 1] = rate
        release(q, v)
    return v


def _contact_sets(
    table: dict[str, Array], contacts: Sequence[Contact]
) -> tuple[tuple[tuple[Contact, ...], ...], Array]:
    count = len(table["time_s"])
    on = np.ones((count, len(contacts)), dtype=bool)
    for k, contact in enumerate(contacts):
        if CONTACT + contact.frame in table:
            on[:, k] = table[CONTACT + contact.frame] == 1.0
    patterns, index = np.unique(on, axis=0, return_inverse=True)
    sets = tuple(
        tuple(contact for contact, held in zip(contacts, pattern, strict=True) if held)
        for pattern in patterns
    )
    return sets, np.asarray(index, dtype=np.int64).ravel()


def motion_table(motion: Motion, robot: Robot) -> dict[str, Array]:
    """Return a motion as named columns.

    Args:
        motion: the motion.
        robot: whose motion it is.
    """
    positions = [*(BASE_COLUMNS if robot.floating_base else ()), *robot.joints]
    rates = [*(BASE_RATES if robot.floating_base else ()), *(j + VELOCITY for j in robot.joints)]
    table = {"time_s": motion.time}
    table |= dict(zip(positions, motion.q.T, strict=True))
    table |= dict(zip(rates, motion.v.T, strict=True))
    frames = {contact.frame for contacts in motion.contact_sets for contact in contacts}
    for frame in sorted(frames):
        held = np.array([any(c.frame == frame for c in s) for s in motion.contact_sets])
        table[CONTACT + frame] = held[motion.contact_index].astype(float)
    return table


def save_motion(motion: Motion, robot: Robot, path: str | Path) -> None:
    """Write a motion as CSV, NPZ or Parquet through a temporary name.

    Args:
        motion: the motion.
        robot: whose motion it is.
        path: the file; its ending tells the format.

    Raises:
        FileError: it cannot be written.
        MotionError: the ending is none of the three.
    """
    path = Path(path)
    table = motion_table(motion, robot)
    if path.suffix.lower() not in {".csv", ".npz", ".parquet"}:
        raise MotionError(f"{path}: motions end in .csv, .npz or .parquet.")
    with written_whole(path) as file:
        match path.suffix.lower():
            case ".npz":
                np.savez_compressed(file, allow_pickle=False, **table)
            case ".csv":
                rows = np.column_stack(list(table.values()))
                head = ",".join(table)
                np.savetxt(file, rows, delimiter=",", header=head, comments="", fmt="%.17g")
            case _:
                import pyarrow
                from pyarrow import parquet

                parquet.write_table(pyarrow.table(table), file)
