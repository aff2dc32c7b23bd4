"""A linear loop with late signals, and what may be asked of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sealag.errors import InputError
from sealag.extras import extra
from sealag.margin._channels import Channels, channel_margin
from sealag.margin._jitter import Broken, JitterMargin, jitter_margin
from sealag.margin._loop import Loop, parts_of, prepare, real_numbers, real_square, time_of
from sealag.margin._margin import DelayMargin, exact_margin
from sealag.margin._multipliers import Multipliers, multipliers
from sealag.margin._roots import loop_roots
from sealag.margin._sampled import Held, SampledMargin
from sealag.typing import Array, ArrayLike


@dataclass(frozen=True, slots=True)
class DelayedLoop:
    """ẋ = A_0 x + B C x(t − d) + A_e x(t − e); docs/theory section 7.

    Attributes:
        A_0: (n, n) undelayed part, 1/s.
        B: (n, m) what the command does; without C the whole delayed part A_1 (n, n), 1/s.
        C: (m, n) the command of a state, late by d.
        A_e: (n, n) part with a delay of its own, 1/s; None for none.
        embedded_delay: that delay e, s.
        symmetries: (n, s) columns v with A_0 v = A_1 v = A_e v = 0; they and the chains A_0 y = v,
            A_1 y = A_e y = 0 that belong to them are divided out before anything is computed.
        memory: how many of the last states are a controller's, which moves them at its ticks.
        memory_period: T, s, where these states are the bilinear equivalent of a controller that is
            given for this period; 0 where it is given in continuous time, and at its ticks moves
            them exactly with its measurement held.
    """

    A_0: ArrayLike
    B: ArrayLike
    C: ArrayLike | None = None
    A_e: ArrayLike | None = None
    embedded_delay: float = 0.0
    symmetries: ArrayLike | None = None
    memory: int = 0
    memory_period: float = 0.0

    @property
    def A_1(self) -> Array:
        """(n, n) what is late by d, 1/s."""
        return np.matmul(*self._sides())

    def margin(
        self,
        *,
        at_most: float | None = None,
        intervals: bool = False,
        horizon: float | None = None,
        confirm: bool = False,
    ) -> DelayMargin:
        """Exact margin for a constant delay d; docs/theory sections 7.1 to 7.3.

        A root jω with z = e^{-jωd} solves det(jω − A_0 − z A_1 − A_e e^{-jωe}) = 0. Without A_e the
        eigenvalues of A_0 + e^{-jφ} A_1 are enclosed over half a turn φ; with it those of
        G(jω) = C (jω − A_0 − z_0 A_1 − A_e e^{-jωe})⁻¹ B over ω. Intervals are excluded, or hold
        eigenvalues that each meet |z| = 1 at most once and are refined by Newton's method; a band
        that nothing explains raises. Necessary and sufficient for the loop. A root that touches the
        axis only at zero frequency does so after an infinite delay: never; where rounding cannot
        tell, the sign of det(A_0 − A_1) in rational arithmetic does.

        One delay is enough for a law that feeds back a stiffness: its signal passes the ways up and
        down once each, so that only their sum d_1 moves roots; the feedforward's d_2, the way down,
        moves none. Delays that vary are not covered: see `jitter_margin`.

        Cost: an n × n eigenvalue problem a sample, and a few samples a crossing. On one core some
        30 ms for 36 states of a robot, 0.2 s for a dense A_1 with n = 50 and 6 s with n = 150, more
        with many crossings. With A_e 0.1 to 1 s already for 8 states, the more the lighter the
        damping.

        Args:
            at_most: longest delay of interest, s: later crossings are left out, which is much
                faster; None for all.
            intervals: whether to list the ranges of delay with their numbers of unstable roots.
            horizon: longest delay listed in intervals, s, which asks for them too; None for twenty
                periods of the slowest crossing.
            confirm: whether to count the roots at zero delay and on both sides of the margin by an
                independent method (Chebyshev collocation) too.

        Raises:
            InputError: matrices do not fit or are not finite real numbers, a time is negative or
                not finite, or roots cross more often before the horizon than can be listed.
            SolverError: A_0, A_1 or A_e moves a symmetry, a band could be neither excluded nor
                explained, or a check contradicts the answer.
        """
        return exact_margin(
            self._prepared(),
            at_most=at_most,
            intervals=intervals,
            horizon=horizon,
            confirm=confirm,
        )

    def jitter_margin(
        self,
        channels: Mapping[str, Sequence[int]] | None = None,
        *,
        alone: bool = True,
        at_most: float | None = None,
    ) -> JitterMargin:
        """Largest delay below which d may vary as it likes; docs/theory section 7.4.

        Broken at y = R x with C = L R, the loop is y − y(t − τ) = w, w = Δ ẏ with
        Δv = ∫_{t−τ(t)}^{t} v ds and ‖Δ‖ ≤ d in L2 for 0 ≤ τ(t) ≤ d (Kao and Lincoln, Automatica
        2004). One τ for all of y commutes with constant matrices. With A = A_0 + B C + A_e and

            T(s) = s R (s − A)⁻¹ B L ,

        the loop is stable for every such τ if A is Hurwitz and d ‖X^½ T X^-½‖_∞ < 1 for some X ≻ 0.
        The break is at the singular values of C, C = U Σ Vᵀ, L = U Σ^½, R = Σ^½ Vᵀ, and X = I
        there. Where C = −F with F symmetric, that is X = F⁻¹ at the command.

        The norm is the level of which no eigenvalue of a Hamiltonian matrix is on the imaginary
        axis beyond rounding (Bruinsma and Steinbuch, 1990), bracketed to 1e-9. A_e, late by at most
        its own ε ≤ e, is a second Δ with a multiplier of its own, and varies as it likes too.

        Signals that do not share their delay are blocks of their own, X = diag(x_k I), each broken
        at its own singular values; the x_k are optimised (`Channels`).

        Cost: an eigenvalue problem of 2 n a step, three or four steps: 10 ms for 36 states, 0.3 s
        for 76; one step where `at_most` is proven; with several delays ten times as much.

        Args:
            channels: rows of C by name, each row in one channel, whose delays vary independently,
                each up to d; None for one delay of all.
            alone: whether to bound also what each channel tolerates if only that is late.
            at_most: longest delay of interest, s: whether one delay of all up to it is proven takes
                one step; None for the largest one.

        Returns:
            The margin, at most that of `margin`, which is of constant delays only; with
            each channel's own where channels are named.

        Raises:
            InputError: matrices do not fit or are not finite real numbers, a time is negative, or
                the channels do not hold each row once.
            SolverError: a matrix moves a symmetry, or rounding leaves the norm open.
        """
        longest = None if at_most is None else time_of("at_most", at_most)
        loop, broken = self._parts()
        if channels is not None:
            rows = self._rows_of(channels)
            found = channel_margin(loop, Channels.of(loop, [self._side(at) for at in rows]))
            if not alone:
                return found
            each = (self._only(at).jitter_margin().delay for at in rows)
            return replace(found, channels=dict(zip(channels, each)))
        if broken.late < len(broken.right):
            return channel_margin(loop, Channels.of_broken(broken, loop.embedded_delay))
        return jitter_margin(loop, broken, at_most=longest)

    def jitter_multipliers(
        self, rows: ArrayLike, embedded_rows: ArrayLike | None = None
    ) -> Multipliers | None:
        """Return P and X that prove the jitter margin, less 1e-7 of it or a little more.

        Args:
            rows: (n,) which rows of A_1 are not 0.
            embedded_rows: (n,) the same of A_e; None for none.

        Returns:
            The multipliers of `Multipliers`; None where there is no bound to prove, or rounding
            leaves no room.

        Raises:
            InputError: matrices cannot be used, or the loop has symmetries: divide them out.
            SolverError: rounding leaves the norm open.
        """
        loop, broken = self._parts()
        if loop.neutral:
            raise InputError("A loop with symmetries has no strict inequality: divide them out.")
        late = np.asarray(rows, dtype=bool)
        embedded = np.zeros_like(late) if embedded_rows is None else np.asarray(embedded_rows)
        return multipliers(loop, broken, late, embedded)

    def sampled_margin(self, period: float) -> SampledMargin:
        """Largest constant delay of the loop sampled and held; docs/theory section 7.6.

        A hold is a delay that grows from d to d + T and falls back: up to the jitter margin less T
        the loop is stable for sure. From there delays are tried, eight in a period, until one is
        unstable, and the last step is bisected. The measurement of a controller with memory is held
        too: the jitter margin is then that beside what drives the memory, late by up to T. Of one
        that is given for its period nothing is proven.

        Args:
            period: T, s.

        Raises:
            InputError: matrices do not fit, the period is no time or not the memory's, or there is
                an A_e.
            SolverError: a matrix moves a symmetry, or rounding leaves the jitter margin open.
        """
        held = self._held(period)
        if not self.memory:
            return held.margin(self.jitter_margin().delay)
        if self.memory_period:
            return held.margin(0.0)
        A_0 = self._present()
        driven, plant = np.zeros_like(A_0), len(A_0) - self.memory
        driven[plant:, :plant] = A_0[plant:, :plant]
        late = DelayedLoop(
            A_0=A_0 - driven,
            B=self.B,
            C=self.C,
            A_e=driven,
            embedded_delay=period,
            symmetries=self.symmetries,
        )
        return held.margin(late.jitter_margin().delay)

    def sampled_radius(self, period: float, delay: float) -> float:
        """Spectral radius of ẋ = A_0 x + B u with u = C x(kT) held on kT + d ≤ t < (k + 1) T + d.

        Exact: with d = m T + r, 0 ≤ r < T,

            x_{k+1} = Φ x_k + Γ_new u_{k−m} + Γ_old u_{k−m−1} ,   Φ = e^{A_0 T} ,
            Γ_new = ∫_0^{T−r} e^{A_0 s} ds B ,   Γ_old = e^{A_0 (T−r)} ∫_0^r e^{A_0 s} ds B

        on x_k and the m + 1 commands that wait. The sampled loop is stable if and only if it is
        less than 1. Memory ξ̇ = A_c ξ + G x is not part of that motion: it goes on at the ticks,

            ξ_{k+1} = e^{A_c T} ξ_k + ∫_0^T e^{A_c s} ds G x_k   or, of a period of its own,
            ξ_{k+1} = A_d ξ_k + (A_d + 1) G x_k ,  A_d = (1 + A_c T/2) (1 − A_c T/2)⁻¹ .

        Args:
            period: T, s.
            delay: d of measurement, computation and command together, s; the hold comes on top.

        Raises:
            InputError: matrices do not fit, a time is no time or not the memory's period, there is
                an A_e, or more commands wait than can be lifted.
            SolverError: a matrix moves a symmetry.
        """
        return self._held(period).radius(time_of("delay", delay))

    def roots(self, delay: float, *, count: int = 1, nodes: int = 24) -> Array:
        """Rightmost roots of det(λ − A_0 − A_1 e^{-λd} − A_e e^{-λe}) = 0.

        The generator of the solution semigroup is discretised on Chebyshev nodes over the longer
        delay, in two pieces where there are two delays (Breda, Maset & Vermiglio), for the signals
        that act late only. Every root is refined by Newton's method on the characteristic equation.
        Independent of `margin`; a heuristic where `nodes` resolve too little.

        Args:
            delay: d, s, constant.
            count: how many roots.
            nodes: Chebyshev nodes over the delay; doubled until the roots stand still.

        Returns:
            (count,) complex roots by decreasing real part; fewer if the loop has fewer.

        Raises:
            InputError: a matrix cannot be used, or the delay is negative or not finite.
        """
        delay = time_of("delay", delay)
        if count < 1 or nodes < 4:
            raise InputError(f"count is {count} and nodes {nodes}; at least 1 and 4 are needed.")
        return loop_roots(self._prepared(), delay, count=count, nodes=nodes)

    def to_control(self) -> Any:
        """Return the loop, opened where it is late, as a StateSpace of python-control.

        ẋ = A_0 x + B u + E w with the outputs y = C x and, if there is an A_e = E R, v = R x. The
        loop is u(t) = y(t − d), w(t) = v(t − e), without a change of sign. Exact: no delay is
        approximated; a Padé approximant of your order goes between y and u. Where A_1 is given
        whole, B holds columns of the identity and C the rows of A_1 that are not 0; so E and R of
        A_e. Symmetries stay in.

        Returns:
            The system, inputs `u[0] …` and `w[0] …`, outputs `y[0] …` and `v[0] …`, states by name
            where the loop has names, with _ for the points in them.

        Raises:
            InputError: python-control is not installed, or matrices do not fit or are not finite
                real numbers.
        """
        control = extra("control", use="to_control")
        A_0, A_1, A_e = parts_of(self.A_0, self.A_1, self.A_e, self.embedded_delay)
        B, C = _rows_of(A_1) if self.C is None else self._sides()
        E, R = _rows_of(A_e)
        return control.StateSpace(
            A_0,
            np.hstack([B, E]),
            np.vstack([C, R]),
            np.zeros((len(C) + len(R), len(C) + len(R))),
            states=[name.replace(".", "_") for name in self._state_names()],
            inputs=_numbered("u", len(C)) + _numbered("w", len(R)),
            outputs=_numbered("y", len(C)) + _numbered("v", len(R)),
        )

    def _state_names(self) -> tuple[str, ...]:
        return tuple(_numbered("x", len(np.asarray(self.A_0))))

    def _sides(self) -> tuple[Array, Array]:
        """B and C; the identity and A_1 where that is given whole."""
        if self.C is None:
            A_1 = real_square("A_1", self.B)
            return np.eye(len(A_1)), A_1
        wanted = "a matrix of real numbers"
        B, C = (real_numbers(name, given, what=wanted)
                for name, given in (("B", self.B), ("C", self.C)))  # fmt: skip
        size, m = len(real_square("A_0", self.A_0)), len(C)
        if B.shape != (size, m) or C.shape != (m, size):
            raise InputError(
                f"B is {B.shape} and C {C.shape}; A_0 of {size} states needs ({size}, m) and "
                f"(m, {size})."
            )
        return B, C

    def _prepared(self) -> Loop:
        """The loop, checked and without its symmetries."""
        return prepare(
            self.A_0,
            self.B if self.C is None else self.A_1,
            symmetries=self.symmetries,
            A_e=self.A_e,
            embedded_delay=self.embedded_delay,
        )

    def _parts(self) -> tuple[Loop, Broken]:
        """The loop, and it broken where it is late."""
        loop = self._prepared()
        return loop, Broken.of(loop, *self._sides())

    def _rows_of(self, channels: Mapping[str, Sequence[int]]) -> list[Array]:
        """The rows of C of each channel."""
        rows = [np.asarray(at, dtype=int).ravel() for at in channels.values()]
        every = np.sort(np.concatenate([np.zeros(0, dtype=int), *rows]))
        m = len(self._sides()[1])
        if not np.array_equal(every, np.arange(m)):
            raise InputError(
                f"channels name the rows {every.tolist()}; each of the {m} rows of C must be in "
                "one channel."
            )
        return rows

    def _side(self, rows: Array) -> tuple[Array, Array]:
        """B and C of some rows of the command."""
        B, C = self._sides()
        return B[:, rows], C[rows]

    def _only(self, rows: Array) -> "DelayedLoop":
        """The loop of which only some rows of the command are late, and torque feedback is not."""
        B, C = self._side(rows)
        present = real_square("A_0", self.A_0) + self.A_1 - B @ C
        if self.A_e is not None:
            present = present + np.asarray(self.A_e)
        return DelayedLoop(A_0=present, B=B, C=C, symmetries=self.symmetries)

    def _held(self, period: float) -> Held:
        """The loop whose command is held for a period."""
        loop, broken = self._parts()
        if loop.embedded:
            raise InputError("A sampled loop has one delay; there is an A_e with one of its own.")
        if self.memory != 0 and self.memory not in range(1, len(self._present())):
            raise InputError(
                f"memory is {self.memory}; it counts the last of {len(self._present())} states, of "
                "which one at least is not the controller's."
            )
        if not self.memory:
            return Held.of(loop.A_0 + loop.A_e, broken.left, broken.right, period=period)
        return Held.with_memory(
            self._present(),
            *self._sides(),
            symmetries=self.symmetries,
            memory=self.memory,
            own=self.memory_period,
            period=period,
        )

    def _present(self) -> Array:
        """A_0 with an A_e that is not late."""
        A_0 = real_square("A_0", self.A_0)
        return A_0 if self.A_e is None or self.embedded_delay else A_0 + np.asarray(self.A_e)


def _rows_of(matrix: Array) -> tuple[Array, Array]:
    """Columns of the identity and the rows that are not 0, whose product is the matrix."""
    rows = np.flatnonzero(matrix.any(axis=1))
    return np.eye(len(matrix))[:, rows], matrix[rows]


def _numbered(letter: str, count: int) -> list[str]:
    return [f"{letter}[{k}]" for k in range(count)]
