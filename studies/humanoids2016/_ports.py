"""Both subsystems at the paper's own ports, the energy tank as printed, and Theorem 1's θ̇."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanoids2016._claims import Claim, Verdict
from humanoids2016._leg_loop import WILD, Fed, Leg, LegRun, Push, TankSetting, run_leg
from humanoids2016._live import LiveLeg
from humanoids2016._random_plants import random_sea_plant
from sealag.passivity import Instant, Problem, solve
from sealag.typing import Array
from sealag.whole_body import MotorAngles, StiffnessForm

NEAR = 0.998
"""Share of a bound at which legs run: a multiplier of V_4 needs room for rounding."""
ENDLESS = 1e3
"""J: a leg that is given more than this by its controller moves without end."""
FORCE = 10.0  # Nm, of the pushes
PULL = np.array([5.0, 5.0, 10.0, 2.0, 2.0, 5.0])
"""Diagonal of K_b in 1/s, chosen: a matrix whose rows differ, as (22) has one."""
ENERGIES = (0.2, 2.0, 20.0, 200.0)  # J
THRESHOLDS = (1e-1, 1e-4)  # J^½, ε of (21)
UNSAFE_PLANT = 11
"""Seed of a three-joint plant with ΛK_x as printed that (29) allows 69 ms, unstable without any."""
ONE_JOINT = Leg(
    name="one joint, K_q = 300 Nm/rad", M=np.full((1, 1), 5.0), K=np.full(1, 350.0),
    B_s=np.full(1, 0.09), D=np.full(1, 10.0), J=np.eye(1), S=np.full((1, 1), 300.0),
)  # fmt: skip
TRACKED = 1e-3
"""Share of the motion by which x̂ may be away from x(q̄) and still track it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PortRow:
    """Both observers at the paper's ports, over one run.

    Attributes:
        leg: what ran.
        fed: what was fed back.
        push: the push.
        delay_s: d, s.
        near_bound: whether d is that of (29), all but `NEAR`; else it is the design's own.
        tolerance: error of the works, J.
        joint_drop: largest loss of slack of S_j = V_1 at (Γ_sea, q̇_j) between two instants, J.
        controller_drop: the same of S_c at (q̇_j, −Γ_sea), J; where the stiffness has no potential,
            of its symmetric part's.
        given: most that the controller's side had given through its port, J.
        fastest: largest motor speed, rad/s.
        speed_bound: Theorem 1's bound of it, rad/s.
        potential: whether the law has a storage function.
        duration: of the run, s, if it does not end before.
    """

    leg: str
    fed: Fed
    push: str
    delay_s: float
    near_bound: bool
    tolerance: float
    joint_drop: float
    controller_drop: float
    given: float
    fastest: float
    speed_bound: float
    potential: bool
    duration: float

    @property
    def joint_passive(self) -> bool:
        """Whether S_j never rose by more than its supply."""
        return self.joint_drop <= self.tolerance

    @property
    def controller_passive(self) -> bool:
        """Whether S_c never did."""
        return self.controller_drop <= self.tolerance

    @property
    def bounded(self) -> bool:
        """Whether θ̇ stayed within Theorem 1's bound."""
        return self.fastest <= self.speed_bound


@dataclass(frozen=True, slots=True, kw_only=True)
class TankRow:
    """One tank over one run.

    Attributes:
        flow: what it pays for.
        push: the push.
        delay_s: d, s.
        energy: E_s at the start, J.
        threshold: ε, J^½.
        emptied: when s ≤ ε first, s; None if never.
        astray: largest |x̂ − x(q̄)| as a share of the largest |x(q̄)|.
        rise: largest rise of V, J.
        tolerance: error of V, J.
        duration: of the run, s.
    """

    flow: Fed
    push: str
    delay_s: float
    energy: float
    threshold: float
    emptied: float | None
    astray: float
    rise: float
    tolerance: float
    duration: float


def stance_legs(live: LiveLeg) -> tuple[Leg, Leg]:
    """Return the stance leg where (29) is smallest, with Λ^½ K_x Λ^½ and with ΛK_x as printed.

    Args:
        live: the leg along the walk.
    """
    legs = []
    for M, J, Lambda in zip(live.mass, live.J_star, live.Lambda, strict=True):
        values, V = np.linalg.eigh(Lambda)
        root = (V * np.sqrt(np.clip(values, 0.0, None))) @ V.T
        K_x = np.diag(live.gains)
        leg = Leg(
            name="stance leg, symmetric stiffness", M=M, K=live.spring_stiffness,
            B_s=live.inertia_shaping * live.rotor_inertia, D=live.motor_damping, J=J,
            S=root @ K_x @ root,
        )  # fmt: skip
        printed = replace(leg, name="stance leg, ΛK_x as printed", S=Lambda @ K_x)
        legs.append((_bound(printed), leg, printed))
    return min(legs, key=lambda one: one[0])[1:]


def _bound(leg: Leg) -> float:
    """Largest delay of (29), s."""
    return float(solve(Problem.of_stiffness(leg.F, leg.D), share=Instant()).delay)


def _proven(leg: Leg) -> tuple[float, Array]:
    """A delay just below that of (29), s, and the multiplier Q (m, m) that proves it."""
    bound = solve(Problem.of_stiffness(leg.F, leg.D), share=Instant()).eased(NEAR).prove()
    (W,) = bound.blocks
    inverse = np.linalg.pinv(leg.J)
    delay = float(bound.delay)
    return delay, inverse.T @ W @ inverse / delay


def _pushes(leg: Leg) -> tuple[Push, Push]:
    force = np.full(len(leg.K), FORCE)
    return (
        Push(name="push of 0.2 s", force=force, frequency=np.pi / 0.2, end=0.2),
        Push(name="push without end", force=force, frequency=3.0, end=np.inf),
    )


def port_table(live: LiveLeg, *, duration: float = 6.0) -> tuple[PortRow, ...]:
    """Observe both subsystems for every signal, at the bound of (29) and at the design's delay.

    Args:
        live: the leg along the walk.
        duration: of each run, s.
    """
    leg, printed = stance_legs(live)
    plant = random_sea_plant(
        UNSAFE_PLANT, joints=3, form=StiffnessForm.PUBLISHED, signal=MotorAngles.name
    )
    unsafe = Leg(
        name="three joints, ΛK_x as printed", M=plant.M, K=plant.K, B_s=plant.B_s, D=plant.D_theta,
        J=plant.J, S=plant.Lambda @ np.diag(plant.K_x),
    )  # fmt: skip
    cases = [(leg, fed) for fed in Fed]
    cases += [(printed, Fed.MOTOR), (unsafe, Fed.MOTOR), (ONE_JOINT, Fed.STATIC)]
    return tuple(
        row for case in cases for row in _port_rows(*case, own=live.delay, duration=duration)
    )


def _port_rows(leg: Leg, fed: Fed, *, own: float, duration: float) -> Iterator[PortRow]:
    near, multiplier = _proven(leg)
    symmetric = bool(np.allclose(leg.F, leg.F.T, rtol=1e-9, atol=1e-9 * np.abs(leg.F).max()))
    multiplier = leg.S if symmetric else multiplier
    tank = TankSetting(energy=ENERGIES[1], threshold=THRESHOLDS[-1], pull=PULL[: len(leg.S)])
    for delay in sorted({min(own, near), near}):
        for push in _pushes(leg):
            run = run_leg(
                leg, fed, push, delay=delay, duration=duration, multiplier=multiplier,
                tank=tank if fed.tank else None,
            )  # fmt: skip
            yield PortRow(
                leg=leg.name, fed=fed, push=push.name, delay_s=delay, near_bound=delay == near,
                tolerance=run.tolerance, joint_drop=_drop(run.joint_slack),
                controller_drop=_drop(run.controller_slack), given=float(-run.port.min()),
                fastest=run.fastest, speed_bound=run.speed_bound, potential=symmetric,
                duration=duration,
            )  # fmt: skip


def _drop(slack: Array) -> float:
    """Largest fall of a slack below an earlier value."""
    return float((np.maximum.accumulate(slack) - slack).max())


def tank_table(live: LiveLeg, *, duration: float = 6.0) -> tuple[TankRow, ...]:
    """Run the tank with both flows, at two delays, over its energy and ε.

    Args:
        live: the leg along the walk.
        duration: of each run, s.
    """
    leg, _ = stance_legs(live)
    near, _ = _proven(leg)
    found = []
    for delay in (live.delay, near):
        for flow in (Fed.TANK_PUBLISHED, Fed.TANK_CORRECTED):
            for push in _pushes(leg):
                for energy in ENERGIES:
                    for threshold in THRESHOLDS:
                        tank = TankSetting(energy=energy, threshold=threshold, pull=PULL)
                        run = run_leg(
                            leg, flow, push, delay=delay, duration=duration, tank=tank, step=1e-3
                        )
                        found.append(_tank_row(run, flow, push, delay, tank))
    return tuple(found)


def _tank_row(run: LegRun, flow: Fed, push: Push, delay: float, tank: TankSetting) -> TankRow:
    return TankRow(
        flow=flow, push=push.name, delay_s=delay, energy=tank.energy, threshold=tank.threshold,
        emptied=float(run.time[run.empty.argmax()]) if run.empty.any() else None,
        astray=run.astray, rise=run.rise, tolerance=run.tolerance, duration=float(run.time[-1]),
    )  # fmt: skip


def port_claims(ports: Sequence[PortRow], tanks: Sequence[TankRow]) -> tuple[Claim, ...]:
    """Check what the paper says of its subsystems, θ̇, x̂ and the tank.

    Args:
        ports: both observers.
        tanks: the tanks.
    """
    return (
        _subsystems_claim(ports),
        _speed_claim(ports),
        _tracking_claim(tanks),
        _threshold_claim(tanks),
    )


def _subsystems_claim(ports: Sequence[PortRow]) -> Claim:
    active = [row for row in ports if not row.controller_passive]
    each = dict.fromkeys(f"{row.leg}, {row.fed} fed back" for row in active)
    worst = {
        name: max(r.controller_drop for r in active if f"{r.leg}, {r.fed} fed back" == name)
        for name in each
    }
    return Claim(
        key="subsystems",
        source="Section IV-B, (25)–(28), Fig. 3",
        published="The joint side (S_j = V_1, Γ_sea → q̇_j) and the controller's side (S_c = V_2 + "
        "V_3 + V_4, q̇_j → −Γ_sea) are passive, each by itself.",
        computed=(
            f"Observers of both over {len(ports)} runs of a leg, at the design's delay and at the "
            f"bound of (29). The joint side was passive in {sum(r.joint_passive for r in ports)}, "
            f"the controller's side in {len(ports) - len(active)}; S_c rose without supply by "
            + "; ".join(f"{_energy(drop)} ({name})" for name, drop in worst.items())
            + "."
        ),
        verdict=Verdict.of(row.joint_passive and row.controller_passive for row in ports),
        tolerance="neither storage rises above its supply between any two instants, beyond a "
        "ten-thousandth of the energy moved",
    )


def _energy(drop: float) -> str:
    return f"{drop:.2g} J" if drop < ENDLESS else "more and more"


def _speed(row: PortRow) -> str:
    return f"{row.fastest:.2g}" if row.fastest < 0.9 * WILD else "without end"


def _time(rows: Sequence[PortRow] | Sequence[TankRow]) -> str:
    return f"{max(row.duration for row in rows):.2g} s"


def _speed_claim(ports: Sequence[PortRow]) -> Claim:
    near = [row for row in ports if row.near_bound]
    wild = [row for row in near if not row.bounded]
    tame = [row.fastest / row.speed_bound for row in near if row.bounded]
    each = "; ".join(
        f"{row.leg}, {row.fed}, {row.push}: {_speed(row)} against {row.speed_bound:.2g} rad/s"
        for row in wild
    )
    return Claim(
        key="motor speed",
        source="Section IV-B, Theorem 1",
        published="If (29) holds, the motor velocity θ̇ is bounded.",
        computed=(
            f"V bounds it: ½θ̇ᵀB_sθ̇ ≤ V(0) + work of the push. At {NEAR:g} of the delay of (29) "
            f"{len(tame)} of {len(near)} runs stay below, at most {max(tame, default=0.0):.0%} of "
            f"that. Not so: {each or 'none'}."
        ),
        verdict=Verdict.of(row.bounded for row in near),
        tolerance=f"|θ̇| below V's bound for {_time(near)} in every run at the bound of (29)",
    )


def _tracking_claim(tanks: Sequence[TankRow]) -> Claim:
    full = [row for row in tanks if row.emptied is None]
    spent = [row for row in tanks if row.emptied is not None]
    return Claim(
        key="x hat",
        source="Section IV-A, (18), (22)",
        published="x̂ tracks x(q̄(θ)) while passivity is kept.",
        computed=(
            f"With v_1 and the matrix K_b of (22), |x̂ − x| over the largest |x| is at most "
            f"{max((row.astray for row in full), default=0.0):.1e} in the {len(full)} runs whose "
            f"tank never empties, and {min((row.astray for row in spent), default=0.0):.0%} to "
            f"{max((row.astray for row in spent), default=0.0):.0%} in the {len(spent)} others."
        ),
        verdict=Verdict.of(row.astray < TRACKED for row in tanks),
        tolerance=f"|x̂ − x| below {TRACKED:g} of the largest |x| over {_time(tanks)}",
    )


def _threshold_claim(tanks: Sequence[TankRow]) -> Claim:
    least, most = min(THRESHOLDS), max(THRESHOLDS)
    small = [row for row in tanks if row.threshold == least]
    large = [row for row in tanks if row.threshold == most]
    pairs = [
        (a.emptied, b.emptied)
        for a, b in zip(small, large, strict=True)
        if a.emptied is not None and b.emptied is not None
    ]
    later = max((a - b for a, b in pairs), default=0.0)
    never = [row for row in small if row.emptied is None]
    kept = ", ".join(
        f"{sum(r.emptied is None for r in small if r.energy == E)} with {E:g} J" for E in ENERGIES
    )
    return Claim(
        key="tank",
        source="Section IV-A, after (22)",
        published="With ε close enough to zero the energy tank is never empty.",
        computed=(
            f"With ε = {least:g} the tank lasts in {len(never)} of {len(small)} runs ({kept}), "
            f"with ε = {most:g} in {sum(row.emptied is None for row in large)}; where it empties, "
            f"the smaller ε gains at most {later * 1e3:.0f} ms. What decides is E_s(0) against "
            "½d̄∫(x̂̇ᵀQx̂̇ − v_2ᵀQv_2)dt, which has no end while the robot is pushed."
        ),
        verdict=Verdict.of(row.emptied is None for row in small),
        tolerance=f"s > ε for {_time(tanks)} in every run with the smallest ε",
    )
