"""Several late signals that vary at once, each as it likes: a block-diagonal multiplier."""

import itertools
import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from sealag.margin._jitter import (
    Broken,
    JitterMargin,
    System,
    frequencies_of,
    halves,
    peak_of,
)
from sealag.margin._loop import Loop, roots_at_once
from sealag.typing import Array

_ROUNDS = 40  # of lowering the delay to what is proven; two or three are usual
_CUTS = 60  # linear programs; ten are usual
_CLOSE = 1e-4
"""Relative distance from the best weights at which they are good enough: no digit that is printed
changes. Ten times less takes twice the cuts."""
_NEWTON = 20  # steps to the longest delay of given weights; five are usual
_WORST = 12  # frequencies that are cut at a time
_WIDEST = 32.0
"""Logarithm of the largest weight, 14 powers of ten: torques beside angles differ by four, memory
by three."""
_PHASES = 8
"""Phases of each block that the upper end tries: a finer search gains less than a percent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channels:
    """A loop without delay, broken at signals of which each block has a varying delay of its own.

    Attributes:
        A: (k, k) the loop without delay, 1/s.
        left: (k, r) what w does.
        right: (r, k) the signals.
        block: (r,) the block of each signal.
        fixed: of each block the bound of its own delay, s; NaN where that is the d sought.
    """

    A: Array
    left: Array
    right: Array
    block: Array
    fixed: Array

    @classmethod
    def of(cls, loop: Loop, parts: list[tuple[Array, Array]]) -> Self:
        """Break a loop at the singular values of each part's C.

        Args:
            loop: the prepared loop; what acts with its embedded delay is a last block.
            parts: B (n, m) and C (m, n) each, whose sum is the loop's late part.
        """
        back = np.linalg.pinv(loop.lift)
        split = [halves(C) for _, C in parts]
        sides = [(back @ B @ L, R @ loop.lift) for (B, _), (L, R) in zip(parts, split, strict=True)]
        fixed = [math.nan] * len(parts)
        if loop.embedded:
            sides.append(halves(loop.A_e))
            fixed.append(loop.embedded_delay)
        return cls(
            A=loop.A_0 + loop.A_1 + loop.A_e,
            left=np.hstack([left for left, _ in sides]),
            right=np.vstack([right for _, right in sides]),
            block=np.repeat(np.arange(len(sides)), [len(right) for _, right in sides]),
            fixed=np.array(fixed),
        )

    @classmethod
    def of_broken(cls, broken: Broken, embedded_delay: float) -> Self:
        """The blocks of a loop whose command is late by one delay: its own and the drives'."""
        rest = len(broken.right) - broken.late
        return cls(
            A=broken.A,
            left=broken.left,
            right=broken.right,
            block=np.repeat([0, 1], [broken.late, rest]),
            fixed=np.array([math.nan, embedded_delay][: 2 if rest else 1]),
        )

    @property
    def sought(self) -> Array:
        """(r,) whether a signal is late by the d sought."""
        return np.isnan(self.fixed[self.block])

    def with_one_delay(self) -> "Channels":
        """The same with the delay sought in place of all others."""
        return replace(self, fixed=np.full(len(self.fixed), math.nan))

    def scaled(self, weights: Array, delay: float) -> System:
        """T with X = diag(weights) and the bounds of all delays: proven where its norm is below 1.

        Args:
            weights: (blocks,) x of X = x I.
            delay: d, s.
        """
        root = np.sqrt(weights)[self.block]
        bound = np.where(self.sought, delay, np.nan_to_num(self.fixed)[self.block])
        left, right = self.left / root, (bound * root)[:, None] * self.right
        return System(self.A, left, right @ self.A, right @ left)


class Weighed(NamedTuple):
    """The largest delay proven, a delay above which no multiplier proves anything, where it is
    reached, and the weights (blocks,) of the multiplier's blocks."""

    delay: float
    upper: float
    frequency: float
    weights: Array


def channel_margin(loop: Loop, channels: Channels) -> JitterMargin:
    """Bound `DelayedLoop.jitter_margin`.

    Args:
        loop: the prepared loop.
        channels: it, broken where it is late.
    """
    unstable = roots_at_once(loop.A_0 + loop.A_1 + loop.A_e)[0] if len(loop.A_0) else 0
    found = Weighed(0.0, 0.0, math.nan, np.ones(0)) if unstable else weighed(channels)
    return JitterMargin(
        delay=found.delay, upper=found.upper, frequency=found.frequency, unstable_roots=unstable,
        neutral=loop.neutral,
    )  # fmt: skip


def weighed(channels: Channels) -> Weighed:
    """Weigh the blocks against each other, and bound the delay with these weights.

    At a frequency log ‖e^E T e^F‖ is convex in the diagonal E and F (three lines theorem). So is
    the largest over all frequencies in t = log d and the weights' logarithms p: the largest t with
    log ‖…‖ ≤ 0 follows from linear programs whose rows are tangents at the worst frequencies.

    Args:
        channels: the broken loop.
    """
    blocks = len(channels.fixed)
    if not channels.sought.any():
        return Weighed(math.inf, math.inf, math.nan, np.ones(blocks))
    weights = np.ones(blocks)
    if blocks > 1:
        grid = frequencies_of(channels.A)
        ends = grid[1:].min() / 10.0, 10.0 * grid.max()
        weights = _Seen.of(channels, np.append(grid, np.geomspace(*ends, 200))).weights()
    found = _proven(channels, weights)
    return found._replace(upper=max(_upper(channels, found), found.delay))


def _proven(channels: Channels, weights: Array) -> Weighed:
    """The largest delay with a norm below 1 over all frequencies, for given weights."""
    prompt = replace(channels, fixed=0.0 * channels.fixed)
    peak = peak_of(prompt.scaled(weights, 1.0))
    delay = 1.0 / peak.high if peak.high else math.inf
    if np.isnan(channels.fixed).all():
        return Weighed(delay, delay, peak.frequency, weights)
    alone = peak_of(channels.scaled(weights, 0.0))
    if not alone.high < 1.0:
        return Weighed(0.0, 0.0, math.nan, weights)
    low, high, frequency = 0.0, min(delay, 1e300), peak.frequency
    for _ in range(_ROUNDS):  # the norm grows with d
        middle = low + (high - low) / 2.0
        peak = peak_of(channels.scaled(weights, middle))
        if peak.high < 1.0:
            low = middle
        else:
            high, frequency = middle, peak.frequency
        if high - low <= 1e-9 * high:
            break
    return Weighed(low, low, frequency, weights)


@dataclass(frozen=True, slots=True)
class _Seen:
    """Responses (f, r, r) at frequencies, the block of each signal and its own delay."""

    T: Array
    block: Array
    fixed: Array

    @classmethod
    def of(cls, channels: Channels, grid: Array) -> Self:
        plain = channels.with_one_delay().scaled(np.ones(len(channels.fixed)), 1.0)
        T = np.concatenate([plain.at(grid), plain.D[None].astype(complex)])
        return cls(T, channels.block, channels.fixed)

    def weights(self) -> Array:
        """Weights of the blocks, 1 of the first."""
        from scipy.optimize import linprog

        blocks = len(self.fixed)
        unit = np.eye(blocks)[0]
        largest = np.linalg.norm(self.T, 2, axis=(1, 2)).max()
        top = -math.log(largest) if largest > 0.0 else 0.0
        lowest, highest = top - 2.0 * _WIDEST, top + 2.0 * _WIDEST
        bounds = [(lowest, highest), *[(-_WIDEST, _WIDEST)] * (blocks - 1)]
        rows, limits = np.zeros((0, blocks)), np.zeros(0)  # of t and p of all blocks but the first
        x, best = unit * highest, unit * lowest
        for _ in range(_CUTS):
            for _ in range(_NEWTON):  # from above: log ‖…‖ is convex and grows with t
                value, slope = self._tangents(x)
                worst = int(value.argmax())
                rows = np.vstack([rows, slope])
                limits = np.append(limits, slope @ x - value)
                x = x - unit * max(value[worst], 0.0) / max(slope[worst, 0], 1e-12)
                if x[0] < lowest or value[worst] <= _CLOSE:
                    break
            if x[0] > best[0]:
                best = x
            found = linprog(-unit, A_ub=rows, b_ub=limits, bounds=bounds)
            if found.x is None or found.x[0] - best[0] <= _CLOSE:
                break
            x = found.x
        return np.exp(np.append(0.0, best[1:]))

    def _tangents(self, x: Array) -> tuple[Array, Array]:
        """log ‖…‖ (k,) at the worst frequencies, and slopes (k, blocks) by t and p."""
        sought = np.isnan(self.fixed[self.block])
        late = np.where(sought, x[0], np.log(np.where(sought, 1.0, self.fixed[self.block])))
        pull = np.append(0.0, x[1:])[self.block] / 2.0
        M = np.exp(late + pull)[:, None] * self.T * np.exp(-pull)
        sizes = np.linalg.norm(M, axis=(1, 2))  # at most √r more than the norm that counts
        likely = np.argsort(-sizes)[: 4 * _WORST]
        U, values, V = np.linalg.svd(M[likely])
        order = np.argsort(-values[:, 0])[:_WORST]
        rows, columns = np.abs(U[order, :, 0]) ** 2, np.abs(V[order, 0, :]) ** 2
        of_block = self.block[:, None] == np.arange(len(self.fixed))
        slope = (rows - columns) @ of_block / 2.0
        slope[:, 0] = rows @ sought
        return np.log(np.maximum(values[order, 0], 1e-300)), slope


def _upper(channels: Channels, found: Weighed) -> float:
    """A delay that no block-diagonal X proves: 1/ρ(U T) at the peak, with phases U of the blocks.

    U commutes with X^½: ‖X^½ T X^-½‖ = ‖X^½ U T X^-½‖ ≥ ρ(U T), also of what is late by d alone.
    """
    plain = channels.with_one_delay().scaled(found.weights, 1.0)
    if math.isnan(found.frequency) or math.isinf(found.frequency):
        T = plain.D.astype(complex)
    else:
        T = plain.at(np.array([found.frequency]))[0]
    own = channels.sought
    T, block = T[np.ix_(own, own)], channels.block[own]
    if not T.size:
        return math.inf
    turns = np.exp(2j * np.pi * np.arange(_PHASES) / _PHASES)
    free = max(int(block.max()), 0)
    tried = np.array([(1.0, *rest) for rest in itertools.product(turns, repeat=free)])
    radius = float(np.abs(np.linalg.eigvals(tried[:, block, None] * T)).max())
    return 1.0 / radius if radius else math.inf
