"""Energy audit: the first law at every logged instant, and who has been passive so far.

Physical books: E = kinetic + gravity + spring + motor (½ θ̇ᵀB θ̇). Works come from exact integrals
of the motor motion (motors, springs) and Runge-Kutta integrals of powers (contacts, pushes); none
is a remainder, so that the residual measures the integrator and the books.

Passivity at the port between embedded and central side, (tau_osc - D_theta θ̇, θ̇), with the shaped
rotor inertia B_s in the joint side's storage S_j:

- joint side:      ∫(τ_osc - D_θ θ̇)ᵀθ̇ dt + disturbances - (S_j - S_j(0)) >= 0,
- controller side: -∫(τ_osc - D_θ θ̇)ᵀθ̇ dt - (V_3 - V_3(0)) >= 0, the slack being V_4 (what the
  delay line stores) and what was dissipated.

The paper closes the loop elsewhere, at the links, Eqs. (25)-(28) and Fig. 3:

- S_j = V_1 = kinetic + gravity at (τ_sea, q̇_j): ∫τ_seaᵀq̇_j dt + disturbances - (S_j - S_j(0)) >= 0;
  the contacts' work, which V_1 integrates, is 0 where feet stick and else part of the slack,
- S_c = V_2 + V_3 + V_4 at (q̇_j, -τ_sea), V_2 = springs + ½ θ̇ᵀB_sθ̇ and the tank's energy in V_4:
  -∫τ_seaᵀq̇_j dt - (S_c - S_c(0)) >= 0, the slack being what the delay line stores in V_4 and what
  was dissipated, as for the controller side above.

What the command gives besides V_3 has two sources. The delay's, ∫(τ_osc - τ_now)ᵀdθ with τ_now
the undelayed command, is what a certificate bounds: it stays below ∫D_θ θ̇² dt. The law's own,
∫τ_nowᵀdθ + V_3 - V_3(0), is zero where the law has a potential and its coefficients stand still,
as a certificate assumes; moving J*, Λ and references put it there. τ_osc is held between two
takings, so that its work is exact; that of τ_now is the trapezoid in θ over the ticks, exact for a
potential that is quadratic in θ, and otherwise known to the bound that is stated beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sealag.kernels import keep
from sealag.kernels.ledger import (
    DISTURBANCE,
    JOINT_FLOWS,
    SCALAR_FLOWS,
    SPRING_STORE,
    STORES,
)
from sealag.simulation._ledger import residual
from sealag.store import Store, blocks, release
from sealag.typing import Array

_STILL = 1e-6

_ROUNDING = 1e-9
"""Share of the energies in a side's books below which it spends nothing: a slack is a difference of
them, of a run that begins balanced to 1e-10 of weight and torques. Ten times less accuses robots of
30 kg that stand still; ten times more hides a millionth of a joule."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Passivity:
    """Running statement of the passivity observer about one side.

    Attributes:
        slack: Energy still allowed at each logged instant (N,), J; negative is not passive.
        passive: True if the slack never fell below ``-tolerance``.
        first_violation: First logged instant at which it did, s; None if never.
        joint: Joint that had delivered most energy at that instant; None if never.
        tolerance: What rounding and integration may spend, J: twice the largest residual, a
            billionth of the side's energies (what is stored, and what has moved), and the error of
            the undelayed command's work.
    """

    slack: Array
    passive: bool
    first_violation: float | None
    joint: str | None
    tolerance: float

    @property
    def verdict(self) -> str:
        """Whether the side was passive; if not, by how much, from when on, and which joint."""
        if self.first_violation is None:
            return "passive"
        return (
            f"not passive by {-self.slack.min():.1e} J, first at {self.first_violation:.3f} s, "
            f"{self.joint}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """Energies and works of a run at its logged instants, cumulative since the start, J.

    Attributes:
        time: Logged instants (N,), s.
        stores: Kinetic, gravity, spring and motor energy by name, each (N,).
        joint_flows: Works per joint by name, each (N, n): port ∫τ_sea q̇, shaft ∫τ_sea θ̇,
            motor_work ∫τ_m θ̇, command ∫τ_osc θ̇, damping ∫D_θ θ̇², viscous and coulomb friction,
            spring_damping, and joint_damping of the bearings on the links' side.
        scalar_flows: Works done on the robot by name, each (N,): holding (contact
            stabilisation), sliding, torsion, disturbance; and impact, which is lost.
        inertia_shaping: Work of the embedded torque feedback, limits and bandwidth (N,):
            motor_work less what tau_osc and the damping account for through B / B_s.
        residual: Energy present less energy expected (N,): the first law's error.
        throughput: Sum of the absolute changes of the stores (N,).
        controller_storage: V_3 and the tank's energy, as the controller states them (N,); None if
            it states none.
        tank: The energy tank's part of it (N,); None without a tank.
        delay_storage: V_4 (N,) with the multiplier of the design's certificate; None if nothing
            certifies the run's design.
        delay_storage_error: Bound of its error, J; None like it.
        delay_injection: ∫(τ_osc − τ_now)ᵀθ̇ (N,): the energy that delay, sampling and losses have
            put into the robot; None if the controller does not state its undelayed command.
        law_injection: ∫τ_nowᵀθ̇ + V_3 − V_3(0) (N,): what the undelayed law has given besides its
            potential; None like ``delay_injection``.
        injection_error: Bound of the error of both, J; None like them.
        joint_side: Passivity of springs, motors, links and contacts (S_j).
        controller_side: Passivity of controller and delay (S_c); None if the controller states
            no storage function.
        delay_side: Passivity of delay and damping alone: what a certificate promises, for
            coefficients that move too; None like ``delay_injection``.
        joint_port: Passivity of links and contacts alone, S_j = V_1 at (τ_sea, q̇_j), Eq. (26).
        controller_port: Passivity of springs, motors, delay and controller, S_c at (q̇_j, −τ_sea),
            Eq. (28); None if the controller states no storage function.
    """

    time: Array
    stores: dict[str, Array]
    joint_flows: dict[str, Array]
    scalar_flows: dict[str, Array]
    inertia_shaping: Array
    residual: Array
    throughput: Array
    controller_storage: Array | None
    tank: Array | None
    delay_storage: Array | None
    delay_storage_error: float | None
    delay_injection: Array | None
    law_injection: Array | None
    injection_error: float | None
    joint_side: Passivity
    controller_side: Passivity | None
    delay_side: Passivity | None
    joint_port: Passivity
    controller_port: Passivity | None

    @property
    def V_3(self) -> Array | None:
        """The task's potential (N,), J; None if the controller states none."""
        if self.controller_storage is None or self.tank is None:
            return self.controller_storage
        return self.controller_storage - self.tank

    @property
    def V_4(self) -> Array | None:
        """What delay line and energy tank store (N,), J, as the paper books it; None without a
        certificate of the run's design."""
        if self.delay_storage is None or self.tank is None:
            return self.delay_storage
        return self.delay_storage + self.tank

    @property
    def closure(self) -> float:
        """Largest residual over the run as a fraction of the final throughput.

        Where less than a millionth of the energy stored has moved, of that millionth: what is left
        is rounding of the stores.
        """
        largest = float(np.abs(self.residual).max(initial=0.0))
        moved = float(self.throughput[-1]) if self.throughput.size else 0.0
        stored = float(sum(map(np.abs, self.stores.values()), np.zeros(1)).max(initial=0.0))
        scale = max(moved, _STILL * stored)
        return largest / scale if scale > 0.0 else largest


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What a controller states about itself at the logged instants.

    Attributes:
        storage: V_3 and the tank's energy (N,), J.
        tank: The tank's energy (N,), J; None without a tank.
        work: ∫τ_now dθ of the undelayed command per joint (N, n), J.
        rough: Bound of the error of its sum, J.
    """

    storage: Array
    tank: Array | None
    work: Array
    rough: float


class UndelayedWork:
    """∫τ_now dθ of a command that is known at instants: the trapezoid in θ.

    Args:
        n: Number of joints.

    Attributes:
        command: τ_now of the present instant (n,), Nm; written by the controller.
        work: ∫τ_now dθ per joint (n,), J.
    """

    def __init__(self, n: int) -> None:
        from sealag.kernels import run

        parts = run.allocate_undelayed(n)
        self._rough, self._kept, self._carry = parts.rough, keep(parts), run.carry_work
        self.command, self.work = parts.command[2], parts.work

    @property
    def rough(self) -> float:
        """Bound of the error of the sum of the works, J: half of what the trapezoids over every two
        neighbouring intervals differ from those over one, three times their error where the motion
        is smooth."""
        return float(self._rough[0])

    def move(self, theta: Array) -> None:
        """Take the motor angles (n,) at which ``command`` holds."""
        self._carry(self._kept, theta)


class Books(NamedTuple):
    """Energies and works at the logged instants, J."""

    stores: Array  # (N, 4) as in STORES
    joint: Array  # (N, 9, n) as in JOINT_FLOWS
    scalar: Array  # (N, 5) as in SCALAR_FLOWS
    moved: Array  # (N,) sum of the absolute changes of the stores


def audit(
    *,
    store: Store,
    time: Array,
    joints: tuple[str, ...],
    books: Books,
    theta_dot: Array,
    shaped_inertia: Array,
    ratio: Array,
    stated: Stated | None,
) -> Audit:
    """Assemble the audit of a run from its logged books.

    Args:
        store: Where its arrays lie.
        time: Instants (N,), s.
        joints: Joint names.
        books: What was logged of energies and works.
        theta_dot: Motor speeds (N, n), rad/s.
        shaped_inertia: B_s (n,), kg m².
        ratio: B / B_s (n,).
        stated: What the controller states about itself; None if nothing.
    """
    stores, joint, scalar, throughput = books
    flows = {name: joint[:, k] for k, name in enumerate(JOINT_FLOWS)}
    command, damping, port = flows["command"], flows["damping"], flows["port"]
    error, shaping, slack, of_links, of_springs = (store.zeros(len(time)) for _ in range(5))
    s_0 = v_1_0 = v_2_0 = 0.0
    for rows in blocks(len(time)):
        drive = command[rows] - damping[rows]
        v_1 = stores[rows, :SPRING_STORE].sum(axis=1)
        v_2 = stores[rows, SPRING_STORE] + 0.5 * theta_dot[rows] ** 2 @ shaped_inertia
        s_j = v_1 + v_2
        if rows.start == 0:
            s_0, v_1_0, v_2_0 = s_j[0], v_1[0], v_2[0]
        given = port[rows].sum(axis=1)
        of_links[rows] = given + scalar[rows, DISTURBANCE] - (v_1 - v_1_0)
        of_springs[rows] = -given - (v_2 - v_2_0)
        error[rows] = residual(stores[rows], joint[rows], scalar[rows], stores[:1].sum())
        shaping[rows] = (flows["motor_work"][rows] - ratio * drive).sum(axis=1)
        slack[rows] = drive.sum(axis=1) + scalar[rows, DISTURBANCE] - (s_j - s_0)
        release(joint, stores, scalar, theta_dot)
    spent = float(np.abs(error).max(initial=0.0))
    moved = float(throughput[-1]) if time.size else 0.0
    tolerance = 2.0 * spent + _ROUNDING * (moved + _largest(stores))
    control = delay = injection = own = at_port = None
    if stated is not None:
        work, potential = stated.work, stated.storage
        of_law = tolerance + _ROUNDING * _largest(potential[:, None])
        injection, own, of_control, of_delay = (store.zeros(len(time)) for _ in range(4))
        for rows in blocks(len(time)):
            given = work[rows].sum(axis=1)
            injection[rows] = (command[rows] - work[rows]).sum(axis=1)
            own[rows] = given + potential[rows] - potential[:1]
            of_delay[rows] = damping[rows].sum(axis=1) - injection[rows]
            of_control[rows] = of_delay[rows] - own[rows]
            of_springs[rows] -= potential[rows] - potential[:1]
            release(joint, work)
        control = _observe(
            time, of_control, lambda row: command[row] - damping[row], joints, of_law
        )
        at_port = _observe(time, of_springs, lambda row: port[row], joints, of_law)
        delay = _observe(
            time, of_delay, lambda row: command[row] - work[row] - damping[row], joints,
            of_law + stated.rough,
        )  # fmt: skip
    return Audit(
        time=time,
        stores={name: stores[:, k] for k, name in enumerate(STORES)},
        joint_flows=flows,
        scalar_flows={name: scalar[:, k] for k, name in enumerate(SCALAR_FLOWS)},
        inertia_shaping=shaping,
        residual=error,
        throughput=throughput,
        controller_storage=None if stated is None else stated.storage,
        tank=None if stated is None else stated.tank,
        delay_storage=None,
        delay_storage_error=None,
        delay_injection=injection,
        law_injection=own,
        injection_error=None if stated is None else stated.rough,
        joint_side=_observe(
            time, slack, lambda row: damping[row] - command[row], joints, tolerance
        ),
        controller_side=control,
        delay_side=delay,
        joint_port=_observe(time, of_links, lambda row: -port[row], joints, tolerance),
        controller_port=at_port,
    )


def _largest(energies: Array) -> float:
    """Largest sum over the run of the magnitudes of energies (N, k), J."""
    sums = (np.abs(energies[rows]).sum(axis=1).max() for rows in blocks(len(energies)))
    return max(map(float, sums), default=0.0)


def _observe(
    time: Array,
    slack: Array,
    delivered: Callable[[int], Array],
    joints: tuple[str, ...],
    tolerance: float,
) -> Passivity:
    """State a side's passivity; `delivered` is the energy (n,) that it has given until a row."""
    broken = np.flatnonzero(slack < -tolerance)
    first = int(broken[0]) if broken.size else None
    return Passivity(
        slack=slack,
        passive=first is None,
        first_violation=None if first is None else float(time[first]),
        joint=None if first is None else joints[int(delivered(first).argmax())],
        tolerance=tolerance,
    )
