"""The exact local margin of a certificate, checked again in doubles from its frozen loop."""

import math
from collections.abc import Iterator

import numpy as np

from sealag.passivity._axis import (
    EARLIER,
    DelayedLoop,
    earliest_crossing,
    roots_with_error,
    unstable_roots,
)
from sealag.passivity._certificate import Basis, Certificate, Criterion, LocalLoop, Place
from sealag.passivity._checks import Check
from sealag.passivity._inequalities import AGREEMENT
from sealag.typing import Array

COUPLED = 1e-6
"""Share of the delayed stiffness from which an answer to passive motions counts."""

_SHARES = (0.25, 0.5, 0.75, 0.999)
"""Shares of the first crossing at which roots are counted where the sweep does not apply."""

_STRUCTURE = 1e-8

_DIFFERENCES = 1e-6
"""Share of F that A_1 may differ by: it holds central differences of the law that runs, good to
1e-9 on a fixed base and to 1e-7 where contacts are followed. Ten times less accuses honest designs;
ten times more would still be seen at the first crossing, which moves in proportion."""


def local_checks(c: Certificate) -> Iterator[Check]:
    """Check margin, first crossing and unstable modes at the critical instant.

    Args:
        c: the certificate.
    """
    loop = c.local_loop
    if loop is None:
        yield _nothing(c)
        return
    yield from _structure(c, loop)
    yield _symmetric(loop)
    reduced = _without_symmetries(loop)
    yield _unstable(c, reduced)
    yield _agree(c)
    if c.first_crossing_s is not None:
        yield from _crossing(c, loop, reduced, c.first_crossing_s)


def _nothing(c: Certificate) -> Check:
    """Without a loop only this may be said of it: that there is none, where nothing rests."""
    at, rests = c.critical.instant, c.equilibrium is not None and c.equilibrium.found
    none = c.instant_margins_s[at] == 0.0 and not rests
    known = c.instant_basis[at] is not Basis.OPEN and not none
    ok = not known and c.unstable_modes == 0 and c.first_crossing_s is None
    words = "no frozen loop is in the file, and nothing is claimed of it"
    return Check(name="frozen loop", ok=ok, detail=words)


def coupled(c: Certificate) -> bool:
    """Tell whether the law answers to motions that the motors do not determine.

    Args:
        c: the certificate.
    """
    loop = c.local_loop
    if loop is None or c.feedback == "joint":
        return False
    A_1, motors = np.array(loop.A_1), {f"theta:{name}" for name in c.joints}
    others = [k for k, name in enumerate(loop.states) if name not in motors]
    aside = np.abs(A_1[:, others]).max(initial=0.0)
    return bool(aside > COUPLED * _size(A_1))


def _size(A: Array) -> float:
    return max(float(np.abs(A).max(initial=0.0)), 1e-300)


def _structure(c: Certificate, loop: LocalLoop) -> Iterator[Check]:
    """Names of states, rates of positions, and the motors' rows as the design has them."""
    joints = [f"theta:{name}" for name in c.joints]
    drives, tank = (
        [name for name in loop.states if name.startswith(kind)] for kind in ("drive:", "tank:")
    )
    free = [f"z{k}" for k in range((len(loop.states) - len(drives) - len(tank)) // 2 - len(joints))]
    positions = [*free, *joints]
    rates = [f"d/dt {name}" for name in positions]
    wanted = [f"drive:{j}" for j, w in zip(c.joints, c.torque_bandwidth) if w is not None]
    known = [*positions, *rates, *drives, *tank] == loop.states and drives == wanted
    known &= tank == [f"tank:{k}" for k in range(len(tank))]
    known &= not tank or c.feedback == "static_joint_tank"
    words = f"{len(free)} free, {len(joints)} motors, {len(drives)} drives, {len(tank)} of a tank"
    yield Check(name="frozen loop: states", ok=known, detail=words)
    if not known:
        return
    A_0, *late = _parts(loop)
    half = len(positions)
    unit = np.eye(half, len(A_0), k=half)
    same = (A_0[:half] == unit).all() and not any(A[:half].any() for A in late)
    words = "each position changes by its rate"
    yield Check(name="frozen loop: positions", ok=bool(same), detail=words)
    yield _motors(c, loop, free=len(free))


def _motors(c: Certificate, loop: LocalLoop, *, free: int) -> Check:
    """Rows of motors and drives, entry by entry as far as the file knows them.

    B θ̈ = τ − τ_sea − viscous θ̇ with τ_sea = K (θ − q) + D_s (θ̇ − q̇), where the torque is
    τ = r (τ_osc − D_θ θ̇) + (1 − r) τ_sea, r = B/B_s, at once or, of a drive with bandwidth ω, by
    τ̇_m = ω (τ − τ_m). A_e holds the τ_sea of τ where torque feedback is late, A_1 holds τ_osc.
    """
    n, size = len(c.joints), len(loop.states)
    slow = np.array([w is not None for w in c.torque_bandwidth])
    speed = np.array([w for w in c.torque_bandwidth if w is not None])
    angle = np.arange(free, free + n)
    rate = angle + free + n
    drive = 2 * (free + n) + np.arange(len(speed))
    B, K, D, D_s = map(np.array, (c.rotor_inertia, c.spring_stiffness, c.D_theta, c.spring_damping))
    r, late = B / np.array(c.motor_inertia), loop.A_e is not None
    spring, damping, friction, torque = np.zeros((4, n, size))
    spring[range(n), angle], spring[range(n), rate] = K, D_s
    damping[range(n), rate], friction[range(n), rate] = D, c.viscous_friction
    torque[slow, drive] = 1.0
    shaping = (1.0 - r)[:, None] * spring
    parts = (shaping * (not late) - r[:, None] * damping, shaping * late)
    wanted = np.zeros((2, size, size))
    for whole, tau in zip(wanted, parts):
        whole[rate] = np.where(slow[:, None], 0.0, tau) / B[:, None]
        whole[drive] = tau[slow] * speed[:, None]
    wanted[0, rate] += (torque - spring - friction) / B[:, None]
    wanted[0, drive, drive] -= speed
    A_e = np.array(loop.A_e) if late else np.zeros((size, size))
    known = np.concatenate([angle, rate, drive])
    gaps = [
        float(np.abs((A - W)[np.ix_(rows, known)]).max(initial=0.0)) / _size(W[rows])
        for A, W in zip((np.array(loop.A_0), A_e), wanted)
        for rows in (rate, drive)
    ]
    takes, gain = rate.copy(), r / B
    takes[slow], gain[slow] = drive, speed * r[slow]
    gaps.append(float(np.abs(np.delete(A_e, [*rate, *drive], axis=0)).max(initial=0.0)))
    gap, apart = max(gaps), _command(c, loop, takes=takes, gain=gain, angle=angle)
    words = f"K, D_θ, D_s, friction and drives of the file to {gap:.1e}, F over B_s to {apart:.1e}"
    ok = gap <= AGREEMENT and apart <= _DIFFERENCES
    return Check(name="frozen loop: motors", ok=ok, detail=words)


def _command(c: Certificate, loop: LocalLoop, *, takes: Array, gain: Array, angle: Array) -> float:
    """How far A_1 is from rows that take the command, τ_osc = −F θ + … of free motions.

    F is that of the instant's own proof, where the loop is frozen in its posture and motor angles
    determine the command.
    """
    A_1 = np.array(loop.A_1)
    C = A_1[takes] / gain[:, None]
    gap = float(np.abs(np.delete(A_1, takes, axis=0)).max(initial=0.0)) / _size(A_1)
    proof = [p for p in c.proofs if p.instant == c.critical.instant]
    by_motors = c.feedback in ("motor", "static_joint") and c.criterion is Criterion.CERTIFIED
    if proof and by_motors and loop.at is Place.POSTURE:
        F = np.array(proof[0].F)
        gap = max(gap, float(np.abs(C[:, angle] + F).max()) / _size(F))
        gap = max(gap, float(np.abs(C[:, angle[-1] + 1 :]).max()) / _size(F))
    return gap


def _parts(loop: LocalLoop) -> list[Array]:
    return [np.array(A) for A in (loop.A_0, loop.A_1, loop.A_e) if A is not None]


def _given(loop: LocalLoop) -> Array:
    return np.array(loop.symmetries).reshape(len(loop.states), -1)


def _symmetric(loop: LocalLoop) -> Check:
    V = _given(loop)
    lost = max(float(np.abs(A @ V).max(initial=0.0)) / _size(A) for A in _parts(loop))
    independent = np.linalg.matrix_rank(V) == V.shape[1] if V.size else True
    unit = bool((np.abs(np.linalg.norm(V, axis=0) - 1.0) <= _STRUCTURE).all())
    return Check(
        name="frozen loop: symmetries",
        ok=lost <= _STRUCTURE and bool(independent) and unit,
        detail=f"{V.shape[1]} directions along which nothing acts, to {lost:.1e}",
    )


def _without_symmetries(loop: LocalLoop) -> DelayedLoop:
    """Divide out the symmetries, and rates along them that last: A_0 w = v, A_1 w = A_e w = 0."""
    V, parts = _given(loop), _parts(loop)
    if V.size:
        shift = np.zeros((len(V), len(V)))
        for k, name in enumerate(loop.states):
            if f"d/dt {name}" in loop.states:
                shift[loop.states.index(f"d/dt {name}"), k] = 1.0
        W = shift @ V
        kept = np.abs(parts[0] @ W - V).max(axis=0) <= _STRUCTURE * _size(V)
        for A in parts[1:]:
            kept &= np.abs(A @ W).max(axis=0) <= _STRUCTURE * _size(A)
        basis = np.hstack([V, W[:, kept]])
        rest = np.linalg.svd(basis, full_matrices=True)[0][:, np.linalg.matrix_rank(basis) :]
        parts = [rest.T @ A @ rest for A in parts]
    A_e = parts[2] if len(parts) > 2 else None
    return DelayedLoop(A_0=parts[0], A_1=parts[1], A_e=A_e, embedded=loop.embedded_delay_s)


def _unstable(c: Certificate, loop: DelayedLoop) -> Check:
    name, claimed = "unstable modes without delay", c.unstable_modes
    if loop.A_e is not None:
        found = unstable_roots(loop, 0.0, omega=None)
        words = f"{claimed} claimed, {found} counted, argument principle in floating point"
        return Check(name=name, ok=found == claimed, detail=words)
    roots, error = roots_with_error(loop.sum)
    sure, doubtful = int((roots.real > error).sum()), int((np.abs(roots.real) <= error).sum())
    words = f"{claimed} claimed, {sure} right of the axis, {doubtful} on it, floating point"
    return Check(name=name, ok=sure <= claimed <= sure + doubtful, detail=words)


def _agree(c: Certificate) -> Check:
    """The margin is the first crossing, or 0 where a mode is unstable."""
    here, loop = c.instant_margins_s[c.critical.instant], c.local_loop
    ok = here == (0.0 if here == 0.0 else c.first_crossing_s)
    if loop is not None:
        finite = c.first_crossing_s is not None and c.first_crossing_s < math.inf
        ok &= (loop.frequency_rad_s is not None) == finite
        ok &= loop.embedded_delay_s == 0.0 if loop.A_e is None else loop.embedded_delay_s > 0.0
    words = f"{here} s with a first crossing at {c.first_crossing_s} s"
    return Check(name="local margin", ok=ok, detail=words)


def _crossing(
    c: Certificate, loop: LocalLoop, reduced: DelayedLoop, crossing: float
) -> Iterator[Check]:
    omega = loop.frequency_rad_s
    if omega is not None and crossing < math.inf:
        yield _on_axis(reduced, delay=crossing, omega=omega)
    if c.unstable_modes == 0 and reduced.A_e is None:
        yield _swept(reduced, crossing)
    else:
        yield _counted(reduced, crossing, omega=omega, before=c.unstable_modes)


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
    limit = crossing * (1.0 - EARLIER)
    found = earliest_crossing(loop.A_0, loop.A_1, limit=limit)
    words = "all delays are excluded" if found >= limit else f"{found:.9g} s is not excluded"
    return Check(
        name="no root crosses before",
        ok=found >= limit,
        detail=f"{words} below {limit:.9g} s, eigenvalue discs in floating point",
    )


def _counted(loop: DelayedLoop, crossing: float, *, omega: float | None, before: int) -> Check:
    """Roots right of the axis at delays below the first crossing, or at some where there is none:
    a loop that is unstable without delay may lose some, and gains none."""
    scale = crossing if crossing < math.inf else 100.0 / max(_size(loop.sum), 1e-300)
    delays = [share * scale for share in _SHARES]
    found = [unstable_roots(loop, delay, omega=omega) for delay in delays]
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
