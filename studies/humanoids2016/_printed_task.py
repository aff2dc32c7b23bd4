"""The printed law on the printed task: 6-D CoM and orientation, walked as planned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from humanoids2016._walk import TICK, Walk, WalkCase, walking_of
from humanoids2016._walk_table import WalkRow
from sealag.design import System, load
from sealag.robot import Contact, ContactKind, Motion
from sealag.simulation import Clock, MeasuredGait, Network, Scene, closed_loop
from sealag.typing import Array
from sealag.walking import Ground, WalkPlan
from sealag.whole_body import (
    Controller,
    GravityCompensation,
    Law,
    Measurement,
    MotorAngles,
    Signal,
    StaticJoint,
    StiffnessForm,
    Task,
    TaskKind,
)
from sealag.workers import in_parallel

SWING_STIFFNESS = 100.0
"""1/s² of the swing foot below the printed task, where it has one; with 400, as in the walk above,
q̄(θ) does not exist on springs of 350 Nm/rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedCase:
    """One way to walk on the printed task.

    Attributes:
        swing: whether the swing foot follows its plan on a second level; the paper says nothing
            of the swing leg.
        signal: what is fed back.
        delayed: whether the paper's delays act.
        damping_scale: α.
        spring_stiffness: K of all joints, Nm/rad; None takes the project's.
    """

    swing: bool = True
    signal: Signal = field(default_factory=StaticJoint)
    delayed: bool = True
    damping_scale: float = 1.0
    spring_stiffness: float | None = None

    def of(self, system: System) -> System:
        """Return Hume with the case's drives.

        Args:
            system: Hume with the paper's gains.
        """
        drives = system.actuators
        K = drives.spring_stiffness
        if self.spring_stiffness is not None:
            K = np.full(drives.n, self.spring_stiffness)
        damping = self.damping_scale * drives.motor_damping
        return replace(system, actuators=replace(drives, motor_damping=damping, spring_stiffness=K))


CASES: Mapping[str, PrintedCase] = {
    "(17) as printed, nothing for the swing foot": PrintedCase(swing=False),
    "(17), swing foot below": PrintedCase(),
    "(17), swing foot below, K = 1000": PrintedCase(spring_stiffness=1000.0),
    "(11) with x(θ), swing foot below": PrintedCase(signal=MotorAngles()),
    "(11) with x(θ), swing foot below, α = 0.1, K = 1000, no delay": PrintedCase(
        signal=MotorAngles(), delayed=False, damping_scale=0.1, spring_stiffness=1000.0
    ),
}


class PrintedTask:
    """Eqs. (11), (17) with plain D_θ θ̇ along a planned walk; the support is the planned one."""

    def __init__(self, system: System, motion: Motion, case: PrintedCase) -> None:
        """Prepare a law for each support.

        Args:
            system: Hume with the paper's gains; its tasks are the printed ones.
            motion: the plan.
            case: how to walk.
        """
        self._motion, self._running = motion, -1
        self._laws = [self._controller(system, contacts, case) for contacts in motion.contact_sets]

    def _controller(
        self, system: System, contacts: Sequence[Contact], case: PrintedCase
    ) -> Controller:
        robot, motion = system.robot, self._motion
        feet = walking_of(system).feet
        swing = next(foot for foot in feet if foot != contacts[0].frame)
        tasks = system.law.tasks
        if case.swing:
            below = Task(
                name="swing foot", kind=TaskKind.POSITION, frame=swing, priority=2,
                stiffness=np.array(SWING_STIFFNESS),
            )  # fmt: skip
            tasks = (*tasks, below)
        law = Law(
            tasks=tasks, signal=case.signal, stiffness_form=StiffnessForm.PUBLISHED,
            gravity=GravityCompensation.FEEDBACK, velocity_feedforward=False,
        )  # fmt: skip
        at = robot.workspace()
        wanted = np.zeros((len(motion), 9 if case.swing else 6))
        for k, q in enumerate(motion.q):
            at.update(q, motion.v[k])
            wanted[k, :3] = at.com
            if case.swing:
                wanted[k, 6:] = at.frame_placement(swing)[1]
        wanted -= wanted[0]

        def reference(t: float) -> tuple[Array, Array]:
            k = min(int(np.searchsorted(motion.time, t, "right")), len(motion)) - 1
            return wanted[k], np.zeros(wanted.shape[1])

        return Controller(
            robot, law, system.actuators, contacts=tuple(contacts), posture=motion.q[0],
            reference=reference,
        )  # fmt: skip

    def reset(self, t: float, measurement: Measurement) -> None:
        """Begin.

        Args:
            t: first instant, s.
            measurement: the state then.
        """
        self._running = self._support(t)
        self._laws[self._running].reset(t, measurement)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Compute the command with the law of the planned support.

        Args:
            t: the controller's clock, s.
            measurement: the newest measurement.
            out: (n,) command, Nm.
        """
        support = self._support(t)
        if support != self._running:
            self._running = support
            self._laws[support].reset(t, measurement)
        self._laws[support].tick(t, measurement, out)

    def _support(self, t: float) -> int:
        k = min(int(np.searchsorted(self._motion.time, t, "right")), len(self._motion)) - 1
        return int(self._motion.contact_index[max(k, 0)])


def printed_plan(system: System, ground: Ground) -> Motion:
    """Plan the paper's walk over a ground, one stance foot at a time.

    Args:
        system: Hume with a [walking] section.
        ground: the ground.
    """
    walking = walking_of(system)
    plan = WalkPlan.over(ground, steps=walking.steps, com_height=walking.gait.com_height)
    motion = plan.motion(system.robot, rate=1.0 / TICK, feet=walking.feet)
    return replace(motion, contact_sets=tuple(_points(one) for one in motion.contact_sets))


def printed_walk(system: System, ground: Ground, motion: Motion, case: PrintedCase) -> Walk:
    """Simulate the printed law on the printed task over a ground.

    Args:
        system: Hume with the paper's gains.
        ground: the ground.
        motion: the plan over it.
        case: how to walk.
    """
    walking = replace(walking_of(system), ground=ground)
    system = case.of(system)
    drives = system.actuators
    q = motion.q[0].copy()
    foot = motion.contact_sets[int(motion.contact_index[0])][0].frame
    place = system.robot.frame_placement(foot, q)[1]
    height = ground.height(float(place[0]), float(place[1]))
    q[2] += height + walking.gait.foot_radius - place[2]
    held = replace(
        system, posture=q, contacts=motion.contact_sets[int(motion.contact_index[0])],
        law=replace(system.law, gravity=GravityCompensation.FEEDBACK),
    )  # fmt: skip
    carried = held.spaces().gravity[0] / drives.spring_stiffness
    run = closed_loop(
        system.robot, drives, PrintedTask(system, motion, case), q=q, v=motion.v[0],
        theta=system.robot.joint_positions(q) + carried,
        theta_dot=system.robot.joint_velocities(motion.v[0]), duration=walking.duration,
        network=Network.from_delays(system.delays.scaled(1.0 if case.delayed else 0.0)),
        clock=Clock(physics=1e-3, central=TICK), scene=Scene.of_walk(walking),
    )  # fmt: skip
    return Walk(
        case=WalkCase(walking=walking), run=run,
        gait=MeasuredGait.of(system.robot, run, walking), task=np.zeros((0, system.robot.n)),
    )  # fmt: skip


def _points(contacts: Sequence[Contact]) -> tuple[Contact, ...]:
    return tuple(Contact(frame=one.frame, kind=ContactKind.POINT) for one in contacts)


def printed_rows(
    grounds: Sequence[Ground], *, project: str = "bundled:hume", jobs: int = 1
) -> tuple[WalkRow, ...]:
    """Walk every case over every ground.

    Args:
        grounds: the grounds.
        project: Hume with the paper's gains; each process loads it.
        jobs: number of processes.
    """
    each = list(in_parallel(_all, [(project, ground) for ground in grounds], jobs=jobs))
    return tuple(WalkRow.of(name, [walks[k] for walks in each]) for k, name in enumerate(CASES))


def _all(project: str, ground: Ground) -> list[Walk]:
    system = load(project)
    motion = printed_plan(system, ground)
    return [printed_walk(system, ground, motion, case).summary() for case in CASES.values()]
