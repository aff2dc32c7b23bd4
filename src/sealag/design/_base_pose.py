"""The pose of a floating base: questioned where it is given, and from contacts where it is not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sealag.errors import InputError, MotionError
from sealag.robot import Contact, ContactKind, Robot
from sealag.store import blocks, release
from sealag.typing import Array

ORDERS = ("xyzw", "wxyz")

_FOOT = 0.1
"""m: a surface contact counts as its origin and points this far along its axes, so that 0.1 rad
weighs as 1 cm."""

_FLAT = 1e-3
"""m: points whose spread across a line is less do not fix the base about it."""

_APART = 0.01
"""m: contacts that move against each other by more do not hold. Encoders and soft soles leave some
mm; of a foot of four that is lifted, a quarter of its height is left."""

_TURNED = np.pi / 4.0
"""rad of tilt against the posture from which the order of a quaternion is questioned."""

_JUMP = 1.0
"""rad between two rows: 100 rad/s in a log of 100 rows a second, which no base turns."""


def check_order(order: str) -> None:
    """Refuse an order of quaternions that is none.

    Args:
        order: xyzw or wxyz.

    Raises:
        InputError: it is neither.
    """
    if order not in ORDERS:
        raise InputError(f"quaternion is {order!r}; it must be xyzw or wxyz.")


def in_order(quaternions: Array, order: str) -> Array:
    """Return quaternions (N, 4) with w last.

    Args:
        quaternions: (N, 4) as the file has them.
        order: xyzw or wxyz.
    """
    return quaternions if order == "xyzw" else np.roll(quaternions, -1, axis=1)


def question(quaternions: Array, time: Array, posture: Array, path: Path) -> None:
    """Refuse orientations that look as if their numbers were in another order.

    A quaternion and its negative are one orientation.

    Args:
        quaternions: (N, 4) of length 1, taken as w last.
        time: (N,) s.
        posture: (nq,) with the base as it stands.
        path: how messages call the file.

    Raises:
        MotionError: in the first row the base is tilted by more than a right angle against the
            posture, or by half of one and less so with w first; or it jumps between two rows.
    """
    stands = posture[3:7]
    tilt = _tilt(quaternions[0], stands)
    other = _tilt(np.roll(quaternions[0], -1), stands)
    if tilt > 2.0 * _TURNED or (tilt > _TURNED and other < 0.5 * tilt):
        raise MotionError(
            f"{path}: in row 1 the base is tilted by {np.degrees(tilt):.0f}° against the project's "
            f"posture; with w first it would be {np.degrees(other):.0f}°. If base_qx … base_qw "
            "hold w, x, y, z say --quaternion wxyz; if they are right, --quaternion xyzw."
        ).at(path, "base_qx")
    turns = 2.0 * np.arccos(np.clip(np.abs((quaternions[1:] * quaternions[:-1]).sum(1)), 0.0, 1.0))
    if len(turns) and turns.max() > _JUMP:
        row = int(turns.argmax())
        raise MotionError(
            f"{path}: the base turns by {np.degrees(turns[row]):.0f}° from row {row + 1} to row "
            f"{row + 2}, in {time[row + 1] - time[row]:g} s. Columns base_qx … base_qw are x, y, "
            "z, w; say --quaternion wxyz if w comes first, or xyzw if they are right."
        ).at(path, "base_qx")


def _tilt(quaternion: Array, stands: Array) -> float:
    """Angle between two bases' views of the vertical, rad: yaw does not count."""
    cosine = float(_up(quaternion) @ _up(stands))
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _up(quaternion: Array) -> Array:
    """World z in the base's axes."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def pose_from_contacts(
    q: Array, held: Array, contacts: Sequence[Contact], robot: Robot, *, posture: Array, path: Path
) -> float:
    """Fill in the base's pose so that contacts stay where they are.

    In each row the base is where the points of the contacts that hold it lie closest to where they
    were set down, Σ |R p_i + p − P_i|² minimal (Kabsch). The first row's places are the posture's.
    A contact lands where those that stay put it, or, where they do not fix the base without it,
    where it was in the row before.

    Args:
        q: (N, nq) with the joints; the base's part is written.
        held: (N, contacts) whether each holds.
        contacts: the contacts.
        robot: the robot.
        posture: (nq,) where the contacts stand at first.
        path: how messages call the file.

    Returns:
        By how much the contacts move at most, m.

    Raises:
        MotionError: contacts leave the base free in a row, or move against each other.
    """
    places = [_points(robot, posture, contact) for contact in contacts]
    stood, before, largest = places, held[0], 0.0
    for rows in blocks(len(q)):
        for row in range(rows.start, rows.stop):
            q[row, :7] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
            points = [_points(robot, q[row], contact) for contact in contacts]
            staying, landing = held[row] & before, np.flatnonzero(held[row] & ~before)
            if not _fixes(_chosen(points, staying)):  # they land where they were a row ago
                staying = held[row]
                for k in landing:
                    places[k] = stood[k]
            here, there = _chosen(points, staying), _chosen(places, staying)
            if not _fixes(here):
                raise MotionError(
                    f"{path}: the columns base_x … base_qw are missing, and in row {row + 1} the "
                    "contacts that hold do not fix the base: three points or a surface do. Give "
                    "the base's pose."
                ).at(path, "base_x")
            R, p = _fit(here, there)
            q[row, :3], q[row, 3:7] = p, _quaternion(R)
            stood, before = [point @ R.T + p for point in points], held[row]
            if row == 0:  # another stance than the posture's is no slip
                places = list(stood)
                continue
            apart = float(np.linalg.norm(here @ R.T + p - there, axis=1).max())
            largest = max(largest, apart)
            if apart > _APART:
                raise MotionError(
                    f"{path}: in row {row + 1} the contacts that hold are {apart * 1e3:.0f} mm "
                    "from where they stood: joints and contacts contradict each other. Give "
                    "contact:<frame> columns with 0 where a foot is lifted, or the base's pose."
                )
            for k in landing:
                places[k] = stood[k]
        release(q)
    return largest


def _chosen(points: Sequence[Array], which: Array) -> Array:
    """Points of some contacts, one below the other."""
    return np.concatenate([np.zeros((0, 3)), *(one for one, there in zip(points, which) if there)])


def _fixes(points: Array) -> bool:
    """Whether points fix a body: three or more that are not on one line."""
    if len(points) < 3:
        return False
    return bool(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] > _FLAT)


def _points(robot: Robot, q: Array, contact: Contact) -> Array:
    """Points of a contact in the world, (1 or 4, 3)."""
    R, p = robot.workspace_at(q).frame_placement(contact.frame)
    if contact.kind is ContactKind.POINT:
        return np.array(p)[None]
    return np.concatenate([p[None], p + _FOOT * R.T])


def _fit(here: Array, there: Array) -> tuple[Array, Array]:
    """Rotation R and shift p with R here + p closest to there."""
    centre, target = here.mean(axis=0), there.mean(axis=0)
    U, _, V = np.linalg.svd((here - centre).T @ (there - target))
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(V.T @ U.T))])
    R = V.T @ turn @ U.T
    return R, target - R @ centre


def _quaternion(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_quat()
