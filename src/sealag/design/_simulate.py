"""`sealag.simulate`: a design, or its project file, in the simulator."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sealag.design._clock import clock_of
from sealag.design._design import Design
from sealag.design._project import loaded
from sealag.design._schema import SCENARIOS
from sealag.design._system import System
from sealag.errors import InputError, either
from sealag.robot import ContactKind
from sealag.simulation import Foot, Network, Push, Run, Scene, closed_loop
from sealag.typing import Array
from sealag.units import seconds_from_ms
from sealag.walking import GroundProfile, Walking
from sealag.whole_body import TaskKind, TickController

LONGEST_RUN = 1e9
"""s."""
_SPOT_SPEED = 1e-3  # m/s


def simulate(
    project: System | str | Path,
    *,
    scenario: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    delay_scale: float = 1.0,
    log_period: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run a design's whole-body controller on the delayed robot, with contacts and energy audit.

    Scenarios: `regulate` holds the posture while the project's pushes act; `balance` does so with
    a push of 5 % of the weight for 0.1 s if the project has none, or, if the project has a
    [walking] section, by stepping on the spot on flat ground, since a biped on point feet cannot
    stand; `track` moves the first task's first row as a sinusoid; `drop` begins above the ground,
    or, with a fixed base, with springs that do not yet carry the joints; `walk` takes the steps of
    the project's [walking] section.

    Args:
        project: the design, or its project file.
        scenario: one of the five; the project's if None.
        duration: s; the project's, or the walk's, if None.
        seed: of jitter and losses; the project's if None.
        delay_scale: factor on both round trips.
        log_period: time between two logged instants, s; the project's, or the controller's period,
            if None.
        progress: called with the simulated time.

    Returns:
        The run; a fall or divergence is its named outcome.

    Raises:
        InputError: the scenario is unknown, duration, seed or delay_scale cannot be, the recording
            would not fit into the temporary folder, a push does not act during the run, a foot
            begins inside the ground, or the torque limits cannot hold the posture.
        FileError: the project file cannot be read.
    """
    system = loaded(project)
    setting = system.simulation
    kind = setting.scenario if scenario is None else scenario
    if kind not in SCENARIOS:
        raise InputError(f"The scenario is {kind!r}; it must be {either(SCENARIOS)}.")
    if seed is not None and not (isinstance(seed, int) and seed >= 0):
        raise InputError(f"The seed is {seed!r}; it must be a whole number from 0 up.")
    length = system.duration(kind) if duration is None else duration
    if not (isinstance(length, int | float) and 0.0 < length <= LONGEST_RUN):
        raise InputError(f"The duration is {length!r} s; it must be more than 0, at most 1e9 s.")
    if log_period is None and setting.log_period_ms is not None:
        log_period = seconds_from_ms(setting.log_period_ms)
    clock = replace(clock_of(system), log=log_period)
    _check_pushes(system, length)
    common = {
        "duration": length,
        "network": Network.from_delays(system.delays.scaled(delay_scale)),
        "clock": clock,
        "seed": setting.seed if seed is None else seed,
        "progress": progress,
    }
    if kind == "walk" or (kind == "balance" and system.walking is not None):
        _refuse_slow_model(system)
        walking = system.required_walking()
        walking = walking if kind == "walk" else _on_the_spot(walking)
        return _walk(system, walking, _pushes(system, kind), common)
    feet = _feet(system)
    scene = Scene(feet=feet, pushes=_pushes(system, kind))
    q = system.posture.copy()
    if system.robot.floating_base and system.contacts:
        q = scene.touching_posture(system.robot, q)
        scene.require_hold(system.robot, q, torque_limit=system.actuators.torque_limit)
    controller = _controller(system, kind, q)
    held, (q, theta) = q, _start(system, kind, q)
    run = closed_loop(
        system.robot,
        system.actuators,
        controller,
        q=q,
        theta=theta,
        scene=scene,
        **common,
    )
    return _with_delay_storage(run, system, held)


def _refuse_slow_model(system: Design) -> None:
    """A walk's law has no matrices that could be held."""
    if system.simulation.model_period_ms > 0.0:
        raise InputError(
            "simulation.model_period_ms holds the matrices of the law of [[tasks]]; the law of "
            "[walking], which this scenario runs, has none. Leave it out, or choose another "
            "scenario (regulate, track, drop)."
        )


def _start(system: Design, kind: str, held: Array) -> tuple[Array, Array | None]:
    """First configuration and motor angles: where the loop that holds a posture rests, if it does;
    for a drop above the ground, or with springs that do not yet carry the joints."""
    if kind == "drop" and not system.robot.floating_base:
        return held, system.robot.joint_positions(held)
    q = held.copy()
    if kind == "drop":
        q[2] += system.simulation.drop_height
        return q, None
    rest = replace(system, posture=held).rest()
    return (rest.q, rest.theta) if rest.found else (q, None)


def _with_delay_storage(run: Run, system: Design, q: Array) -> Run:
    """Add V_4 with the multiplier that certifies the held posture, if one does."""
    if run.audit.controller_side is None or len(run.time) < 3:
        return run
    motion = replace(system.still(), q=q[None])
    bound = system.certified_bounds(system.spaces(motion))
    delay = float(bound.delay[0])
    if not 0.0 < delay < math.inf:
        return run
    (Y,) = bound.prove(0).blocks
    stored, error = run.delay_storage(Y, delay=delay)
    audit = replace(run.audit, delay_storage=stored, delay_storage_error=error)
    return replace(run, audit=audit)


def _on_the_spot(walking: Walking) -> Walking:
    gait = replace(walking.gait, apex_speed=_SPOT_SPEED)
    return replace(walking, gait=gait, ground=GroundProfile.flat())


def _walk(system: Design, walking: Walking, pushes: Sequence[Push], common: dict[str, Any]) -> Run:
    start = walking.begin(system.robot, system.actuators, period=common["clock"].central)
    return closed_loop(
        system.robot,
        system.actuators,
        start.controller,
        q=start.q,
        v=start.v,
        theta=start.theta,
        theta_dot=start.theta_dot,
        scene=Scene.of_walk(walking, pushes),
        **common,
    )


class _Tracking:
    """A controller whose reference moves: its potential alone says nothing about passivity."""

    def __init__(self, controller: TickController) -> None:
        self.reset, self.tick = controller.reset, controller.tick


def _controller(system: Design, kind: str, q: Array) -> TickController:
    """The design's controller, holding where it stands or tracking about it."""
    slow = seconds_from_ms(system.simulation.model_period_ms)
    if kind != "track":
        return system.controller(None if system.program is not None else q, model_period=slow)
    m = system.law.levels(system.robot)[-1]
    w = 2.0 * math.pi * system.simulation.track_frequency_hz
    size, row = system.simulation.track_amplitude, np.eye(m)[0]

    def wave(t: float) -> tuple[Array, Array]:
        return size * (1.0 - math.cos(w * t)) / 2.0 * row, size * w * math.sin(w * t) / 2.0 * row

    return _Tracking(system.controller(q, reference=wave, model_period=slow))


def _feet(system: Design) -> list[Foot]:
    setting = system.simulation
    return [
        Foot(
            contact=contact,
            friction=setting.friction,
            radius=setting.foot_radius,
            torsional_damping=setting.torsional_damping,
            torsional_radius=math.inf
            if setting.torsional_radius is None
            else setting.torsional_radius,
            half_length=setting.foot_half_length if contact.kind is ContactKind.SURFACE else 0.0,
            half_width=setting.foot_half_width if contact.kind is ContactKind.SURFACE else 0.0,
        )
        for contact in system.contacts
    ]


def _pushes(system: Design, kind: str) -> list[Push]:
    pushes = [
        Push(
            frame=push.frame,
            force=(push.force_n[0], push.force_n[1], push.force_n[2]),
            start=push.start_s,
            duration=push.duration_s,
        )
        for push in system.simulation.pushes
    ]
    if kind == "balance" and not pushes:
        frames = [t.frame for t in system.law.tasks if t.frame and t.kind is not TaskKind.COM]
        frame = frames[0] if frames else system.robot.joints[-1]
        force = 0.05 * system.robot.weight
        pushes = [Push(frame=frame, force=(force, 0.0, 0.0), start=0.2, duration=0.1)]
    return pushes


def _check_pushes(system: Design, length: float) -> None:
    """Refuse pushes of the project that would not act."""
    for push in system.simulation.pushes:
        if push.start_s >= length:
            raise InputError(
                f"The push on {push.frame} begins at {push.start_s:g} s, but the run ends at "
                f"{length:g} s; push earlier or simulate longer."
            )
