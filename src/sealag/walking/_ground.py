"""Ground height as a function of place."""

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Protocol, Self

import numpy as np

from sealag.errors import InputError
from sealag.typing import ArrayLike


class Ground(Protocol):
    """Ground whose height is a function of x and y.

    A ground may also have a method ``normal(x, y)`` that returns a normal (3,) of any length;
    without one the normal follows from differences of the height.
    """

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground above the world's origin, m.

        Args:
            x: forward, m.
            y: left, m.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundProfile:
    """Ground that varies forward only: linear between points, level beyond them.

    Without arguments it is level ground at height 0.

    Attributes:
        x: (N,) forward positions of the points, increasing, m.
        z: (N,) their heights, m.

    Raises:
        InputError: x and z differ in length, x does not increase, or a number is not finite.
    """

    x: ArrayLike = field(default=(0.0,), compare=False)
    z: ArrayLike = field(default=(0.0,), compare=False)
    _x: tuple[float, ...] = field(init=False, repr=False)
    _z: tuple[float, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the points."""
        x, z = np.asarray(self.x, dtype=float), np.asarray(self.z, dtype=float)
        if x.shape != z.shape or x.ndim != 1 or len(x) == 0 or (np.diff(x) <= 0.0).any():
            raise InputError("A ground profile needs as many x as z, and x must increase.")
        if not (np.isfinite(x).all() and np.isfinite(z).all()):
            raise InputError("A ground profile must be finite.")
        for name, value in (("x", x), ("z", z)):
            object.__setattr__(self, name, value)
            object.__setattr__(self, f"_{name}", tuple(value.tolist()))

    @classmethod
    def flat(cls, level: float = 0.0) -> Self:
        """Return level ground.

        Args:
            level: its height, m.
        """
        return cls(z=(level,))

    @classmethod
    def paper(cls) -> Self:
        """Return the default rough ground: up 9 cm, down 12 cm, up 9 cm.

        The paper shows its terrain only as a picture. These heights are an assumption of the same
        kind, within the reach of Hume's legs.
        """
        return cls(
            x=(0.2, 0.65, 1.1, 1.55, 2.0, 2.45, 2.9, 3.35),
            z=(0.0, 0.05, 0.09, 0.05, 0.01, -0.03, 0.03, 0.06),
        )

    @classmethod
    def rough(cls, seed: int, *, amplitude: float = 0.05, length: float = 12.0) -> Self:
        """Return random ground: level up to x = 0.2 m, then a new height about every 0.4 m.

        Args:
            seed: of the random generator.
            amplitude: heights lie in ± this, m.
            length: how far the rough part reaches, m.
        """
        rng = np.random.default_rng(seed)
        x = 0.2 + np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 0.5, int(length / 0.3)))])
        z = np.concatenate([[0.0], rng.uniform(-amplitude, amplitude, len(x) - 1)])
        return cls(x=x, z=z)

    @classmethod
    def stairs(cls, rises: ArrayLike, *, run: float = 0.45, start: float = 0.2) -> Self:
        """Return stairs with level treads; a riser is a ramp of 1 mm.

        Args:
            rises: height of each riser, m; negative ones go down.
            run: depth of a tread, m.
            start: x of the first riser, m.
        """
        levels = np.concatenate([[0.0], np.cumsum(np.asarray(rises, dtype=float))])
        edges = start + run * np.arange(len(levels) - 1)
        x = np.sort(np.concatenate([edges - 5e-4, edges + 5e-4]))
        return cls(x=x, z=np.repeat(levels, 2)[1:-1])

    def height(self, x: float, y: float) -> float:
        """Return the interpolated height, m.

        Args:
            x: forward, m.
            y: left, m; the height does not depend on it.
        """
        xs, zs = self._x, self._z
        after = bisect_right(xs, x)
        if after == 0:
            return zs[0]
        if after == len(xs):
            return zs[-1]
        before = after - 1
        return zs[before] + (zs[after] - zs[before]) / (xs[after] - xs[before]) * (x - xs[before])
