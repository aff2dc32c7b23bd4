"""Motions as tables with named columns: CSV, NPZ, Parquet, and recordings of runs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sealag.design._base_pose import check_order, in_order, pose_from_contacts, question
from sealag.design._design import Design
from sealag.design._motion_names import TIME, Names, mapping_of
from sealag.design._motion_table import (
    CONTACT,
    RECORDING,
    STIFFNESS,
    read_table,
    recorded_columns,
)
from sealag.errors import InputError, MotionError, SealagError
from sealag.files import written_whole
from sealag.robot import Contact, Motion, Robot
from sealag.store import Store, blocks, release
from sealag.typing import Array

if TYPE_CHECKING:
    from sealag.simulation import Run

_LATEST = 1e12  # s
_FACTORS = (1e-6, 1e6)
"""Of the gains."""
_SHORTEST = 1e-9  # s between two rows, that velocities stay numbers


def load_motion(
    path: str | Path,
    system: Design,
    *,
    columns: Mapping[str, str] | str | Path | None,
    quaternion: str | None,
    tell: Callable[[str], None],
) -> Motion:
    """Read what `System.load_motion` reads.

    Args:
        path: the file.
        system: robot, contacts and posture.
        columns: what the file's columns are called here.
        quaternion: the order of base_qx … base_qw; None for xyzw, which is questioned.
        tell: called with each sentence on what was done with the file.
    """
    path, notes = Path(path), list[str]()
    names = Names(
        robot=system.robot,
        contacts=system.contacts,
        mapping=mapping_of(columns),
        path=path,
        tell=notes.append,
    )
    try:
        table = read_table(path, names.choose, notes.append)
        time = next(iter(table))
        table = {TIME: names.seconds(time, table.pop(time)), **table}
        motion = _motion(
            {name: np.asarray(values, dtype=float) for name, values in table.items()},
            system,
            path=path,
            recorded=path.suffix.lower() == RECORDING,
            quaternion=quaternion,
            tell=notes.append,
        )
    except SealagError as error:
        error.at(path)
        raise
    for note in notes:
        tell(note)
    return motion


def motion_of_run(run: "Run", system: Design) -> Motion:
    """Return what a run moved through.

    Args:
        run: the run.
        system: robot, contacts and posture.

    Raises:
        InputError: it is a run of another robot.
        MotionError: a joint left its limits.
    """
    robot = system.robot
    if run.joints != robot.joints or run.q.shape[1] != robot.nq:
        raise InputError(
            f"The run is of {', '.join(run.joints)}, the design's joints are "
            f"{', '.join(robot.joints)}; take a run of this design."
        )
    names = (
        *Motion.position_columns(robot.joints, floating_base=robot.floating_base),
        *Motion.velocity_columns(robot.joints, floating_base=robot.floating_base),
    )
    signals = {
        "/time": {TIME: run.time},
        "/joint_states": dict(zip(names, (*run.q.T, *run.v.T), strict=True)),
        "/contact": run.signals().get("/contact", {}),
    }
    table = recorded_columns(signals)
    known = [CONTACT + contact.frame for contact in system.contacts]
    other = [name for name in table if name.startswith(CONTACT) and name not in known]
    if other:
        raise MotionError(
            f"The run stood on {other[0].removeprefix(CONTACT)}, which is no contact of the "
            "design; take a run of this design."
        )
    return _motion(
        table, system, path=Path("run"), recorded=True, quaternion=None, tell=lambda _: None
    )


def _motion(
    table: dict[str, Array],
    system: Design,
    *,
    path: Path,
    recorded: bool,
    quaternion: str | None,
    tell: Callable[[str], None],
) -> Motion:
    """The motion of a table with its own names and times in s.

    In a recording a contact of which nothing is said has not held; elsewhere it holds. Its
    quaternions are sealag's own.
    """
    robot, contacts = system.robot, system.contacts
    _check_rows(table, path)
    if quaternion is not None:
        check_order(quaternion)
        if "base_qx" not in table:
            raise MotionError(f"{path} has no base_qx … base_qw; leave --quaternion out.")
    time = table[TIME]
    store = Store.of(
        len(time), robot.nq + robot.nv, what="A motion", remedy="give fewer of its rows"
    )
    names = Motion.position_columns(robot.joints, floating_base=robot.floating_base)
    free = robot.floating_base and names[0] not in table
    q = _filled(store, len(time), [table.get(name) for name in names])
    held = _held(table, contacts, unsaid=not recorded)
    if free:
        moved = pose_from_contacts(q, held, contacts, robot, posture=system.posture, path=path)
        frames = ", ".join(contact.frame for contact in contacts)
        tell(
            f"{path}: the base's pose comes from the contacts {frames}, held where the project's "
            f"posture puts them; they move by {moved * 1e3:.2g} mm at most"
        )
    elif robot.floating_base:
        q[:, 3:7] = _unit(in_order(q[:, 3:7], quaternion or "xyzw"), path)
        if quaternion is None and not recorded:
            question(q[:, 3:7], time, system.posture, path)
        release(q)
    try:
        robot.require_within_limits(q)
    except InputError as error:
        raise MotionError(f"{path}: {error}") from error
    sets, index = _contact_sets(held, contacts)
    motion = Motion(
        time=time,
        q=q,
        v=_velocities(table, robot, q, path=path, store=store, tell=tell),
        contact_sets=sets,
        contact_index=index,
        stiffness=table.get(STIFFNESS),
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
        if name == TIME:
            bad |= np.abs(column) > _LATEST
            if not bad.any():
                bad[1:] = np.diff(column) < _SHORTEST
                need = f"at least {_SHORTEST:g} s more than in the row before: time must increase"
            else:
                need = f"a number within ± {_LATEST:g} s"
        elif name.startswith(CONTACT):
            bad, need = (column != 0.0) & (column != 1.0), "0 or 1"
        elif name == STIFFNESS:
            low, high = _FACTORS
            bad, need = ~((column >= low) & (column <= high)), f"a factor in {low:g} … {high:g}"
        if bad.any():
            row = int(bad.argmax())
            raise MotionError(
                f"{path}: the column {name} is {column[row]:g} in row {row + 1}; it must be {need}."
            ).at(path, name)


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


def _filled(store: Store, count: int, columns: Sequence[Array | None]) -> Array:
    """The columns side by side, (N, k); 0 where there is none."""
    array = store.zeros((count, len(columns)))
    for rows in blocks(count):
        for k, column in enumerate(columns):
            if column is not None:
                array[rows, k] = column[rows]
        release(array)
    return array


def _velocities(
    table: dict[str, Array],
    robot: Robot,
    q: Array,
    *,
    path: Path,
    store: Store,
    tell: Callable[[str], None],
) -> Array:
    names = Motion.velocity_columns(robot.joints, floating_base=robot.floating_base)
    missing = [name for name in names if name not in table]
    if not missing:
        return _filled(store, len(q), [table[name] for name in names])
    given = [name for name in names if name in table]
    if given == list(names[robot.nv_base :]):
        tell(
            f"{path}: the base's velocity is not given; all velocities are differences of positions"
        )
    elif given:
        raise MotionError(
            f"{path}: the velocity {given[0]} is given without {missing[0]}; give all velocities, "
            "or none, then they are differences of the positions."
        )
    time, v = table[TIME], store.zeros((len(q), robot.nv))
    rate = None
    for rows in blocks(len(time) - 1):
        for row in range(rows.start, rows.stop):
            before = rate
            rate = robot.difference(q[row], q[row + 1]) / (time[row + 1] - time[row])
            v[row] = rate if before is None else (before + rate) / 2.0
            v[row + 1] = rate
        release(q, v)
    return v


def _held(table: dict[str, Array], contacts: Sequence[Contact], *, unsaid: bool) -> Array:
    """Whether each contact holds in each row, (N, contacts)."""
    on = np.full((len(table[TIME]), len(contacts)), unsaid)
    for k, contact in enumerate(contacts):
        if CONTACT + contact.frame in table:
            on[:, k] = table[CONTACT + contact.frame] == 1.0
    return on


def _contact_sets(
    on: Array, contacts: Sequence[Contact]
) -> tuple[tuple[tuple[Contact, ...], ...], Array]:
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
    positions = Motion.position_columns(robot.joints, floating_base=robot.floating_base)
    rates = Motion.velocity_columns(robot.joints, floating_base=robot.floating_base)
    table = {TIME: motion.time}
    table |= dict(zip(positions, motion.q.T, strict=True))
    table |= dict(zip(rates, motion.v.T, strict=True))
    frames = {contact.frame for contacts in motion.contact_sets for contact in contacts}
    for frame in sorted(frames):
        held = np.array([any(c.frame == frame for c in s) for s in motion.contact_sets])
        table[CONTACT + frame] = held[motion.contact_index].astype(float)
    if motion.stiffness is not None:
        table[STIFFNESS] = motion.stiffness
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
