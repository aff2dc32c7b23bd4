"""Which contact points are closed, and how far each is from changing."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sealag.errors import InputError
from sealag.robot import Robot
from sealag.simulation._ground import Foot, contact_frame
from sealag.typing import IntArray
from sealag.walking import Ground, GroundProfile

if TYPE_CHECKING:
    from sealag.kernels.contact import Instant

_NEAR = 1e-7  # m, m/s: points this near take part in the same change
_POINT, _SOLE = 1e-11, 1e-6  # relative compliance of points that do, or do not, stand alone
_BURIED = 1e-4  # m: how deep a foot may begin inside the ground


class Surroundings:
    """The contact points of all feet: their frames of reference, states and gaps.

    Args:
        robot: The robot.
        feet: What may touch the ground.
        ground: Where the ground is.
        loaded_frames: Frames on which disturbing forces act; their points follow the feet's.
        stabilisation: Rate at which contacts return to the height where they closed, 1/s.
        stop_time: Time within which friction may stop a point for it to stick, s.
    """

    def __init__(
        self,
        robot: Robot,
        feet: Sequence[Foot],
        ground: Ground,
        loaded_frames: Sequence[str],
        *,
        stabilisation: float,
        stop_time: float,
    ) -> None:
        from sealag.kernels import contact

        self._kernel, self.feet, self.ground = contact, tuple(feet), ground
        self.mounts = robot.frame_mounts([foot.contact.frame for foot in feet] + [*loaded_frames])
        offsets = [foot.offsets() for foot in feet]
        self.foot_of = np.repeat(np.arange(len(feet)), [len(o) for o in offsets]).astype(np.int64)
        self.count, loaded = self.foot_of.size, len(loaded_frames)
        owners = [self.feet[f] for f in self.foot_of.tolist()]
        # Only a profile's height is known to the kernels; another ground is asked at every step.
        known = ground if isinstance(ground, GroundProfile) else None
        self.contacts = contact.Contacts(
            frame=np.concatenate([self.foot_of, len(feet) + np.arange(loaded)]).astype(np.int64),
            offset=np.concatenate([*offsets, np.zeros((loaded, 3))]),
            C=np.tile(np.eye(3), (self.count, 1, 1)),
            anchor=np.zeros((self.count, 3)),
            friction=np.array([foot.friction for foot in owners], dtype=float),
            ridge=np.where(np.bincount(self.foot_of)[self.foot_of] > 1, _SOLE, _POINT),
            radius=np.array([foot.radius for foot in owners], dtype=float),
            torsion_damping=np.array([foot.torsional_damping for foot in feet], dtype=float),
            torsion_radius=np.array([foot.torsional_radius for foot in feet], dtype=float),
            load=np.zeros((loaded, 3)),
            closed=np.zeros(self.count, np.int64),
            yielding=np.zeros(self.count),
            floor=np.zeros(self.count),
            ground_x=np.zeros(0) if known is None else np.array(known.x),
            ground_z=np.zeros(0) if known is None else np.array(known.z),
            stabilisation=stabilisation,
            stop_time=stop_time,
            weight=robot.weight,
        )

    def open_all(self) -> None:
        """Open every contact."""
        for state in (self.contacts.closed, self.contacts.yielding, self.contacts.floor):
            state[:] = 0

    def height(self, at: "Instant", point: int) -> float:
        """Return the height (m) of a point's sole above the ground below it."""
        x, y, z = at.position[point].tolist()
        return z - float(self.contacts.radius[point]) - self.ground.height(x, y)

    def lower_floors(self, at: "Instant", before: IntArray) -> None:
        """Let points that were closed before and are open now leave from where they are.

        Stabilisation and slopes leave them some µm below the ground. Several points of one sole
        share its load, and those without any must not strike again and again: they may sink a
        little.
        """
        for point in np.flatnonzero(before > self.contacts.closed).tolist():
            height = min(self.height(at, point), 0.0)
            if self.contacts.ridge[point] == _SOLE:
                self.contacts.floor[point] = height - 0.5 * self._kernel.RISEN
            elif height < -_NEAR:
                self.contacts.floor[point] = height

    def measure_gaps(self, at: "Instant") -> None:
        """Measure the gaps of all open points."""
        for point, closed in enumerate(self.contacts.closed.tolist()):
            if closed:
                at.gap[point] = np.inf
                continue
            height = self.height(at, point)
            if height > self._kernel.RISEN:
                self.contacts.floor[point] = 0.0
            at.gap[point] = height - self.contacts.floor[point]

    def refuse_buried(self, at: "Instant") -> None:
        """Raise InputError if a foot begins inside the ground."""
        for point in range(self.count):
            depth = -self.height(at, point)
            if depth > _BURIED:
                raise InputError(
                    f"foot {self.feet[self.foot_of[point]].contact.frame} begins "
                    f"{depth * 1e3:.3g} mm inside the ground: raise the base by as much"
                )

    def margin(self, at: "Instant") -> tuple[float, int]:
        """Return the smallest margin (m, body weights) and its point; below 0 it must change."""
        contacts = self.contacts
        return self._kernel.smallest_margin(
            contacts.C, contacts.closed, contacts.weight, at.force, at.gap, at.velocity
        )

    def touching(self, at: "Instant", *, tolerance: float = _NEAR) -> IntArray:
        """Return 1 for every point that is closed or could close now (P,)."""
        mask = self.contacts.closed.copy()
        for point in np.flatnonzero(mask == 0).tolist():
            near = self.height(at, point) <= tolerance
            if near and self._approach(at, point) <= _NEAR:
                mask[point] = 1
        return mask

    def _approach(self, at: "Instant", point: int) -> float:
        x, y, _ = at.position[point].tolist()
        return float(contact_frame(self.ground, x, y)[2] @ at.velocity[point])

    def close(self, at: "Instant", point: int) -> None:
        """Let a point touch the ground where it is."""
        x, y, _ = at.position[point].tolist()
        self.contacts.C[point] = contact_frame(self.ground, x, y)
        self.contacts.anchor[point] = at.position[point]
        self.contacts.closed[point] = 1
        self.contacts.yielding[point] = 0.0
