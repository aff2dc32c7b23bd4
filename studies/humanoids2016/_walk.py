"""One closed-loop walk: a project's [walking] section with other gains, errors and delays."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Self

import numpy as np

from humanoids2016._walk_errors import NoisySensors, SensorNoise, wrong_robot, wrong_springs
from sealag.actuation import Actuators
from sealag.delay import Delays
from sealag.design import System
from sealag.errors import InputError
from sealag.simulation import (
    Clock,
    MeasuredGait,
    Network,
    Push,
    Run,
    Scene,
    closed_loop,
)
from sealag.typing import Array
from sealag.walking import Walking
from sealag.whole_body import Measurement, TickController

TICK = 1e-3  # s, period of the central controller


def walking_of(system: System) -> Walking:
    """Return the walk of a project.

    Args:
        system: the project.

    Raises:
        InputError: it has no [walking] section.
    """
    if system.walking is None:
        raise InputError(
            f"The project {system.name} has no [walking] section; the study of a walk needs one "
            "with feet = [left, right]."
        )
    return system.walking


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkCase:
    """One walk to be simulated; the defaults are the project's robot, drives and delays.

    Attributes:
        walking: what walks where, and how.
        spring_stiffness: K of all joints, Nm/rad; None takes the project's.
        damping_scale: α, factor on the project's D_θ.
        inertia_shaping: β; None takes the project's.
        delay_scale: factor on the project's delays.
        noise: sensor errors; None for ideal sensors.
        model_error: largest relative error of the plant's masses, centres of mass, inertias and
            springs against what the controller believes.
        pushes: disturbing forces.
        seed: of noise and model errors.
        coulomb_friction: of every motor, Nm, which the controller does not know.
        torque_bandwidth: of every motor's current loop, rad/s, which it does not know either.
        physics: step of the plant, s.
        embedded: period at which the drives look for commands, s; 0 for at once.
    """

    walking: Walking
    spring_stiffness: float | None = None
    damping_scale: float = 1.0
    inertia_shaping: float | None = None
    delay_scale: float = 1.0
    noise: SensorNoise | None = None
    model_error: float = 0.0
    pushes: Sequence[Push] = ()
    seed: int = 0
    coulomb_friction: float = 0.0
    torque_bandwidth: float = np.inf
    physics: float = 1e-3
    embedded: float = 0.0

    def walks(self, **changes: Any) -> Self:
        """Return the case with another walk.

        Args:
            changes: fields of `Walking` to set otherwise.
        """
        return replace(self, walking=replace(self.walking, **changes))

    def believed(self, drives: Actuators) -> Actuators:
        """Return the drives as the controller believes them to be.

        Args:
            drives: the project's.
        """
        changes = {"motor_damping": self.damping_scale * drives.motor_damping}
        if self.spring_stiffness is not None:
            changes["spring_stiffness"] = np.full(drives.n, self.spring_stiffness)
        if self.inertia_shaping is not None:
            changes["shaped_inertia"] = self.inertia_shaping * drives.rotor_inertia
        return replace(drives, **changes)


def at_delay_scale(case: WalkCase, delays: Delays, scale: float) -> WalkCase:
    """Return a walk with longer or shorter delays, of which the controller knows the mean.

    Args:
        case: The walk.
        delays: The project's.
        scale: Factor on them.
    """
    way = 0.5 * delays.embedded.mean * scale + TICK
    options = replace(case.walking.options, embedded_delay=way)
    return replace(case, delay_scale=scale).walks(options=options)


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A simulated walk.

    Attributes:
        case: what was asked for.
        run: the simulation.
        gait: footholds, apexes and step widths against the plan.
        task: (T, n) torque that the tasks asked for at each tick of the controller, before
            feedforward of motors and springs, Nm.
    """

    case: WalkCase
    run: Run
    gait: MeasuredGait
    task: Array

    def summary(self) -> Self:
        """Drop what a table does not need, so that processes exchange little."""
        run = replace(_emptied(self.run), events=())
        gait = replace(self.gait, com=np.zeros((0, 3)))
        return replace(self, run=run, gait=gait, task=np.zeros((0, 3)))


def _emptied(value: Any) -> Any:
    """Return a value whose arrays, at any depth, have no rows."""
    if isinstance(value, np.ndarray):
        return value[:0].copy()
    if isinstance(value, dict):
        return {key: _emptied(part) for key, part in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {part.name: _emptied(getattr(value, part.name)) for part in fields(value)}
        return replace(value, **parts)
    return value


def simulate_walk(system: System, case: WalkCase | None = None) -> Walk:
    """Simulate a walk in closed loop: springs, delays, unilateral contact, no external wrench.

    Args:
        system: the project: robot, actuators and delays.
        case: what to walk; the project's [walking] section if None.

    Raises:
        InputError: no case is given and the project has no [walking] section.
    """
    case = case or WalkCase(walking=walking_of(system))
    robot, believed = system.robot, case.believed(system.actuators)
    start = case.walking.begin(robot, believed, period=TICK)
    plant, springs = robot, believed
    if case.model_error > 0.0:
        plant = wrong_robot(robot, error=case.model_error, seed=case.seed)
        springs = wrong_springs(believed, error=case.model_error, seed=case.seed)
    springs = replace(
        springs,
        coulomb_friction=springs.coulomb_friction + case.coulomb_friction,
        torque_bandwidth=np.minimum(springs.torque_bandwidth, case.torque_bandwidth),
    )
    seen: TickController = start.controller
    if case.noise is not None:
        seen = NoisySensors(seen, robot, noise=case.noise, seed=case.seed)
    asked: list[Array] = []
    run = closed_loop(
        plant,
        springs,
        _Witness(seen, start.controller.tau_task, asked),
        q=start.q,
        v=start.v,
        theta=start.theta,
        theta_dot=start.theta_dot,
        duration=case.walking.duration,
        network=Network.from_delays(system.delays.scaled(case.delay_scale)),
        clock=Clock(physics=case.physics, embedded=case.embedded, central=TICK),
        scene=Scene.of_walk(case.walking, case.pushes),
        seed=case.seed,
    )
    return Walk(
        case=case,
        run=run,
        gait=MeasuredGait.of(plant, run, case.walking),
        task=np.array(asked).reshape(-1, robot.n),
    )


class _Witness:
    """Keeps the task torque of every tick."""

    def __init__(self, seen: TickController, task: Array, asked: list[Array]) -> None:
        self._seen, self._task, self._asked = seen, task, asked

    def reset(self, t: float, measurement: Measurement) -> None:
        self._asked.clear()
        self._seen.reset(t, measurement)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        self._seen.tick(t, measurement, out)
        self._asked.append(self._task.copy())
