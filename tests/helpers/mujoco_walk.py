"""The walk with MuJoCo as the plant: its dynamics, its actuator delay, plain queues for the rest.

Only the controller is sealag's. Feet are held by connect equalities, switched on by a plastic
impact where a foot reaches the ground, and off where the ground would have to pull.
"""

from collections import deque
from dataclasses import dataclass
from enum import Enum

import mujoco
import numpy as np

from helpers.mujoco_sea import MujocoRobot
from humanoids2016 import WalkCase
from sealag.design import System
from sealag.whole_body import Measurement

TICK = 1e-3
RADIUS = 1e-4
LIFTED = 1e-6  # m: a sliding foot that high has left the ground
SLOW = 1e-3  # m/s: no impact below it, and a slip keeps its direction
GRAZED = 2e-3  # s: a shorter contact is a graze, not a step
LONGEST = 0.03  # s, of the way to the motors
FEET = ("left_foot", "right_foot")


class Queue:
    """Packets in order, each late by the delay at the instant it was sent."""

    def __init__(self, delay, first):
        self.delay, self.on_the_way, self.newest = delay, deque(), first

    def send(self, t, packet):
        self.on_the_way.append((t + self.delay(t), packet))

    def receive(self, t):
        while self.on_the_way and self.on_the_way[0][0] <= t + 1e-9:
            self.newest = self.on_the_way.popleft()[1]
        return self.newest


@dataclass
class MujocoWalk:
    """What the twin saw at every tick, and from when to when each foot stood."""

    q: np.ndarray
    theta: np.ndarray
    contacts: list[tuple[str, float, float]]

    def touchdowns(self, step_time: float) -> np.ndarray:
        """Instants at which the foot that was in the air came down and stayed (s), and 0."""
        times, last = [0.0], FEET[1]
        for foot, begin, end in sorted(self.contacts, key=lambda contact: contact[1]):
            later = begin - times[-1] > 0.3 * step_time
            if foot != last and later and end - begin > GRAZED:
                times.append(begin)
                last = foot
        return np.array(times)


class Mode(Enum):
    """What a foot does."""

    OPEN = 0
    STICK = 1
    SLIDE = 2


class _Feet:
    """Both feet of a MuJoCo robot on a terrain: rigid, plastic, dry friction.

    A sticking foot hangs on a connect equality; a sliding one stands on a plane without friction
    and is pulled back by the friction of the last step's load. Impacts are solved by projected
    Gauss-Seidel.
    """

    def __init__(self, twin: MujocoRobot, case: WalkCase):
        walking = case.walking
        self.twin, self.ground, self.friction = twin, walking.ground, walking.friction
        self.radius = walking.gait.foot_radius
        m = twin.model
        self.site = [m.site(f).id for f in FEET]
        self.plane = [m.geom("ground_" + f).id for f in FEET]
        self.equality = [m.equality(f).id for f in FEET]
        self.anchor = [m.site("anchor_" + f).id for f in FEET]
        self.mode = [Mode.OPEN, Mode.OPEN]
        self.changed = self.held = [False, False]
        self.axes = [np.eye(3), np.eye(3)]  # rows: tangent, tangent, normal
        self.slip = np.zeros((2, 2))
        self.contacts: list[tuple[str, float, float]] = []
        self.since = [0.0, 0.0]

    def loaded(self):
        """1.0 for every foot on the ground."""
        return [0.0 if mode is Mode.OPEN else 1.0 for mode in self.mode]

    def update(self):
        """Let the modes change as the forces of the last and the motion of this step demand."""
        d = self.twin.data
        d.qfrc_applied[:] = 0.0
        self.changed = [False, False]  # a new mode's force is known after the next step
        self.held = [mode is Mode.STICK for mode in self.mode]  # in the step whose forces are known
        for f in (0, 1):
            if self.changed[f]:
                continue
            if self.mode[f] is Mode.OPEN:
                x, y, z = d.site_xpos[self.site[f]].tolist()
                if z - self.radius <= self.ground.height(x, y):
                    self._touch(f, x, y)
            elif self.mode[f] is Mode.STICK:
                self._check_stick(f)
            else:
                self._check_slide(f)

    def hold(self, f):
        """Stick foot f where it is."""
        m, d = self.twin.model, self.twin.data
        self._set(f, Mode.STICK)
        m.site_pos[self.anchor[f]] = d.site_xpos[self.site[f]]

    def _set(self, f, mode):
        now = self.twin.data.time
        if self.mode[f] is Mode.OPEN:
            self.since[f] = now
        elif mode is Mode.OPEN:
            self.contacts.append((FEET[f], self.since[f], now))
        self.mode[f], self.changed[f] = mode, True
        self.twin.data.eq_active[self.equality[f]] = mode is Mode.STICK
        deep = 0.0 if mode is Mode.SLIDE else 9.0
        point = self.twin.data.site_xpos[self.site[f]] - (RADIUS + deep) * self.axes[f][2]
        self.twin.tilt_ground(FEET[f], point, self.axes[f].T)

    def _jacobian(self, f):
        m, d = self.twin.model, self.twin.data
        J = np.zeros((3, m.nv))
        mujoco.mj_jacSite(m, d, J, None, self.site[f])
        return self.axes[f] @ J

    def _check_stick(self, f):
        # MuJoCo lists the rows of active equalities first, three each, by their numbers.
        first = 3 if self.held[1 - f] and self.equality[1 - f] < self.equality[f] else 0
        force = self.axes[f] @ self.twin.data.efc_force[first : first + 3]
        if force[2] < 0.0:
            self._set(f, Mode.OPEN)
        elif np.hypot(*force[:2]) > self.friction * force[2]:
            self.slip[f] = -force[:2] / np.hypot(*force[:2])
            self._set(f, Mode.SLIDE)
            self._drag(f, force[2])

    def _check_slide(self, f):
        d = self.twin.data
        load = 0.0
        for k in range(d.ncon):
            contact = d.contact[k]
            if self.plane[f] in contact.geom and contact.efc_address >= 0:
                load = d.efc_force[contact.efc_address]
        m = self.twin.model
        over = d.site_xpos[self.site[f]] - m.geom_pos[self.plane[f]]
        if self.axes[f][2] @ over - RADIUS > LIFTED:
            self._set(f, Mode.OPEN)
            return
        rate = self._jacobian(f)[:2] @ d.qvel
        if rate @ self.slip[f] < 0.0:
            self.hold(f)
            return
        if np.hypot(*rate) > SLOW:
            self.slip[f] = rate / np.hypot(*rate)
        self._drag(f, load)

    def _drag(self, f, load):
        self.twin.data.qfrc_applied += (
            self._jacobian(f)[:2].T @ self.slip[f] * (-self.friction * load)
        )

    def _touch(self, f, x, y):
        slope = (self.ground.height(x + 1e-3, y) - self.ground.height(x - 1e-3, y)) / 2e-3
        c, s = 1.0 / np.hypot(1.0, slope), slope / np.hypot(1.0, slope)
        self.axes[f] = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        d = self.twin.data
        J = self._jacobian(f)
        rate = J @ d.qvel
        if rate[2] < -SLOW:
            self._strike(f)
        elif rate[2] < 0.0:  # it hardly left: sticking would pull, so it slides
            way = rate[:2] if np.hypot(*rate[:2]) > SLOW else J[:2] @ d.qacc
            self.slip[f] = way / np.hypot(*way)
            self._set(f, Mode.SLIDE)

    def _strike(self, f):
        """Stop foot f without rebound; the other one, if it stands, pushes but never pulls."""
        m, d = self.twin.model, self.twin.data
        M = np.zeros((m.nv, m.nv))
        mujoco.mj_fullM(m, d, M)
        struck = [f] + [g for g in (1 - f,) if self.mode[g] is not Mode.OPEN]
        J = np.vstack([self._jacobian(g) for g in struck])
        lift = np.linalg.solve(M, J.T)
        G, free = J @ lift, J @ d.qvel
        impulse = np.zeros(len(free))
        stiff = {k: np.linalg.norm(G[k : k + 2, k : k + 2], 2) for k in range(0, len(free), 3)}
        for _ in range(2000):
            for k in stiff:
                n, t = k + 2, slice(k, k + 2)
                impulse[n] = max(0.0, impulse[n] - (free[n] + G[n] @ impulse) / G[n, n])
                impulse[t] -= (free[t] + G[t] @ impulse) / stiff[k]
                size = np.hypot(*impulse[t])
                impulse[t] *= min(1.0, self.friction * impulse[n] / max(size, 1e-300))
        d.qvel += lift @ impulse
        after = free + G @ impulse
        for k, g in enumerate(struck):
            rate, hit = after[3 * k : 3 * k + 2], impulse[3 * k : 3 * k + 3]
            if g != f and hit[2] == 0.0 and after[3 * k + 2] > SLOW:
                self._set(g, Mode.OPEN)
            elif np.hypot(*rate) > SLOW:
                self.slip[g] = rate / np.hypot(*rate)
                self._set(g, Mode.SLIDE)
            else:
                self.hold(g)


def mujoco_walk(system: System, case: WalkCase, *, step: float) -> MujocoWalk:
    """Walk a case with MuJoCo as plant, at one of its steps (s)."""
    robot, springs = system.robot, system.actuators
    start = case.walking.begin(robot, springs)
    controller = start.controller
    twin = MujocoRobot.build(
        robot, springs, step=step, feet=FEET, delay=LONGEST, friction=0.0,
        radius=RADIUS, soft=4.0 * step,
    )  # fmt: skip
    m, d = twin.model, twin.data
    twin.write(start.q, start.v, start.theta, start.theta_dot)
    mujoco.mj_forward(m, d)
    feet = _Feet(twin, case)
    feet.hold(1)

    def measure(t):
        seen = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=2)
        seen.q[:], seen.v[:], seen.theta[:], seen.theta_dot[:] = twin.read()
        seen.data[0] = t
        seen.tau_sea[:] = springs.spring_stiffness * (seen.theta - seen.q_joint)
        seen.contact[:] = feet.loaded()
        return seen

    central, embedded = system.delays.central, system.delays.embedded
    first, command = measure(0.0), np.zeros(robot.n)
    controller.reset(0.0, first)
    controller.tick(0.0, first, command)
    controller.reset(0.0, first)
    twin.fill_delay(command)
    up = Queue(central.up.delay.at, first)
    down = Queue(central.down.delay.at, 0.0)
    drive = Queue(embedded.down.delay.at, 0.0)
    ticks = round(case.walking.duration / TICK)
    rows = []
    for k in range(ticks):
        t = k * TICK
        now = measure(t)
        rows.append((now.q.copy(), now.theta.copy()))
        up.send(t, now)
        controller.tick(t, up.receive(t), command)
        down.send(t, t)
        drive.send(t, down.receive(t))
        acting = drive.receive(t)
        d.ctrl[:] = command
        for _ in range(round(TICK / step)):
            m.actuator_delay[:] = max(d.time - acting - step / 4, 0.0)
            mujoco.mj_step1(m, d)
            mujoco.mj_step2(m, d)
            mujoco.mj_kinematics(m, d)
            mujoco.mj_comPos(m, d)
            feet.update()
    now = measure(ticks * TICK)
    for f in (0, 1):
        if feet.mode[f] is not Mode.OPEN:
            feet.contacts.append((FEET[f], feet.since[f], d.time))
    rows.append((now.q, now.theta))
    return MujocoWalk(
        q=np.array([r[0] for r in rows]),
        theta=np.array([r[1] for r in rows]),
        contacts=feet.contacts,
    )
