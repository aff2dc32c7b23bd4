"""Motions as tables with named columns: CSV, NPZ or Parquet."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from sealag.errors import FileError, MotionError
from sealag.files import written_whole
from sealag.robot import Contact, Motion, Robot
from sealag.typing import Array

BASE_COLUMNS = ("base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw")
BASE_RATES = ("base_vx", "base_vy", "base_vz", "base_wx", "base_wy", "base_wz")
CONTACT = "contact:"
VELOCITY = ":velocity"


def load_motion(path: str | Path, robot: Robot, *, contacts: Sequence[Contact] = ()) -> Motion:
    """Read a motion from a CSV, NPZ or Parquet file with one named column each.

    Columns: `time_s`; for a floating base `base_x … base_z` (m) and `base_qx … base_qw`; one for
    each joint by its name (rad or m). Optional: `<joint>:velocity` for all joints together with
    `base_vx … base_wz` in the base frame, else velocities are differences of configurations; and
    `contact:<frame>` with 1 where the project's contact at this frame holds, else all hold.

    Args:
        path: the file; its ending tells the format.
        robot: whose motion it is.
        contacts: the project's contacts.

    Returns:
        The motion.

    Raises:
        FileError: the file cannot be read.
        MotionError: a column is unknown or missing, a row is not finite, time does not increase,
            or a quaternion is not one.
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
    lengths = {len(column) for column in table.values()}
    if len(lengths) != 1 or lengths == {0}:
        raise MotionError(f"{path}: the columns must have one common length of at least 1.")
    for name, column in table.items():
        if not np.isfinite(column).all():
            row = int((~np.isfinite(column)).argmax())
            raise MotionError(f"{path}: the column {name} is {column[row]} in row {row + 1}.")
    q = np.column_stack([table[name] for name in needed[1:]])
    time = table["time_s"]
    if (np.diff(time) <= 0.0).any():
        row = int((np.diff(time) <= 0.0).argmax()) + 2
        raise MotionError(f"{path}: time_s does not increase in row {row}.")
    if robot.floating_base:
        norm = np.linalg.norm(q[:, 3:7], axis=1)
        if (np.abs(norm - 1.0) > 1e-3).any():
            row = int((np.abs(norm - 1.0) > 1e-3).argmax())
            raise MotionError(
                f"{path}: the base quaternion of row {row + 1} has length {norm[row]:.4g}; 1 is "
                "right (columns base_qx, base_qy, base_qz, base_qw)."
            )
        q[:, 3:7] /= norm[:, None]
    sets, index = _contact_sets(table, contacts)
    return Motion(
        time=time,
        q=q,
        v=_velocities(table, robot, time, q),
        contact_sets=sets,
        contact_index=index,
    )


def _known_columns(robot: Robot, contacts: Sequence[Contact]) -> set[str]:
    known = {"time_s", *robot.joints, *(name + VELOCITY for name in robot.joints)}
    known |= {CONTACT + contact.frame for contact in contacts}
    return known | {*BASE_COLUMNS, *BASE_RATES} if robot.floating_base else known


def _read_table(path: Path) -> dict[str, Array]:
    try:
        match path.suffix.lower():
            case ".csv":
                return _read_csv(path)
            case ".npz":
                with np.load(path, allow_pickle=False) as data:
                    return {name: np.asarray(data[name], dtype=float).ravel() for name in data}
            case ".parquet":
                from pyarrow import parquet

                found = parquet.read_table(path)
                return {name: found[name].to_numpy().astype(float) for name in found.column_names}
            case ending:
                raise MotionError(
                    f"{path}: motions end in .csv, .npz or .parquet, not {ending or 'nothing'!r}."
                )
    except MotionError:
        raise
    except OSError as error:
        raise FileError(f"The motion {path} cannot be read: {error.strerror or error}.") from error
    except Exception as error:
        raise MotionError(f"{path} cannot be read as a motion: {error}.") from error


def _read_csv(path: Path) -> dict[str, Array]:
    with open(path, encoding="utf-8") as file:
        names = [name.strip() for name in file.readline().strip().split(",")]
        if len(set(names)) < len(names):
            raise MotionError(f"{path}: a column name occurs twice.")
        rows = [row for row in file if row.strip()]
    values = np.genfromtxt(rows, delimiter=",", ndmin=2) if rows else np.zeros((0, 0))
    if values.size == 0 or values.shape[1] != len(names):
        raise MotionError(f"{path}: the rows do not have the {len(names)} columns of the head.")
    return dict(zip(names, values.T, strict=True))


def _velocities(table: dict[str, Array], robot: Robot, time: Array, q: Array) -> Array:
    names = [*(BASE_RATES if robot.floating_base else ()), *(j + VELOCITY for j in robot.joints)]
    if all(name in table for name in names):
        return np.column_stack([table[name] for name in names])
    v = np.zeros((len(time), robot.nv))
    if len(time) > 1:
        steps = np.array([robot.difference(a, b) for a, b in pairwise(q)])
        rates = steps / np.diff(time)[:, None]
        v[0], v[-1] = rates[0], rates[-1]
        v[1:-1] = (rates[:-1] + rates[1:]) / 2.0
    return v


def _contact_sets(
    table: dict[str, Array], contacts: Sequence[Contact]
) -> tuple[tuple[tuple[Contact, ...], ...], Array]:
    count = len(table["time_s"])
    on = np.ones((count, len(contacts)), dtype=bool)
    for k, contact in enumerate(contacts):
        if CONTACT + contact.frame in table:
            on[:, k] = table[CONTACT + contact.frame] > 0.5
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
