"""Ground height as a function of place."""

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array, ArrayLike


class Terrain(Protocol):
    """Ground whose height is a function of x and y."""

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground.

        Args:
            x: forward, m.
            y: left, m.

        Returns:
            m above the origin.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatTerrain:
    """Level ground.

    Attributes:
        level: its height, m.
    """

    level: float = 0.0

    def height(self, x: float, y: float) -> float:
        """Return the level everywhere.

        Args:
            x: forward, m.
            y: left, m.
        """
        return self.level


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileTerrain:
    """Ground that varies forward only: linear between points, level beyond them.

    Attributes:
        x: (N,) m, increasing.
        z: (N,) m.

    Raises:
        InputError: lengths differ, or x does not increase.
    """

    x: Array
    z: Array
    _points: tuple[list[float], list[float]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the points."""
        x, z = np.asarray(self.x, dtype=float), np.asarray(self.z, dtype=float)
        if x.shape != z.shape or x.ndim != 1 or len(x) == 0 or (np.diff(x) <= 0.0).any():
            raise InputError("A terrain profile needs as many x as z, and x must increase.")
        if not (np.isfinite(x).all() and np.isfinite(z).all()):
            raise InputError("A terrain profile must be finite.")
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "z", z)
        object.__setattr__(self, "_points", (x.tolist(), z.tolist()))

    def height(self, x: float, y: float) -> float:
        """Return the interpolated height.

        Args:
            x: forward, m.
            y: left, m; it has no influence.
        """
        xs, zs = self._points
        k = bisect_right(xs, x)
        if k == 0 or k == len(xs):
            return zs[k and -1]
        return zs[k - 1] + (zs[k] - zs[k - 1]) / (xs[k] - xs[k - 1]) * (x - xs[k - 1])


def paper_terrain() -> ProfileTerrain:
    """Return the default rough terrain: up 9 cm, down 12 cm, up 9 cm.

    The paper shows its terrain only as a picture; the heights are an assumption of the same kind,
    within what Hume's legs reach.
    """
    x = np.array([0.2, 0.65, 1.1, 1.55, 2.0, 2.45, 2.9, 3.35])
    return ProfileTerrain(x=x, z=np.array([0.0, 0.05, 0.09, 0.05, 0.01, -0.03, 0.03, 0.06]))


def rough_terrain(seed: int, *, amplitude: float = 0.05, length: float = 12.0) -> ProfileTerrain:
    """Return random rough ground: level up to x = 0.2 m, then a new height about each 0.4 m.

    Args:
        seed: of the random generator.
        amplitude: heights lie in ± this, m.
        length: how far the rough part reaches, m.
    """
    rng = np.random.default_rng(seed)
    x = 0.2 + np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 0.5, int(length / 0.3)))])
    z = np.concatenate([[0.0], rng.uniform(-amplitude, amplitude, len(x) - 1)])
    return ProfileTerrain(x=x, z=z)


def stairs(rises: ArrayLike, *, run: float = 0.45, start: float = 0.2) -> ProfileTerrain:
    """Return stairs with level treads.

    Args:
        rises: height of each riser, m; negative ones go down.
        run: depth of a tread, m.
        start: x of the first riser, m.
    """
    levels = np.concatenate([[0.0], np.cumsum(np.asarray(rises, dtype=float))])
    edges = start + run * np.arange(len(levels) - 1)
    x = np.sort(np.concatenate([edges - 5e-4, edges + 5e-4]))
    return ProfileTerrain(x=x, z=np.repeat(levels, 2)[1:-1])
