"""Contacts by frame, and motions of a robot that touch the ground in changing places."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sealag.errors import MotionError
from sealag.typing import Array, IntArray

_BASE = ("base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw")
_BASE_RATES = ("base_vx", "base_vy", "base_vz", "base_wx", "base_wy", "base_wz")


class ContactKind(StrEnum):
    """What a contact holds still: a point (3 rows) or a whole frame (6 rows)."""

    POINT = "point"
    SURFACE = "surface"

    @property
    def rows(self) -> int:
        """Number of rows of the contact Jacobian."""
        return 3 if self is ContactKind.POINT else 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A frame of the robot that does not move relative to the ground.

    Attributes:
        frame: name of the frame.
        kind: point (three forces) or surface (forces and moments).
    """

    frame: str
    kind: ContactKind = ContactKind.POINT


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Configurations of a robot at increasing times, with the contacts that hold at each.

    Attributes:
        time: (N,) s, increasing.
        q: (N, nq) configurations.
        v: (N, nv) tangent velocities.
        contact_sets: the different sets of contacts that occur.
        contact_index: (N,) which of the sets holds at each instant.
        stiffness: (N,) factor of the law's gains at each instant, positive; None for 1.
    """

    time: Array
    q: Array
    v: Array
    contact_sets: tuple[tuple[Contact, ...], ...]
    contact_index: IntArray
    stiffness: Array | None = None

    def __post_init__(self) -> None:
        """Refuse arrays that do not fit each other.

        Raises:
            MotionError: lengths differ, values are not finite, or time does not increase.
        """
        count = len(self.time)
        if count == 0:
            raise MotionError("The motion has no instants; at least one is needed.")
        if not (len(self.q) == len(self.v) == len(self.contact_index) == count):
            raise MotionError(
                f"The motion has {count} times, {len(self.q)} configurations, {len(self.v)} "
                f"velocities and {len(self.contact_index)} contact indices; all must be equal."
            )
        for name, values in (("time", self.time), ("q", self.q), ("v", self.v)):
            bad = ~np.isfinite(values).reshape(count, -1).all(axis=1)
            if bad.any():
                raise MotionError(f"The motion's {name} is not finite at instant {bad.argmax()}.")
        if self.stiffness is not None and (
            len(self.stiffness) != count
            or not (np.isfinite(self.stiffness) & (self.stiffness > 0.0)).all()
        ):
            raise MotionError(
                f"The motion's stiffness must be {count} positive factors, one for each instant."
            )
        if (np.diff(self.time) <= 0.0).any():
            at = int((np.diff(self.time) <= 0.0).argmax()) + 1
            raise MotionError(f"The motion's time does not increase at instant {at}.")
        if self.contact_index.min() < 0 or self.contact_index.max() >= len(self.contact_sets):
            raise MotionError("The motion's contact index names a contact set that is not there.")

    @staticmethod
    def position_columns(joints: Sequence[str], *, floating_base: bool) -> tuple[str, ...]:
        """Return what the columns of q are called in tables: base_x … base_qw and the joints.

        Args:
            joints: their names.
            floating_base: whether the base moves too.
        """
        return (*(_BASE if floating_base else ()), *joints)

    @staticmethod
    def velocity_columns(joints: Sequence[str], *, floating_base: bool) -> tuple[str, ...]:
        """Return what the columns of v are called in tables: base_vx … base_wz in the base frame,
        and `<joint>:velocity`.

        Args:
            joints: their names.
            floating_base: whether the base moves too.
        """
        rates = (f"{joint}:velocity" for joint in joints)
        return (*(_BASE_RATES if floating_base else ()), *rates)

    def __len__(self) -> int:
        """Return the number of instants."""
        return len(self.time)

    def at(self, instants: slice | Sequence[int]) -> "Motion":
        """Return the motion at some of its instants.

        Args:
            instants: which, in increasing order.
        """
        return Motion(
            time=self.time[instants],
            q=self.q[instants],
            v=self.v[instants],
            contact_sets=self.contact_sets,
            contact_index=self.contact_index[instants],
            stiffness=None if self.stiffness is None else self.stiffness[instants],
        )
