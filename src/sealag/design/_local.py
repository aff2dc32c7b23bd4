"""Stability and delay margin of the law that runs, decided over all instants of a motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sealag.design._along import Along
from sealag.design._criteria import ASYMMETRY_TOLERANCE
from sealag.design._proven import proven_jitter
from sealag.errors import ContractionError, SolverError
from sealag.margin import DelayMargin
from sealag.passivity import Basis, LocalLoop, Place
from sealag.robot import Contact
from sealag.typing import Array, BoolArray, IntArray
from sealag.whole_body import FrozenLoop, Rest

MOST_EXACT = 600
"""Instants of a motion that are decided exactly at most; a bound decides the others, or none."""

_BEYOND = (4.0, 32.0)
"""Passive bounds up to which crossings are searched, before all are. Margins of robots lie within
twice the bound; ten times longer searches cost as much as those for all crossings."""

_BESIDE_LAST = 1.05
"""First crossings of the last instant up to which the next one's is searched. Motions move it by a
percent or so from instant to instant; twice as far costs up to twice as much."""

_FEW = 50  # instants up to which all are decided, also once one is known to be unstable
_AT_REST = 1e-7
"""Share of weight and torques that may be unbalanced in a posture that counts as at rest. Ten times
less loses postures of stiff contacts; ten times more takes sagging ones for equilibria."""

_BESIDE = 1e-3
"""rad: distance over which a law is differentiated once more in a singular posture. Over 3e-5 rad
it does without the direction that it lost; a robot moves further than that."""

_BEND = 1e-4
"""Share of a law's derivative that may change over `_BESIDE`: smooth laws stay 1e-6 apart, bent
ones 1e-2."""

_MINIMUM = 1e-9
"""Share of the largest curvature above which a potential has a strict minimum. Ten times less is
rounding; ten times more sends soft but stable postures to the exact decision."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Local:
    """Stability over a motion.

    Attributes:
        basis: what the margin of each instant rests on, a `Basis` each (N,).
        delay: margin of each instant or its lower bound, s (N,); NaN if open.
        unstable_roots: roots not in the open left half-plane without delay (N,); 0 if open.
        critical: the instant with the smallest margin; of those unstable without delay the one with
            most unstable roots.
        margin: its exact margin; None if none could be decided.
        loop: its frozen loop; None where the law has none.
        at: where that is frozen.
        rest: its equilibrium; None if it was not searched.
        problem: why the critical instant has no margin, in words; empty if it has.
    """

    basis: NDArray[np.object_]
    delay: Array
    unstable_roots: IntArray
    critical: int
    margin: DelayMargin | None
    loop: FrozenLoop | None
    at: Place
    rest: Rest | None
    problem: str

    @property
    def unstable_modes(self) -> int:
        """Most unstable roots without delay over the instants that were decided."""
        return int(self.unstable_roots.max())

    @property
    def stable(self) -> bool | None:
        """Whether the loop is stable without delay at every instant; None if that is not known."""
        if self.unstable_modes or (self.delay == 0.0).any():
            return False
        return None if (self.basis == Basis.OPEN).any() else True

    @property
    def margin_s(self) -> float | None:
        """Smallest margin of the instants that were decided exactly, s; None if there is none."""
        exact = self.delay[self.basis == Basis.EXACT]
        return float(exact.min()) if len(exact) else None

    @property
    def first_crossing_s(self) -> float | None:
        """Delay at which roots cross first at the critical instant, s; None if not known."""
        if self.margin is None or np.isnan(self.margin.first_crossing):
            return None
        first = float(self.margin.first_crossing)
        return None if np.isinf(first) and not self.margin.guaranteed else first

    def stated_loop(self) -> LocalLoop | None:
        """Return the frozen loop of the critical instant as a certificate states it, with a proof
        of its jitter margin where there is one."""
        loop, margin = self.loop, self.margin
        if loop is None:
            return None
        crosses = margin is not None and np.isfinite(margin.frequency)
        late = bool(loop.A_e.any()) and loop.embedded_delay > 0.0
        stated = LocalLoop(
            states=tuple(loop.states),
            A_0=loop.A_0 if late else loop.A_0 + loop.A_e,
            A_1=loop.A_1,
            A_e=loop.A_e if late else None,
            embedded_delay_s=loop.embedded_delay if late else 0.0,
            symmetries=loop.symmetries / np.linalg.norm(loop.symmetries, axis=0),
            at=self.at,
            frequency_rad_s=float(margin.frequency) if margin is not None and crosses else None,
        )
        unstable = margin is None or margin.unstable_roots > 0
        return stated if unstable else proven_jitter(stated, loop)

    def undercut(self, bounds: Array) -> list[int]:
        """Return the instants whose exact margin lies below their bound.

        Args:
            bounds: (N,) s.
        """
        return np.flatnonzero((self.basis == Basis.EXACT) & (self.delay < bounds)).tolist()

    def count(self, basis: Basis) -> int:
        """Return how many instants were decided in a way.

        Args:
            basis: the way.
        """
        return int((self.basis == basis).sum())


def local_of(along: Along, bounds: Array, rest: Rest | None = None) -> Local:
    """Decide stability and margin of the law that runs at every instant of a motion.

    Each instant is a loop that holds the instant's configuration. It is frozen in that
    configuration and, where the law sags, also in its equilibrium; the smaller margin counts. An
    instant of a motion that is unstable in its configuration is not frozen elsewhere. Where the law
    has a potential, rests at the instant itself, joints determine all motions and the drives are
    ideal, a strict minimum of the potential is stable without delay, and the passive bound does not
    exceed the margin (V̇ ≤ 0 for delays up to it): such an instant is decided exactly only if its
    bound lies below the smallest margin so far. All others are decided exactly, up to MOST_EXACT.

    Args:
        along: the design and its motion.
        bounds: (N,) of the certified criterion, s; 0 where it decides nothing.
        rest: where the loop of the first instant rests, if that is known already.
    """
    return _Decision(along, bounds, rest).run()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Known:
    """One frozen loop and its margin, as far as it was decided."""

    margin: DelayMargin | None
    loop: FrozenLoop | None
    at: Place
    rest: Rest
    problem: str

    @property
    def roots(self) -> int:
        return 0 if self.margin is None else self.margin.unstable_roots

    @property
    def delay(self) -> float | None:
        """The margin, s; 0 where nothing balances or the law has no loop; None if not decided.

        An infinite margin that is not guaranteed is none: joints so slow that rounding hides their
        crossings have a finite one.
        """
        if not self.rest.found or self.loop is None or self.roots:
            return 0.0
        if self.margin is None or (np.isinf(self.margin.delay) and not self.margin.guaranteed):
            return None
        return float(self.margin.delay)

    def order(self) -> tuple[float, int]:
        """Sort the smallest margin first, of zeros the most unstable, an undecided one last."""
        return (np.inf if self.delay is None else self.delay), -self.roots


class _Decision:
    """The decision over a motion, instant by instant."""

    def __init__(self, along: Along, bounds: Array, first: Rest | None) -> None:
        self._along, self._bounds, self._first = along, bounds, first
        self._system, self._motion = along.system, along.motion
        count = len(self._motion)
        self._basis = np.full(count, Basis.OPEN, dtype=object)
        self._delay, self._roots = np.full(count, np.nan), np.zeros(count, dtype=np.int64)
        self._best: _Known | None = None
        self._critical, self._near = 0, np.nan

    def run(self) -> Local:
        count = len(self._motion)
        minimum = self._minima()
        for k in _spread(np.flatnonzero(~minimum), MOST_EXACT):
            if self._decide(int(k)) and count > _FEW:
                break
        self._basis[minimum], self._delay[minimum] = Basis.BOUND, self._bounds[minimum]
        minima = np.flatnonzero(minimum)
        minima = minima[np.argsort(self._bounds[minima], kind="stable")]
        for k in minima.tolist():
            if self._best is not None and self._bounds[k] >= self._least():
                break
            self._search(k)
        if self._best is None:  # no search came to an end
            self._decide(int(minima[0]))
        assert self._best is not None
        return Local(
            basis=self._basis, delay=self._delay, unstable_roots=self._roots,
            critical=self._critical, margin=self._best.margin,
            loop=self._best.loop, at=self._best.at, rest=self._best.rest,
            problem=self._best.problem,
        )  # fmt: skip

    def _least(self) -> float:
        return np.inf if self._best is None or self._best.delay is None else self._best.delay

    def _found(self, k: int, basis: Basis, delay: float, roots: int = 0) -> None:
        self._basis[k], self._delay[k], self._roots[k] = basis, delay, roots

    def _search(self, k: int) -> None:
        """Search a loop at a minimum for crossings below the smallest margin so far."""
        least, robot, spaces = self._least(), self._system.robot, self._along.at([k])
        q, contacts = self._held(k)
        links = FrozenLoop.free_links(robot, q, spaces.gravity[0], contacts=contacts)
        loop = FrozenLoop.of_links(
            self._system.actuators,
            M=links.M,
            H=links.H,
            S=links.Z[robot.nv_base :],
            C_z=np.zeros((robot.n, links.Z.shape[1])),
            C_theta=-spaces.F_theta[0],
            joint_damping=robot.damping,
        )
        try:
            margin = loop.margin(at_most=None if np.isinf(least) else least)
            told = margin.guaranteed or np.isfinite(margin.delay) or np.isfinite(least)
        except SolverError:
            told = False
        if not told:
            self._found(k, Basis.OPEN, np.nan)
        elif margin.delay < least or np.isinf(least):
            self._found(k, Basis.EXACT, float(margin.delay))
            rest = self._system.in_posture(self._motion, k)
            self._best = _Known(margin=margin, loop=loop, at=Place.POSTURE, rest=rest, problem="")
            self._critical = k
        else:
            self._found(k, Basis.SEARCHED, least)

    def _rest_of(self, k: int) -> Rest:
        """Where the loop that holds an instant rests."""
        if self._first is not None and k == 0:
            return self._first
        return self._system.rest(self._motion, k)

    def _decide(self, k: int) -> bool:
        """Decide an instant exactly; return whether it is unstable without delay."""
        known = [self._at(k, Place.POSTURE, self._system.in_posture(self._motion, k))]
        settled = self._system.law.rests_at_posture and known[0].rest.found
        lost = len(self._motion) > 1 and known[0].delay == 0.0
        if not (settled or lost):
            known.append(self._at(k, Place.REST, self._rest_of(k)))
        worst = min(known, key=_Known.order)
        unstable = worst.delay == 0.0
        undecided = [one for one in known if one.delay is None]
        if undecided and not unstable:  # one place does not speak for the other
            worst = undecided[0]
        if worst.delay is not None:
            self._found(k, Basis.EXACT, worst.delay, worst.roots)
        if self._best is None or worst.order() < self._best.order():
            self._best, self._critical = worst, k
        return unstable

    def _at(self, k: int, at: Place, state: Rest) -> "_Known":
        """The loop of an instant, frozen at a state, and its margin."""
        loop, margin, problem = None, None, state.reason
        singular = bool(self._along.at([k]).singular[0])
        singular &= np.allclose(state.q, self._motion.q[k])
        try:
            loop = self._system.frozen(
                self._motion, k, rest=state, beside=_BESIDE if singular else None
            )
            if loop.bend > _BEND:
                problem = problem or (
                    "a task or contact loses a direction in this posture, and the law's stiffness "
                    f"beside it differs by {loop.bend:.1%}, so that no margin holds; choose "
                    "another posture"
                )
            else:
                margin = _first_crossing(loop, float(self._bounds[k]), near=self._near)
                self._near = float(margin.first_crossing)
                if not margin.unstable_roots and not margin.guaranteed:
                    problem = problem or (
                        "rounding does not tell whether its slowest roots ever cross the axis"
                    )
        except (ContractionError, SolverError) as error:
            problem = problem or str(error)
        return _Known(margin=margin, loop=loop, at=at, rest=state, problem=problem)

    def _minima(self) -> BoolArray:
        """Instants (N,) of a motion that a potential decides: stable, with a margin above the
        bound."""
        system, found = self._system, np.zeros(len(self._motion), dtype=bool)
        potential = system.law.rests_at_posture and not system.law.damped
        if len(found) == 1 or not (potential and system.ideal_drives):
            return found
        for rows, spaces in self._along.parts():
            good = (self._bounds[rows] > 0.0) & (spaces.asymmetry <= ASYMMETRY_TOLERANCE)
            for i in np.flatnonzero(good).tolist():
                k = rows.start + i
                found[k] = self._is_minimum(k, spaces.gravity[i], spaces.F_theta[i])
        return found

    def _held(self, k: int) -> tuple[Array, tuple[Contact, ...]]:
        """Configuration and contacts of an instant."""
        motion = self._motion
        return motion.q[k], motion.contact_sets[motion.contact_index[k]]

    def _is_minimum(self, k: int, springs: Array, F: Array) -> bool:
        """Whether the loop rests at the instant, in a strict minimum of the whole potential, and
        joints determine all motions, so that the command is −F_θ δθ alone."""
        system, (q, contacts) = self._system, self._held(k)
        links = FrozenLoop.free_links(system.robot, q, springs, contacts=contacts)
        S, K = links.Z[system.robot.nv_base :], np.diag(system.actuators.spring_stiffness)
        force = system.robot.gravity(q)
        force[system.robot.nv_base :] -= springs
        weight = max(system.robot.weight, float(np.abs(springs).max(initial=0.0)))
        if np.abs(links.Z.T @ force).max(initial=0.0) > _AT_REST * weight:
            return False
        if np.linalg.matrix_rank(S) < S.shape[1]:
            return False
        hessian = np.block([[links.H + S.T @ K @ S, -S.T @ K], [-K @ S, K + (F + F.T) / 2.0]])
        values = np.linalg.eigvalsh(hessian)
        return bool(values[0] > _MINIMUM * values[-1])


def _first_crossing(loop: FrozenLoop, bound: float, *, near: float) -> DelayMargin:
    """The margin of a loop, searched first where it usually is: at that of the loop before, and
    within a few bounds.

    A search up to a delay is several times shorter than one for all crossings, and what it finds is
    the same: the first one.

    Args:
        loop: the loop.
        bound: its passive bound, s; 0 without one.
        near: first crossing of the loop before, s; NaN or inf without one.
    """
    tried = [_BESIDE_LAST * near] if 0.0 < near < np.inf else []
    tried += [share * bound for share in _BEYOND if 0.0 < bound < np.inf]
    for longest in tried:
        margin = loop.margin(at_most=longest)
        if np.isfinite(margin.first_crossing) or np.isnan(margin.first_crossing):
            return margin
    return loop.margin()


def _spread(instants: Array, most: int) -> Array:
    """The instants, or evenly spaced ones if there are more than `most`."""
    if len(instants) <= most:
        return instants
    return instants[np.linspace(0, len(instants) - 1, most).astype(int)]
