"""Hume walks: one closed-loop walk over rough ground, and whether its gait is a gait."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from humanoids2016._walk_errors import NoisySensors, SensorNoise, wrong_robot, wrong_springs
from sealag.delay import Delays
from sealag.design import System, Walking, walk_scene
from sealag.robot import Robot, Workspace
from sealag.simulation import (
    Clock,
    EventKind,
    Network,
    Outcome,
    Push,
    Run,
    closed_loop,
)
from sealag.typing import Array
from sealag.walking import (
    Terrain,
    WalkingController,
    WalkingGait,
    WalkingOptions,
    begin_walk,
    paper_terrain,
)
from sealag.whole_body import Measurement, TickController

TICK = 1e-3  # s, period of the central controller
FEET = ("left_foot", "right_foot")
SPEED_TOLERANCE = 0.20
WIDTH_TOLERANCE = 0.25
SETTLING = 2  # steps after which the gait counts
_SIDE = (1.0, -1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkCase:
    """One walk to be simulated; the defaults are the bundled project and the paper's delays.

    Attributes:
        terrain: The ground.
        gait: The plan.
        options: Means of the controller.
        steps: How many steps the walk shall have.
        spring_stiffness: K of all joints, Nm/rad; None takes the project's.
        damping_scale: α, factor on the project's D_θ.
        inertia_shaping: β; None takes the project's.
        delay_scale: Factor on the project's delays.
        friction: Coulomb coefficient of the feet, an assumption.
        noise: Sensor errors, None for ideal sensors.
        model_error: Largest relative error of the plant's masses, centres of mass, inertias and
            springs against what the controller believes.
        pushes: Disturbing forces.
        seed: Of noise and model errors.
        physics: Step of the plant, s.
        embedded: Period at which the drives look for commands, s; 0 for at once.
        log_period: Between logged instants, s.
    """

    terrain: Terrain = field(default_factory=paper_terrain)
    gait: WalkingGait = field(default_factory=WalkingGait)
    options: WalkingOptions = field(default_factory=WalkingOptions)
    steps: int = 7
    spring_stiffness: float | None = None
    damping_scale: float = 1.0
    inertia_shaping: float | None = None
    delay_scale: float = 1.0
    friction: float = 0.8
    noise: SensorNoise | None = None
    model_error: float = 0.0
    pushes: Sequence[Push] = ()
    seed: int = 0
    physics: float = 1e-3
    embedded: float = 0.0
    log_period: float = 1e-3


def at_delay_scale(case: WalkCase, delays: Delays, scale: float) -> WalkCase:
    """Return a walk with longer or shorter delays, of which the controller knows the mean.

    Args:
        case: The walk.
        delays: The project's.
        scale: Factor on them.
    """
    way = 0.5 * delays.embedded.mean * scale + TICK
    return replace(case, delay_scale=scale, options=replace(case.options, embedded_delay=way))


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A simulated walk and its gait.

    Attributes:
        case: What was asked for.
        run: The simulation.
        touchdown: (S + 1,) instants of the footholds, the first is the start, s.
        foot: (S + 1,) 0 left, 1 right.
        place: (S + 1, 3) footholds, m.
        apex_time: (A,) instants at which the CoM passes over the stance foot, s.
        apex_speed: (A,) forward speed of the CoM then, m/s.
        apex_step: (A,) which foothold was stood on.
        step_width: (S,) distance of successive footholds across, positive when not crossed, m.
        com: (N, 3) CoM at the logged instants, m.
        task: (T, n) torque that the tasks asked for at each tick of the controller, before
            feedforward of motors and springs, Nm.
    """

    case: WalkCase
    run: Run
    touchdown: Array
    foot: Array
    place: Array
    apex_time: Array
    apex_speed: Array
    apex_step: Array
    step_width: Array
    com: Array
    task: Array

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return len(self.step_width)

    @property
    def walked(self) -> bool:
        """Whether all steps were taken without a fall."""
        return self.run.outcome == Outcome.COMPLETED and self.steps >= self.case.steps

    @property
    def speed_deviation(self) -> float:
        """Largest relative deviation of the apex speeds from the plan after the second step.

        NaN if there are no later ones.
        """
        return _deviation(self.apex_speed[self.apex_step >= SETTLING], self.case.gait.apex_speed)

    @property
    def width_deviation(self) -> float:
        """Largest relative deviation of the step widths from the plan after the second step.

        NaN if there are no later ones.
        """
        return _deviation(self.step_width[SETTLING:], self.case.gait.step_width)

    @property
    def is_gait(self) -> bool:
        """Whether it walked, with apex speeds within 20 % and step widths within 25 %."""
        good = self.speed_deviation <= SPEED_TOLERANCE and self.width_deviation <= WIDTH_TOLERANCE
        return self.walked and good

    @property
    def cause(self) -> str:
        """How it ended, in words."""
        if self.walked:
            return "walked"
        if self.run.outcome == Outcome.COMPLETED:
            return f"only {self.steps} steps in time"
        return f"{self.run.outcome.value} after {self.steps} steps: {self.run.message}"


def simulate_walk(system: System, case: WalkCase | None = None) -> Walk:
    """Simulate a walk in closed loop: springs, delays, unilateral contact, nothing else.

    Args:
        system: The project: robot, actuators and delays.
        case: What to walk.
    """
    case = case or WalkCase()
    believed, robot = system.actuators, system.robot
    believed = replace(believed, motor_damping=case.damping_scale * believed.motor_damping)
    if case.spring_stiffness is not None:
        stiffness = np.full(believed.n, case.spring_stiffness)
        believed = replace(believed, spring_stiffness=stiffness)
    if case.inertia_shaping is not None:
        shaped = case.inertia_shaping * believed.rotor_inertia
        believed = replace(believed, shaped_inertia=shaped)
    controller, q, v, theta = begin_walk(
        robot, believed, case.terrain, feet=FEET, gait=case.gait, options=case.options
    )
    plant, springs = robot, believed
    if case.model_error > 0.0:
        plant = wrong_robot(robot, error=case.model_error, seed=case.seed)
        springs = wrong_springs(believed, error=case.model_error, seed=case.seed)
    seen = controller
    if case.noise is not None:
        seen = NoisySensors(controller, robot, noise=case.noise, seed=case.seed)
    asked: list[Array] = []
    run = closed_loop(
        plant,
        springs,
        _Witness(seen, controller, asked),
        q=q,
        v=v,
        theta=theta,
        theta_dot=v[-robot.n :],
        duration=_walking(case).duration,
        network=Network.from_delays(system.delays.scaled(case.delay_scale)),
        clock=Clock(physics=case.physics, embedded=case.embedded, central=TICK),
        scene=walk_scene(_walking(case), case.pushes),
        seed=case.seed,
        log_period=case.log_period,
    )
    return measure_walk(plant, run, case, task=np.array(asked).reshape(-1, robot.n))


class _Witness:
    """Keeps the task torque of every tick."""

    def __init__(
        self, seen: TickController, controller: WalkingController, asked: list[Array]
    ) -> None:
        self._seen, self._controller, self._asked = seen, controller, asked

    def reset(self, t: float, measurement: Measurement) -> None:
        self._asked.clear()
        self._seen.reset(t, measurement)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        self._seen.tick(t, measurement, out)
        self._asked.append(self._controller.tau_task.copy())


def _walking(case: WalkCase) -> Walking:
    return Walking(
        feet=FEET,
        steps=case.steps,
        friction=case.friction,
        terrain=case.terrain,
        gait=case.gait,
        options=case.options,
    )


def measure_walk(robot: Robot, run: Run, case: WalkCase, *, task: Array) -> Walk:
    """Find footholds, apexes and step widths in a run.

    A foothold is where the foot that was in the air touches down; the apex is where the CoM
    passes over the foot that touched down last.

    Args:
        robot: The robot that walked.
        run: The simulation.
        case: What was asked for.
        task: Task torque of every tick (T, n), Nm.
    """
    at, names = robot.workspace(), tuple(dict.fromkeys(run.feet))
    com = np.array([at.center_of_mass(q) for q in run.q])
    first = int(run.contact_mode[0].argmax())
    times, foot = [0.0], [first]
    for event in run.events:
        f = names.index(event.foot)
        late = event.time - times[-1] > 0.3 * case.gait.step_time
        if event.kind == EventKind.TOUCHDOWN and f != foot[-1] and late:
            times.append(event.time)
            foot.append(f)
    index = np.minimum(np.searchsorted(run.time, times), len(run.time) - 1)
    place = np.array([robot.frame_placement(names[f], run.q[i])[1] for i, f in zip(index, foot)])
    side = np.array([_SIDE[f] for f in foot[1:]])
    stood = np.searchsorted(np.array(times), run.time, side="right") - 1
    ahead = com[:, 0] - place[stood, 0]
    same = stood[1:] == stood[:-1]
    apex = np.flatnonzero(same & (ahead[:-1] <= 0.0) & (ahead[1:] > 0.0))
    return Walk(
        case=case,
        run=run,
        touchdown=np.array(times),
        foot=np.array(foot),
        place=place,
        apex_time=run.time[apex],
        apex_speed=np.array([_forward_speed(at, run.q[i], run.v[i]) for i in apex]),
        apex_step=stood[apex],
        step_width=side * np.diff(place[:, 1]),
        com=com,
        task=task,
    )


def _deviation(values: Array, planned: float) -> float:
    return float(np.abs(values / planned - 1.0).max()) if len(values) else float("nan")


def _forward_speed(at: Workspace, q: Array, v: Array) -> float:
    at.update(q, v)
    return float(at.com_velocity[0])
