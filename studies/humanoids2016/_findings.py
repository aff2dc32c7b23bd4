"""What the study computes, and how much of it."""

from dataclasses import dataclass

from humanoids2016._ablation import AblationTable
from humanoids2016._beyond import SCALES, STIFFNESSES, DelayMap
from humanoids2016._central_damping import SplitDamping
from humanoids2016._claims import Claim
from humanoids2016._figure4 import Figure4
from humanoids2016._figure5 import BETAS, TorqueTrace
from humanoids2016._levels import LevelTable
from humanoids2016._live import LiveLeg
from humanoids2016._ports import PortRow, TankRow
from humanoids2016._random_table import RandomPlantTable
from humanoids2016._rotors import RATIOS, RotorTable
from humanoids2016._slow_model import PERIODS, SlowModel
from humanoids2016._task_terms import ReferenceRow, TaskTerms
from humanoids2016._torque_rate import TorqueRateRow
from humanoids2016._unsafe import UnsafeExample
from humanoids2016._walk import Walk
from humanoids2016._walk_table import WalkRow
from sealag.design import System
from sealag.passivity import Certificate
from sealag.robot import Motion


@dataclass(frozen=True, slots=True, kw_only=True)
class StudySize:
    """How much the study computes; the defaults are the page's.

    Attributes:
        rate: instants of the planned walk per second.
        plants: random plants on which both criteria meet the exact margin.
        draws: random three-joint plants with the printed stiffness ΛK_x.
        grounds: rough grounds of the success tables.
        few_grounds: rough grounds of the tables with many cases.
        held_out_steps: steps on grounds that nothing was chosen on.
        cases: how many cases of each table at most, the published law beside; None for all.
        stiffnesses: spring stiffnesses of the delay map, Nm/rad.
        scales: factors on the delays in the delay map, increasing.
        betas: values of β = B_s / B in Fig. 5.
        leg_time: of a frozen leg's runs, s.
        swing_time: of a leg's swing with coupled rotors, s.
        ratios: gear ratios of these.
        periods: of a model that is updated slowly, s; the first is its reference.
        jobs: number of processes.
    """

    rate: float = 1000.0
    plants: int = 1000
    draws: int = 200
    grounds: int = 20
    few_grounds: int = 4
    held_out_steps: int = 20
    cases: int | None = None
    stiffnesses: tuple[float, ...] = STIFFNESSES
    scales: tuple[float, ...] = SCALES
    betas: tuple[float, ...] = BETAS
    leg_time: float = 6.0
    swing_time: float = 1.0
    ratios: tuple[float, ...] = RATIOS
    periods: tuple[float, ...] = PERIODS
    jobs: int = 2


QUICK = StudySize(
    rate=20.0,
    plants=30,
    draws=10,
    grounds=1,
    few_grounds=1,
    held_out_steps=2,
    cases=2,
    stiffnesses=(350.0,),
    scales=(1.0, 6.0),
    betas=(0.5,),
    leg_time=0.4,
    swing_time=0.1,
    ratios=RATIOS[1:2],
    periods=(0.0, 0.1),
)
"""A page with few cases, in some two minutes of one core."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """All that the page shows.

    Attributes:
        system: the project: robot, gains, delays and walk.
        motion: the planned walk.
        figure: Fig. 4 over the planned walk.
        simulated: Fig. 4 over the simulated walk.
        unsafe: plants on which the published criterion is unsafe.
        table: both criteria on random plants.
        walk: the project's walk, simulated.
        robust: success with sensor and model errors.
        held_out: the same on grounds that nothing was chosen on.
        ablations: success with each means left out.
        everywhere: the same over spring stiffness, α, β and delays.
        gait: what makes the walk a gait.
        gains: success over spring stiffness, α and β.
        delays: how much delay is walked, beside the bounds.
        traces: the walks of Fig. 5.
        beyond: stairs, pushes and rougher ground.
        drives: Coulomb friction and torque bandwidth, which the controller does not know.
        bandwidth_refusal: why a finite torque bandwidth is not certified.
        levels: one priority level against two.
        damping: damping in the drive against damping in the controller.
        live: matrices for the reader's own gains.
        ports: both subsystems at the paper's own ports.
        tanks: how long the energy tank lasts.
        printed: success of the printed law on the printed task.
        slow: a model that is updated slowly.
        rotors: the error of Assumption 3.
        terms: sizes of μ and F_c.
        references: references that are functions of q̄.
        torque_rates: spring damping, and feedback of the torque's derivative.
        certificate: over the planned walk, with the bound for matrices that vary in time.
        claims: statements of the paper, checked.
    """

    system: System
    motion: Motion
    figure: Figure4
    simulated: Figure4
    unsafe: tuple[UnsafeExample, ...]
    table: RandomPlantTable
    walk: Walk
    robust: tuple[WalkRow, ...]
    held_out: tuple[WalkRow, ...]
    ablations: tuple[WalkRow, ...]
    everywhere: AblationTable
    gait: tuple[WalkRow, ...]
    gains: tuple[WalkRow, ...]
    delays: DelayMap
    traces: tuple[TorqueTrace, ...]
    beyond: tuple[WalkRow, ...]
    drives: tuple[WalkRow, ...]
    bandwidth_refusal: str
    levels: LevelTable
    damping: tuple[SplitDamping, ...]
    live: LiveLeg
    ports: tuple[PortRow, ...]
    tanks: tuple[TankRow, ...]
    printed: tuple[WalkRow, ...]
    slow: tuple[SlowModel, ...]
    rotors: RotorTable
    terms: TaskTerms
    references: tuple[ReferenceRow, ...]
    torque_rates: tuple[TorqueRateRow, ...]
    certificate: Certificate
    claims: tuple[Claim, ...]
