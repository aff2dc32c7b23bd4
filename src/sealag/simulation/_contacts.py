"""Which contact points are closed, and how far each is from changing."""

from collections.abc import Sequence

import numpy as np

from sealag.errors import InputError
from sealag.robot import Robot
from sealag.simulation._ground import Foot, contact_frame
from sealag.simulation._instant import Instant
from sealag.simulation._outcome import Outcome, PlantStop
from sealag.typing import Array, IntArray
from sealag.walking import Ground

MARGIN = 1e-9  # m and body weights: a contact this close to changing is at its change
_NEAR = 1e-7  # m, m/s: points this near take part in the same change
_RISEN = 2e-5  # m: an opened point this high has left the ground
_POINT, _SOLE = 1e-11, 1e-6  # relative compliance of points that do, or do not, stand alone
_BURIED = 1e-4  # m: how deep a foot may begin inside the ground


class Contacts:
    """The contact points of all feet: their frames of reference, states and margins.

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
        from sealag.kernels import contact, friction

        self._kernel, self._friction = contact, friction
        self.feet, self.ground, self.rates = tuple(feet), ground, (stabilisation, stop_time)
        frames = [*(foot.contact.frame for foot in feet), *loaded_frames]
        offsets = [foot.offsets() for foot in feet]
        self.foot_of = np.repeat(np.arange(len(feet)), [len(o) for o in offsets]).astype(np.int64)
        self.count = self.foot_of.size
        self.total = self.count + len(loaded_frames)
        loaded = len(feet) + np.arange(len(loaded_frames))
        frame_of = np.concatenate([self.foot_of, loaded]).astype(np.int64)
        offset = np.concatenate([*offsets, np.zeros((len(loaded_frames), 3))])
        self.load = np.zeros((len(loaded_frames), 3))
        owners = [self.feet[f] for f in self.foot_of.tolist()]
        self.C = np.tile(np.eye(3), (self.count, 1, 1))
        self.anchor = np.zeros((self.count, 3))
        self.mu = np.array([foot.friction for foot in owners], dtype=float)
        self.ridge = np.where(np.bincount(self.foot_of)[self.foot_of] > 1, _SOLE, _POINT)
        self.closed = np.zeros(self.count, np.int64)
        self.yielding = np.zeros(self.count)
        self.state = (self.closed, self.yielding)
        self.torsion = np.zeros((len(feet), 2))
        for f, foot in enumerate(feet):
            self.torsion[f] = foot.torsional_damping, foot.torsional_radius
        self.around = (
            *robot.frame_mounts(frames), frame_of, offset, self.C, self.anchor, self.mu, self.ridge,
            self.torsion, self.load,
        )  # fmt: skip
        self.sizes = (
            robot.nq, robot.nv, robot.n, self.count, self.total, len(feet), len(frames),
        )  # fmt: skip
        self._weight = robot.weight
        self._radius = np.array([foot.radius for foot in owners], dtype=float)
        # How far below the ground a point may be that opened but has not risen: several points of
        # one sole share its load, and those without any must not strike again and again.
        self._floor = np.zeros(self.count)
        self._before = np.zeros(self.count)

    def open_all(self) -> None:
        """Open every contact."""
        self.closed[:] = 0
        self.yielding[:] = 0.0
        self._floor[:] = 0.0

    def remember(self) -> None:
        """Keep the sliding state of a step's beginning."""
        self._before[:] = self.yielding

    def recall(self) -> None:
        """Return to the sliding state of the step's beginning."""
        self.yielding[:] = self._before

    def height(self, at: Instant, point: int) -> float:
        """Return the height (m) of a point's sole above the ground below it."""
        x, y, z = at.position[point].tolist()
        return z - float(self._radius[point]) - self.ground.height(x, y)

    def lower_floors(self, at: Instant, before: IntArray) -> None:
        """Let points that were closed before and are open now leave from where they are.

        Stabilisation and slopes leave them some µm below the ground; those of a sole may also sink
        a little, see above.
        """
        for point in np.flatnonzero(before > self.closed).tolist():
            height = min(self.height(at, point), 0.0)
            if self.ridge[point] == _SOLE:
                self._floor[point] = height - 0.5 * _RISEN
            elif height < -_NEAR:
                self._floor[point] = height

    def measure_gaps(self, at: Instant) -> None:
        """Measure the gaps of all open points."""
        for point, closed in enumerate(self.closed.tolist()):
            if closed:
                at.gap[point] = np.inf
                continue
            height = self.height(at, point)
            if height > _RISEN:
                self._floor[point] = 0.0
            at.gap[point] = height - self._floor[point]

    def refuse_buried(self, at: Instant) -> None:
        """Raise InputError if a foot begins inside the ground."""
        for point in range(self.count):
            depth = -self.height(at, point)
            if depth > _BURIED:
                raise InputError(
                    f"foot {self.feet[self.foot_of[point]].contact.frame} begins "
                    f"{depth * 1e3:.3g} mm inside the ground: raise the base by as much"
                )

    def margin(self, at: Instant) -> tuple[float, int]:
        """Return the smallest margin (m, body weights) and its point; below 0 it must change."""
        if self.count == 0:
            return np.inf, -1
        return self._kernel.smallest_margin(
            self.C, at.velocity, at.force, at.gap, self.closed, self._weight
        )

    def touching(self, at: Instant, *, tolerance: float = _NEAR) -> IntArray:
        """Return 1 for every point that is closed or could close now (P,)."""
        mask = self.closed.copy()
        for point in np.flatnonzero(mask == 0):
            near = self.height(at, int(point)) <= tolerance
            if near and self._approach(at, int(point)) <= _NEAR:
                mask[point] = 1
        return mask

    def _approach(self, at: Instant, point: int) -> float:
        x, y, _ = at.position[point].tolist()
        return float(contact_frame(self.ground, x, y)[2] @ at.velocity[point])

    def close(self, at: Instant, point: int) -> None:
        """Let a point touch the ground where it is."""
        x, y, _ = at.position[point].tolist()
        self.C[point] = contact_frame(self.ground, x, y)
        self.anchor[point] = at.position[point]
        self.closed[point] = 1
        self.yielding[point] = 0.0

    def strike(self, at: Instant, mask: IntArray) -> tuple[Array, Array]:
        """Solve the plastic impact of the touching points; return velocity and impulses.

        Points that rebound are open afterwards; tangential impulses obey the friction cone.
        """
        speed, impulse = np.zeros_like(at.v), np.zeros((self.count, 3))
        self._kernel.project(at.L, at.J, self.C, mask, at.rows)
        yielding = np.zeros(self.count)
        none = np.zeros((self.count, 3))
        spinless = np.zeros(len(self.feet))
        self._settle(at, at.L.T @ at.v, none, mask, yielding, spinless, speed, impulse)
        return speed, impulse

    def settle(self, at: Instant, mask: IntArray) -> None:
        """Find which touching points stay closed under the forces of this instant."""
        self._kernel.demand(
            self.C, at.position, self.anchor, at.velocity, at.drift, *self.rates, at.target
        )
        self._kernel.project(at.L, at.J, self.C, mask, at.rows)
        free, x, force = np.linalg.solve(at.L, at.right), np.zeros_like(at.v), at.force.copy()
        self._settle(at, free, at.target, mask, self.yielding, at.spin, x, force)

    def _settle(
        self,
        at: Instant,
        free: Array,
        target: Array,
        mask: IntArray,
        yielding: Array,
        spin: Array,
        x: Array,
        force: Array,
    ) -> None:
        status = self._friction.settle(
            at.L, at.rows, free, target, mask, self.closed, self.mu, self.ridge, yielding,
            self.foot_of,
            self.torsion, at.twist_rows, spin, 1e-9 * self._weight, x, force,
        )  # fmt: skip
        if status:
            touching = sorted({self.feet[self.foot_of[p]].contact.frame for p in mask.nonzero()[0]})
            raise PlantStop(
                Outcome.CONTACT_UNSOLVABLE,
                f"no contact forces satisfy unilateral contact and friction at {touching}",
            )
