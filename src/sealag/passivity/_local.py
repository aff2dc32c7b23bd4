"""The exact local margin of a certificate, checked again in doubles from its frozen loop."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from sealag.passivity._axis import DelayedLoop, roots_with_error, unstable_roots
from sealag.passivity._checks import Check
from sealag.passivity._jitter_proof import JitterProof, Quotient, quotient
from sealag.passivity._kinds import Criterion, Place
from sealag.passivity._proofs import AGREEMENT, InstantProof
from sealag.passivity._statement import Answer, Question
from sealag.passivity._sweep import EARLIER, earliest_crossing
from sealag.typing import Array
from sealag.units import time_text

COUPLED = 1e-6
"""Share of A_1 from which an entry that the motor angles do not multiply counts. Ten times less
takes differences of the law for coupling; ten times more trusts a bound of a coupled law."""

_SHARES = (0.25, 0.5, 0.75, 0.999)
"""Shares of the first crossing at which roots are counted where the sweep does not apply."""

_OTHER_BOUND = 10.0
"""How much wider the maker's bound of an eigenvalue's rounding may be: it balances in another way,
and counts as unstable what its bound does not exclude. Ten times less accuses honest counts of
roots beside the axis; ten times more lets slow stable roots be called unstable. None of it lets an
unstable root be called stable."""

_LAST = 0.9
"""Share of the first crossing from which roots are counted where a delay is not excluded. Crossings
at 1e-5 rad/s beside motors at 1e3 rad/s leave the last percents to rounding."""

_STRUCTURE = 1e-8
"""Relative size of A v that counts as 0 for a symmetry v. Ten times less accuses contacts that are
followed by differences; ten times more divides out slow modes of the softest springs."""

_DIFFERENCES = 1e-6
"""Share of F that A_1 may differ by: it holds central differences of the law that runs, good to
1e-9 on a fixed base and to 1e-7 where contacts are followed. Ten times less accuses honest designs;
ten times more would still be seen at the first crossing, which moves in proportion."""

_SOFT = 1e-5
"""Share of the stiffest spring below which F is weighed as if it were that: differences of torques
that carry gravity leave 1e-10 Nm/rad, which no loop of such springs feels."""

_UNRESOLVED = 100.0
"""Longest delay tried where no root crosses, as a multiple of 1/‖A_0 + A_1 + A_e‖."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalLoop:
    """The frozen loop at the critical instant, ẋ = A_0 x + A_1 x(t − d) + A_e x(t − e).

    Attributes:
        states: (s,) names: z0 … coordinates of the motions that the contacts leave free,
            theta:JOINT motor angles, `d/dt` of each, drive:JOINT the torque of a motor with a
            bandwidth, tank:ROW the states of the energy tank.
        A_0: (s, s) what acts without delay, 1/s.
        A_1: (s, s) what is delayed by d, 1/s.
        A_e: (s, s) what is delayed by the embedded delay e, 1/s; None if nothing is.
        embedded_delay_s: e, s.
        symmetries: (s, k) null space that A_0, A_1 and A_e have in common.
        at: where it is frozen. In the posture A_1 holds the F of the bound; at rest J* and S are
            those of the configuration there.
        frequency_rad_s: of the roots that cross at `first_crossing_s`; None where none does, or
            none is known.
        jitter: multipliers that prove `jitter_margin_s`; None where it is 0, unbounded or not
            known.
    """

    states: Annotated[tuple[str, ...], "s"]
    A_0: Annotated[Array, "s", "s"]
    A_1: Annotated[Array, "s", "s"]
    A_e: Annotated[Array, "s", "s"] | None
    embedded_delay_s: float
    symmetries: Annotated[Array, "s", ""]
    at: Place
    frequency_rad_s: float | None
    jitter: JitterProof | None = None

    def without_symmetries(self) -> Quotient:
        """Divide out the symmetries, in rationals."""
        A_e = np.zeros_like(self.A_0) if self.A_e is None else self.A_e
        return quotient((self.A_0, self.A_1, A_e), self.symmetries, self.states)

    def proven(self, delay_s: float, *, P: Array, X: Array, X_e: Array) -> "LocalLoop | None":
        """Return the loop with a proof of its jitter margin; None if that proves nothing.

        Args:
            delay_s: the jitter margin, s.
            P: as in `JitterProof`, of the loop `without_symmetries`.
            X: as there.
            X_e: as there.
        """
        proof = JitterProof(delay_s=delay_s, P=P, X=X, X_e=X_e)
        found = proof.check(self.without_symmetries(), self.embedded_delay_s, exact=False)
        return replace(self, jitter=proof) if found.ok else None

    @property
    def parts(self) -> list[Array]:
        """A_0, A_1 and, if there is one, A_e."""
        return [A for A in (self.A_0, self.A_1, self.A_e) if A is not None]

    @property
    def delayed_share(self) -> float:
        """Largest entry of A_1 over the largest of A_0."""
        return float(np.abs(self.A_1).max(initial=0.0)) / _size(self.A_0)

    def coupled(self, question: Question) -> bool:
        """Tell whether the law answers to motions that the motors do not determine.

        Args:
            question: of the certificate.
        """
        motors = {f"theta:{name}" for name in question.joints}
        others = [k for k, name in enumerate(self.states) if name not in motors]
        aside = float(np.abs(self.A_1[:, others]).max(initial=0.0))
        return question.feedback != "joint" and aside > COUPLED * _size(self.A_1)

    def checks(
        self,
        question: Question,
        answer: Answer,
        *,
        margin_s: float | None,
        proof: InstantProof | None,
        exact: bool,
    ) -> Iterator[Check]:
        """Check the loop's structure, its margins, first crossing and unstable modes.

        Args:
            question: of the certificate that this loop is part of.
            answer: of the same.
            margin_s: the margin that is claimed for the loop's instant, s.
            proof: of the loop's instant, if there is one.
            exact: decide the jitter margin in rational arithmetic instead of balls.
        """
        yield from self._structure_checks(question, proof)
        yield self._symmetry_check()
        reduced = self._reduced()
        yield _unstable(answer.unstable_modes, reduced)
        yield self._margin_check(margin_s, answer.first_crossing_s)
        yield self._jitter_check(answer, margin_s)
        if self.jitter is not None:
            loop = self.without_symmetries()
            yield self.jitter.check(loop, self.embedded_delay_s, exact=exact)
        crossing = answer.first_crossing_s
        if crossing is None:
            return
        omega = self.frequency_rad_s
        if omega is not None and crossing < math.inf:
            yield _on_axis(reduced, delay=crossing, omega=omega)
        if answer.unstable_modes == 0 and reduced.A_e is None:
            yield _swept(reduced, crossing)
        else:
            yield _counted(reduced, crossing, before=answer.unstable_modes)

    def _structure_checks(self, question: Question, proof: InstantProof | None) -> Iterator[Check]:
        """Names of states, rates of positions, and the motors' rows as the design has them."""
        joints = [f"theta:{name}" for name in question.joints]
        drives, tank = (
            [name for name in self.states if name.startswith(kind)] for kind in ("drive:", "tank:")
        )
        free = (len(self.states) - len(drives) - len(tank)) // 2 - len(joints)
        positions = [*(f"z{k}" for k in range(free)), *joints]
        rates = [f"d/dt {name}" for name in positions]
        wanted = [
            f"drive:{joint}"
            for joint, bandwidth in zip(question.joints, question.torque_bandwidth)
            if bandwidth is not None
        ]
        known = (*positions, *rates, *drives, *tank) == self.states and drives == wanted
        known &= tank == [f"tank:{k}" for k in range(len(tank))]
        known &= not tank or question.feedback == "static_joint_tank"
        words = f"{free} free, {len(joints)} motors, {len(drives)} drives, {len(tank)} of a tank"
        yield Check(name="frozen loop: states", ok=known, detail=words)
        if not known:
            return
        half = len(positions)
        unit = np.eye(half, len(self.states), k=half)
        same = (self.A_0[:half] == unit).all() and not any(A[:half].any() for A in self.parts[1:])
        words = "each position changes by its rate"
        yield Check(name="frozen loop: positions", ok=bool(same), detail=words)
        yield self._motor_check(question, proof, free=free)

    def _motor_check(self, question: Question, proof: InstantProof | None, *, free: int) -> Check:
        """Rows of motors and drives, entry by entry as far as the file knows them.

        B θ̈ = τ − τ_sea − viscous θ̇ with τ_sea = K (θ − q) + D_s (θ̇ − q̇), where the torque is
        τ = r (τ_osc − D_θ θ̇) + (1 − r) τ_sea, r = B/B_s, at once or, of a drive with bandwidth ω,
        by τ̇_m = ω (τ − τ_m). A_e holds the τ_sea of τ where torque feedback is late, A_1 holds
        τ_osc.
        """
        n, size = len(question.joints), len(self.states)
        slow = np.array([w is not None for w in question.torque_bandwidth])
        speed = np.array([w for w in question.torque_bandwidth if w is not None])
        angle = np.arange(free, free + n)
        rate = angle + free + n
        drive = 2 * (free + n) + np.arange(len(speed))
        B, late = question.rotor_inertia, self.A_e is not None
        r = B / question.motor_inertia
        spring, damping, friction, torque = np.zeros((4, n, size))
        spring[range(n), angle] = question.spring_stiffness
        spring[range(n), rate] = question.spring_damping
        damping[range(n), rate] = question.D_theta
        friction[range(n), rate] = question.viscous_friction
        torque[slow, drive] = 1.0
        shaping = (1.0 - r)[:, None] * spring
        wanted = np.zeros((2, size, size))
        for whole, tau in zip(
            wanted, (shaping * (not late) - r[:, None] * damping, shaping * late)
        ):
            whole[rate] = np.where(slow[:, None], 0.0, tau) / B[:, None]
            whole[drive] = tau[slow] * speed[:, None]
        wanted[0, rate] += (torque - spring - friction) / B[:, None]
        wanted[0, drive, drive] -= speed
        A_e = np.zeros((size, size)) if self.A_e is None else self.A_e
        known = np.concatenate([angle, rate, drive])
        gaps = [
            float(np.abs((A - W)[np.ix_(rows, known)]).max(initial=0.0)) / _size(W[rows])
            for A, W in zip((self.A_0, A_e), wanted)
            for rows in (rate, drive)
        ]
        takes, gain = rate.copy(), r / B
        takes[slow], gain[slow] = drive, speed * r[slow]
        gaps.append(float(np.abs(np.delete(A_e, [*rate, *drive], axis=0)).max(initial=0.0)))
        by_motors = question.feedback in ("motor", "static_joint")
        certified = question.criterion is Criterion.CERTIFIED
        known = proof if certified and by_motors and self.at is Place.POSTURE else None
        gap = max(gaps)
        apart = self._command_gap(
            known,
            takes=takes,
            gain=gain,
            angle=angle,
            stiffest=float(question.spring_stiffness.max()),
        )
        words = f"K, D_θ, D_s, friction and drives to {gap:.1e}, F over B_s to {apart:.1e}"
        ok = gap <= AGREEMENT and apart <= _DIFFERENCES
        return Check(name="frozen loop: motors", ok=ok, detail=words)

    def _command_gap(
        self,
        proof: InstantProof | None,
        *,
        takes: Array,
        gain: Array,
        angle: Array,
        stiffest: float,
    ) -> float:
        """How far A_1 is from rows that take the command, τ_osc = −F θ + … of free motions.

        F is that of the instant's own proof, where the loop is frozen in its posture and motor
        angles determine the command.
        """
        command = self.A_1[takes] / gain[:, None]
        elsewhere = np.delete(self.A_1, takes, axis=0)
        gap = float(np.abs(elsewhere).max(initial=0.0)) / _size(self.A_1)
        if proof is not None:
            size = max(_size(proof.F), _SOFT * stiffest)
            gap = max(gap, float(np.abs(command[:, angle] + proof.F).max()) / size)
            gap = max(gap, float(np.abs(command[:, angle[-1] + 1 :]).max()) / size)
        return gap

    def _symmetry_check(self) -> Check:
        V = self.symmetries
        lost = max(float(np.abs(A @ V).max(initial=0.0)) / _size(A) for A in self.parts)
        independent = np.linalg.matrix_rank(V) == V.shape[1] if V.size else True
        unit = bool((np.abs(np.linalg.norm(V, axis=0) - 1.0) <= _STRUCTURE).all())
        return Check(
            name="frozen loop: symmetries",
            ok=lost <= _STRUCTURE and bool(independent) and unit,
            detail=f"a null space of {V.shape[1]} directions, to {lost:.1e}",
        )

    def _reduced(self) -> DelayedLoop:
        """Divide out the symmetries v, and rates w along them that last: A_0 w = v, A_1 w = 0."""
        V, parts = self.symmetries, self.parts
        if V.size:
            shift = np.zeros((len(V), len(V)))
            for k, name in enumerate(self.states):
                if f"d/dt {name}" in self.states:
                    shift[self.states.index(f"d/dt {name}"), k] = 1.0
            W = shift @ V
            kept = np.abs(self.A_0 @ W - V).max(axis=0) <= _STRUCTURE * _size(V)
            for A in parts[1:]:
                kept &= np.abs(A @ W).max(axis=0) <= _STRUCTURE * _size(A)
            basis = np.hstack([V, W[:, kept]])
            rest = np.linalg.svd(basis, full_matrices=True)[0][:, np.linalg.matrix_rank(basis) :]
            parts = [rest.T @ A @ rest for A in parts]
        A_0, A_1, *late = parts
        A_e = late[0] if late else None
        return DelayedLoop(A_0=A_0, A_1=A_1, A_e=A_e, embedded=self.embedded_delay_s)

    def _margin_check(self, here: float | None, crossing: float | None) -> Check:
        """The margin is the first crossing, or 0 where a mode is unstable."""
        ok = here == (0.0 if here == 0.0 else crossing)
        ok &= (self.frequency_rad_s is not None) == (crossing is not None and crossing < math.inf)
        late = self.embedded_delay_s
        ok &= late == 0.0 if self.A_e is None else late > 0.0
        words = f"{time_text(here)} with a first crossing at {time_text(crossing)}"
        return Check(name="local margin", ok=ok, detail=words)

    def _jitter_check(self, answer: Answer, here: float | None) -> Check:
        """The jitter margin is what is proven, and no longer than the first crossing."""
        claimed, crossing = answer.jitter_margin_s, answer.first_crossing_s
        if self.jitter is not None:
            ok = claimed == self.jitter.delay_s and answer.unstable_modes == 0
            ok &= crossing is None or self.jitter.delay_s <= crossing
        else:
            free = here == math.inf and not self.A_1.any()
            ok = claimed is None or (claimed == 0.0 == here) or (claimed == math.inf and free)
        words = f"{time_text(claimed)}, {'with' if self.jitter else 'without'} multipliers"
        return Check(name="jitter margin", ok=ok, detail=words)


def _size(A: Array) -> float:
    return max(float(np.abs(A).max(initial=0.0)), 1e-300)


def _unstable(claimed: int, loop: DelayedLoop) -> Check:
    name = "unstable modes without delay"
    if loop.A_e is not None:
        (found,) = unstable_roots(loop, [0.0])
        words = f"{claimed} claimed, {found} counted, argument principle in floating point"
        return Check(name=name, ok=found == claimed, detail=words)
    roots, error = roots_with_error(loop.sum)
    sure, doubtful = int((roots.real > error).sum()), int((np.abs(roots.real) <= error).sum())
    most = int((roots.real >= -_OTHER_BOUND * error).sum())
    words = f"{claimed} claimed, {sure} right of the axis, {doubtful} on it, floating point"
    return Check(name=name, ok=sure <= claimed <= most, detail=words)


def _on_axis(loop: DelayedLoop, *, delay: float, omega: float) -> Check:
    """Whether jω is an eigenvalue of the loop with its late parts turned by their phases."""
    roots, error = roots_with_error(loop.at(np.array([omega]), delay)[0])
    at = int(np.abs(roots - 1j * omega).argmin())
    far, room = float(abs(roots[at] - 1j * omega)), float(error[at]) + 1e-9 * omega
    return Check(
        name="root on the axis at the first crossing",
        ok=omega > 0.0 and delay > 0.0 and far <= room,
        detail=f"{omega:.6g}j rad/s is a root to {far:.1e}, floating point",
    )


def _swept(loop: DelayedLoop, crossing: float) -> Check:
    """Delays below the first crossing are excluded; where rounding leaves the last of them open,
    as at crossings that take hours, roots are counted there."""
    limit = crossing * (1.0 - EARLIER)
    found = earliest_crossing(loop.A_0, loop.A_1, limit=limit)
    ok, words = found >= limit, "all delays are excluded"
    if not ok:
        words = f"{found:.9g} s is not excluded"
        if found >= _LAST * limit:
            at = _SHARES[-1] * crossing
            (number,) = unstable_roots(loop, [at])
            ok = number == 0
            counted = "?" if number is None else number
            words += f", with {counted} roots right of the axis at {at:.9g} s,"
    return Check(
        name="no root crosses before",
        ok=ok,
        detail=f"{words} below {limit:.9g} s, eigenvalue discs in floating point",
    )


def _counted(loop: DelayedLoop, crossing: float, *, before: int) -> Check:
    """Roots right of the axis at delays below the first crossing, or at some where there is none:
    a loop that is unstable without delay may lose some, and gains none."""
    scale = crossing if crossing < math.inf else _UNRESOLVED / _size(loop.sum)
    delays = [share * scale for share in _SHARES]
    found = unstable_roots(loop, delays)
    at = ", ".join(f"{delay:.6g}" for delay in delays)
    words = ", ".join("?" if number is None else f"{number}" for number in found)
    return Check(
        name="no root crosses before",
        ok=all(
            after is not None and first is not None and after <= first
            for first, after in zip([before, *found], found)
        ),
        detail=f"{words} roots right of the axis with delays of {at} s, argument principle in "
        "floating point",
    )
