"""The jitter margin of a certificate, decided in rational arithmetic from its frozen loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from sealag.passivity._balls import enclosed, exact_matrix, precise, surely_positive
from sealag.passivity._checks import Check
from sealag.passivity._definite import as_doubles, positive_definite, rationals
from sealag.typing import Array, BoolArray
from sealag.units import time_text

if TYPE_CHECKING:
    from flint import fmpq_mat

CHAIN = 1e-9
"""Relative size of A w − v and A_1 w up to which a rate w along a symmetry v lasts. Ten times less
accuses contacts that are followed by differences; ten times more divides out slow modes."""


class Quotient(NamedTuple):
    """A loop without its symmetries, in rationals: y = T x, x = S y but for multiples of them.

    Attributes:
        parts: (k, k) each, T A S of A_0, A_1 and A_e.
        T: (k, s).
        kept: (k,) the states that S takes.
    """

    parts: tuple[Array, ...]
    T: Array
    kept: Array

    @property
    def rows(self) -> tuple[BoolArray, BoolArray]:
        """(k,) each: the rows of A_1, and those of A_e, that are not 0."""
        late = [np.array([any(row) for row in part.tolist()], dtype=bool) for part in self.parts]
        return late[1], late[2]

    def doubles(self) -> tuple[Array, ...]:
        """The parts, rounded."""
        return tuple(as_doubles(part) for part in self.parts)

    def sides(self, B: Array, C: Array) -> tuple[Array, Array]:
        """T B and C S of a command, rounded.

        Args:
            B: (s, m).
            C: (m, s).
        """
        return as_doubles(self.T) @ B, C[:, self.kept]


def quotient(parts: Sequence[Array], symmetries: Array, states: Sequence[str]) -> Quotient:
    """Divide out symmetries v, and the rates w along them that last: A w = v, A_1 w = A_e w = 0.

    With x = v u + S y and y = 0 at the largest entry p of v, y' = (A_i − v_i / v_p A_p) S y.

    Args:
        parts: (s, s) A_0, A_1 and A_e.
        symmetries: (s, k) columns v.
        states: (s,) their names; "d/dt z" is the rate of "z".
    """
    present, *late = (rationals(part) for part in parts)
    whole = present + sum(late[1:], late[0])
    place = {name: k for k, name in enumerate(states)}
    of = [(k, place[f"d/dt {name}"]) for k, name in enumerate(states) if f"d/dt {name}" in place]
    columns = [rationals(v) for v in symmetries.T]
    room = rationals(CHAIN)[()] ** 2
    for v in list(columns):
        rate = rationals(np.zeros(len(states)))
        for k, at in of:
            rate[at] = v[k]
        lost = np.concatenate([whole @ rate - v, *(part @ rate for part in late)])
        if any(rate.tolist()) and lost @ lost <= room * (v @ v):
            columns.append(rate)
    T, kept = rationals(np.eye(len(states))), np.arange(len(states))
    while columns:
        v, *columns = columns
        p = max(range(len(v)), key=lambda k: abs(v[k]))
        ratio, rest = v / v[p], np.delete(np.arange(len(v)), p)
        T = (T - np.outer(ratio, T[p]))[rest]
        columns = [(w - ratio * w[p])[rest] for w in columns]
        kept = kept[rest]
    parts = (present, *late)
    reduced = tuple((T @ part)[:, kept] for part in parts) if symmetries.size else parts
    return Quotient(parts=reduced, T=T, kept=kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class JitterProof:
    """Multipliers from which the jitter margin of the frozen loop follows.

    With K = [A, L], A = A_0 + A_1 + A_e the loop without its symmetries, L the columns of the
    identity and R the rows of A_1 and A_e that are not 0, X = diag(X, X_e) and b = diag(d, e):

        [[P A + Aᵀ P, P L], [⋆, −X]] + (R K)ᵀ b X b (R K) ≺ 0 ,   P ≻ 0, X ≻ 0

    makes ẋᵀPx decrease whatever 0 ≤ τ(t) ≤ d and 0 ≤ ε(t) ≤ e the delays are, as
    ∫ wᵀ X w ≤ b² ∫ ẏᵀ X ẏ for w = y − y(t − τ), y = R x.

    Attributes:
        delay_s: d, s.
        P: (k, k).
        X: (r, r) of the rows of A_1.
        X_e: those of A_e; empty without torque feedback that is late.
    """

    delay_s: float
    P: Annotated[Array, "", ""]
    X: Annotated[Array, "", ""]
    X_e: Annotated[Array, "", ""]

    def check(self, loop: Quotient, embedded_delay: float, *, exact: bool) -> Check:
        """Decide the inequality.

        Args:
            loop: the frozen loop without its symmetries.
            embedded_delay: e, s.
            exact: in rationals; else in balls, which prove as much and are faster.
        """
        late = [int(rows.sum()) for rows in loop.rows]
        shapes = [(size, size) for size in (len(loop.kept), *late)]
        blocks = (self.P, self.X, self.X_e)
        fit = all(one.shape == size for one, size in zip(blocks, shapes))
        even = fit and all(bool((one == one.T).all()) for one in blocks)
        words, holds = "P or X is not symmetric, or not of the loop's size", False
        if even:
            decrease, stored = self._decrease(loop, embedded_delay), exact_matrix(self.P)
            holds = all(_positive(one, exact=exact) for one in (stored, decrease))
            words = f"xᵀPx {'decreases' if holds else 'is not shown to decrease'}"
        way = "rational arithmetic" if exact else "ball arithmetic"
        return Check(
            name="jitter margin: matrix inequality",
            ok=holds and self.delay_s > 0.0,
            detail=f"{words} at {time_text(self.delay_s)}, {len(loop.kept)} states, {sum(late)} "
            f"late signals, {way}",
        )

    def _decrease(self, loop: Quotient, embedded_delay: float) -> "fmpq_mat":
        """diag(0, X) − (R K)ᵀ b X b (R K) − [P K; 0] − [P K; 0]ᵀ."""
        k, places = len(self.P), np.concatenate([np.flatnonzero(rows) for rows in loop.rows])
        L = np.zeros((k, len(places)))
        L[places, range(len(places))] = 1.0
        K = exact_matrix(np.hstack([sum(loop.parts[1:], loop.parts[0]), rationals(L)]))
        size = k + len(places)
        pick = exact_matrix(np.eye(size, k))
        power = pick * (exact_matrix(self.P) * K)
        whole, at = -power - power.transpose(), k
        sides = (self.X, self.delay_s), (self.X_e, embedded_delay)
        for part, rows, (multiplier, bound) in zip(loop.parts[1:], loop.rows, sides, strict=True):
            if not rows.any():
                continue
            X, moved = exact_matrix(multiplier), exact_matrix(part[rows]) * K
            own = exact_matrix(np.eye(size, len(multiplier), k=-at))
            square = rationals(bound)[()] ** 2
            whole += own * X * own.transpose() - moved.transpose() * (square * X) * moved
            at += len(multiplier)
        return whole


def _positive(matrix: "fmpq_mat", *, exact: bool) -> bool:
    """Decide in balls, and in rationals where that is asked for or balls leave it open."""
    if not exact:
        with precise():
            found = surely_positive(enclosed(matrix))
        if found is not None:
            return found
    return positive_definite(np.array(matrix.tolist(), dtype=object)).holds
