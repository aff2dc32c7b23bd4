"""Which contact points hold, slide or are open, and how far each is from changing."""

from collections.abc import Sequence

import numpy as np

from sealag.errors import InputError
from sealag.robot import Robot
from sealag.simulation._body import Body
from sealag.simulation._ground import Foot, Ground, contact_frame
from sealag.simulation._instant import Instant
from sealag.simulation._outcome import Outcome, PlantStop
from sealag.typing import Array, IntArray

OPEN, STICK, SLIP = 0, 1, 2
MARGIN = 1e-9  # in body weights, m and m/s: a condition this close to ending is at its end
_NEAR = 1e-7  # m, m/s: closed points' partners in the same event
_BURIED = 1e-4  # m: how deep a foot may begin inside the ground


class Contacts:
    """The contact points of all feet: their frames of reference, modes and margins.

    Args:
        robot: The robot.
        feet: What may touch the ground.
        ground: Where the ground is.
        loaded_frames: Frames on which disturbing forces act; their points follow the feet's.
        stabilisation: Rate at which contacts return to where they closed, 1/s.
    """

    def __init__(
        self,
        robot: Robot,
        feet: Sequence[Foot],
        ground: Ground,
        loaded_frames: Sequence[str],
        *,
        stabilisation: float,
    ) -> None:
        from sealag.kernels import contact

        self._kernel = contact
        self.feet, self.ground, self.stabilisation = tuple(feet), ground, stabilisation
        frames = [foot.contact.frame for foot in feet]
        self.body = Body(robot, [*frames, *loaded_frames])
        offsets = [foot.offsets() for foot in feet]
        self.foot_of = np.repeat(np.arange(len(feet)), [len(o) for o in offsets]).astype(np.int64)
        self.count = self.foot_of.size
        self.total = self.count + len(loaded_frames)
        loaded = len(feet) + np.arange(len(loaded_frames))
        self.shape = (
            np.concatenate([self.foot_of, loaded]).astype(np.int64),
            np.concatenate([*offsets, np.zeros((len(loaded_frames), 3))]),
        )
        mu = np.array([feet[f].friction for f in self.foot_of])
        self.C = np.tile(np.eye(3), (self.count, 1, 1))
        self.anchor = np.zeros((self.count, 3))
        self.mu = np.ascontiguousarray(mu, dtype=float)
        self.ground_arrays = (self.C, self.anchor, self.mu)
        self.mode = np.zeros(self.count, np.int64)
        self.slide = np.zeros((self.count, 2))
        self.state = (self.mode, self.slide)
        self.torsion = np.zeros((len(frames) + len(loaded_frames), 2))
        for f, foot in enumerate(feet):
            self.torsion[f] = foot.torsional_damping, foot.torsional_limit
        self._weight = robot.mass * 9.81
        self._radius = np.array([feet[f].radius for f in self.foot_of])
        self._rest = np.zeros(self.count, np.int64)
        self._slide_before = np.zeros((self.count, 2))
        self._margins = np.zeros((self.count, 2))

    def open_all(self) -> None:
        """Open every contact."""
        self.mode[:] = OPEN
        self.slide[:] = 0.0

    def remember(self) -> None:
        """Keep the sliding directions of the step's beginning."""
        self._slide_before[:] = self.slide

    def recall(self) -> None:
        """Return to the sliding directions of the step's beginning."""
        self.slide[:] = self._slide_before

    def height(self, at: Instant, point: int) -> float:
        """Return the height (m) of a point's sole above the ground below it."""
        x, y, z = at.position[point].tolist()
        return z - float(self._radius[point]) - self.ground.height(x, y)

    def measure_gaps(self, at: Instant) -> None:
        """Measure the gaps of all open points that are not moving away."""
        for point in range(self.count):
            closed = self.mode[point] != OPEN
            at.gap[point] = np.inf if closed else self.height(at, point)

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
        """Return the smallest margin and its point; negative means that a contact must change.

        In body weights (forces), m (gaps) and m/s (sliding speeds).
        """
        if self.count == 0:
            return np.inf, -1
        self._kernel.margins(
            self.C, at.velocity, at.force, at.gap, self.mode, self._slide_before, self.mu,
            self._weight, self._margins,
        )  # fmt: skip
        worst = int(self._margins.argmin())
        return float(self._margins.flat[worst]), worst // 2

    def touching(self, at: Instant, *, tolerance: float = _NEAR) -> IntArray:
        """Return 1 for every point that is closed or could close now (P,)."""
        mask = (self.mode != OPEN).astype(np.int64)
        for point in np.flatnonzero(self.mode == OPEN):
            near = self.height(at, int(point)) <= tolerance
            if near and self._approach(at, int(point)) <= _NEAR:
                mask[point] = 1
        return mask

    def _approach(self, at: Instant, point: int) -> float:
        x, y, _ = at.position[point].tolist()
        return float(contact_frame(self.ground, x, y)[2] @ at.velocity[point])

    def close(self, at: Instant, point: int) -> None:
        """Let a point stick where it is."""
        x, y, _ = at.position[point].tolist()
        self.C[point] = contact_frame(self.ground, x, y)
        self.anchor[point] = at.position[point]
        self.mode[point] = STICK

    def loaded(self) -> Array:
        """Return 1.0 for every foot that has a closed point (F,)."""
        flags = np.zeros(len(self.feet))
        flags[self.foot_of[self.mode != OPEN]] = 1.0
        return flags

    def halted(self, at: Instant, point: int) -> bool:
        """Tell whether a sliding point has come to rest, not only turned."""
        tangent = self.C[point, :2] @ at.velocity[point]
        return float(np.abs(tangent).max()) < 1e-5

    def strike(self, at: Instant, mask: IntArray) -> tuple[Array, Array]:
        """Solve the plastic impact of the touching points; return velocity and impulses.

        The modes become those that hold during the impact: points that rebound are open, points
        whose impulse leaves the friction cone slip.
        """
        speed, impulse = np.zeros_like(at.v), np.zeros((self.count, 3))
        free = at.L.T @ at.v
        self._kernel.project(at.L, at.J, self.C, at.rows)
        self._rest[:] = STICK
        self._settle(at, free, np.zeros((self.count, 3)), mask, speed, impulse)
        return speed, impulse

    def settle(self, at: Instant, mask: IntArray) -> None:
        """Find the modes in which contact forces and accelerations of touching points agree."""
        tangent = np.einsum("pab,pb->pa", self.C[:, :2], at.velocity[: self.count])
        speed = np.linalg.norm(tangent, axis=1)
        moving = speed > _NEAR
        self._rest[:] = np.where(moving, SLIP, STICK)
        self.mode[(self.mode == STICK) & moving & (mask == 1)] = SLIP
        self.mode[(self.mode == SLIP) & ~moving] = STICK
        self.slide[moving] = tangent[moving] / speed[moving, None]
        free = np.linalg.solve(at.L, at.right)
        self._kernel.demand(
            self.C, at.position, self.anchor, at.velocity, at.solved[-1], self.stabilisation,
            at.target,
        )  # fmt: skip
        self._kernel.project(at.L, at.J, self.C, at.rows)
        self._settle(at, free, at.target, mask, np.zeros_like(at.v), np.zeros((self.count, 3)))

    def _settle(
        self, at: Instant, free: Array, target: Array, mask: IntArray, x: Array, force: Array
    ) -> None:
        tolerance = 1e-9 * self._weight
        status = self._kernel.settle(
            at.L, at.rows, free, target, mask, self._rest, self.mode, self.slide, self.mu,
            tolerance, x, force,
        )  # fmt: skip
        if status:
            touching = sorted({self.feet[self.foot_of[p]].contact.frame for p in mask.nonzero()[0]})
            raise PlantStop(
                Outcome.CONTACT_UNSOLVABLE,
                f"no contact forces satisfy unilateral contact and friction at {touching}",
            )
