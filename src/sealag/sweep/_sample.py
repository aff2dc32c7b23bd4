"""Which points are taken: a grid, a Latin hypercube, or Sobol's sequence."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from sealag.errors import InputError, word
from sealag.sweep._axis import Axis, Choices, Value
from sealag.typing import Array

MOST_POINTS = 10_000_000
MOST_LHS = 100_000
"""Points of a Latin hypercube, which is held in memory as a whole; Sobol's sequence is not."""
LARGEST_SEED = 2**32 - 1


class Kind(StrEnum):
    """How points are taken."""

    GRID = "grid"
    LHS = "lhs"
    SOBOL = "sobol"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A numbered list of points that is the same whenever it is asked for.

    Attributes:
        kind: how points are taken.
        axes: the keys with their values.
        points: how many there are.
        seed: of the scrambling.
    """

    kind: Kind
    axes: tuple[Axis, ...]
    points: int
    seed: int

    @classmethod
    def of(cls, text: str, axes: Sequence[Axis]) -> "Sample":
        """Read grid, lhs:POINTS, lhs:POINTS:SEED, or sobol likewise.

        Args:
            text: the expression.
            axes: the keys with their values.

        Raises:
            InputError: it is none, has too many points, or an axis does not fit.
        """
        name, *numbers = text.split(":")
        kind = word(Kind, name, what="--sample")
        if kind is Kind.GRID:
            if numbers:
                raise InputError(
                    f"--sample is {text!r}; a grid has as many points as its values make."
                )
            return cls._grid(tuple(axes))
        whole = [part.isascii() and part.isdigit() and len(part) <= 10 for part in numbers]
        if not (1 <= len(numbers) <= 2 and all(whole) and int(numbers[0]) > 0):
            raise InputError(
                f"--sample is {text!r}; {kind}:POINTS or {kind}:POINTS:SEED is right, such as "
                f"{kind}:1024:7."
            )
        points, seed = int(numbers[0]), int(numbers[1]) if len(numbers) > 1 else 0
        most = MOST_LHS if kind is Kind.LHS else MOST_POINTS
        if points > most or seed > LARGEST_SEED:
            raise InputError(
                f"--sample is {text!r}; {kind} has {most} points and the seed {LARGEST_SEED} at "
                "most."
            )
        for axis in axes:
            if not isinstance(axis.values, Choices) and axis.values.count is not None:
                raise InputError(
                    f"--over {axis.key.text} has a grid's number of values, but --sample is "
                    f"{text!r}; leave the number out."
                )
        return cls(kind=kind, axes=tuple(axes), points=points, seed=seed)

    @classmethod
    def _grid(cls, axes: tuple[Axis, ...]) -> "Sample":
        for axis in axes:
            if not axis.values.size:
                raise InputError(
                    f"--over {axis.key.text} does not say how many values a grid takes; write "
                    "lin40 or log40, or take --sample lhs:POINTS or sobol:POINTS."
                )
        points = math.prod(axis.values.size for axis in axes)
        if points > MOST_POINTS:
            raise InputError(
                f"The grid has {points} points; {MOST_POINTS} are the most. Take fewer values, or "
                "--sample sobol:POINTS."
            )
        return cls(kind=Kind.GRID, axes=axes, points=points, seed=0)

    @property
    def alike(self) -> int:
        """How many points in a row differ in their delays alone."""
        if self.kind is not Kind.GRID:
            return 1
        return math.prod(axis.values.size for axis in self.axes if axis.key.table == "delays")

    def block(self, start: int, stop: int) -> list[tuple[Value, ...]]:
        """Return the values of the points from one number to before another.

        In a grid the last key changes first.

        Args:
            start: the first.
            stop: behind the last.
        """
        values = [axis.values for axis in self.axes]
        if self.kind is Kind.GRID:
            shape = tuple(one.size for one in values)
            places = np.unravel_index(np.arange(start, stop), shape)
            steps = np.stack(places, axis=1).tolist()
            return [tuple(one.step(i) for one, i in zip(values, row)) for row in steps]
        shares = self._shares(start, stop).tolist()
        return [tuple(one.at(share) for one, share in zip(values, row)) for row in shares]

    def _shares(self, start: int, stop: int) -> Array:
        if self.kind is Kind.LHS:
            return _hypercube(len(self.axes), self.points, self.seed)[start:stop]
        from scipy.stats import qmc

        sequence = qmc.Sobol(len(self.axes), rng=np.random.default_rng(self.seed))
        if start:  # SciPy cannot go forward by nothing
            sequence.fast_forward(start)
        with warnings.catch_warnings():  # the balance of 2^k points is the user's choice
            warnings.simplefilter("ignore")
            return sequence.random(stop - start)


@lru_cache(maxsize=1)
def _hypercube(keys: int, points: int, seed: int) -> Array:
    from scipy.stats import qmc

    return qmc.LatinHypercube(keys, rng=np.random.default_rng(seed)).random(points)
