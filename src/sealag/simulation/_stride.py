"""The step-to-step map of what runs: a walk that is saved, moved and restored at a section.

The section is the middle of every second step of a clocked gait; two steps are one stride. The map
is the simulator itself, its whole state saved: links, motors, contacts, delay lines, controller.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError, SealagError
from sealag.robot import Robot
from sealag.simulation._interrupt import Interrupt
from sealag.simulation._loop import Loop
from sealag.simulation._network import Clock, Network
from sealag.simulation._outcome import PlantStop
from sealag.simulation._scene import Scene
from sealag.typing import Array
from sealag.walking import GroundProfile, Walking

SAME_CLOCK = 1e-7
"""s: instants of two strides' clocks that differ by less are the same."""


class Fallen(Exception):
    """The stride was not finished."""


class Changed(Exception):
    """The stride did not end as the one it is compared with: another order of steps or contacts."""


class State(NamedTuple):
    """All that a walk is at a section.

    Attributes:
        arrays: of the plant, its links and the controller, copied.
        numbers: the controller's plain numbers.
        clock: the controller's instants before the section, s.
    """

    arrays: tuple[Array, ...]
    numbers: tuple[Any, ...]
    clock: Array


class _Entry(NamedTuple):
    """An array whose entries are coordinates."""

    array: Array
    places: tuple[int, ...]
    own: bool  # whether its places are what the controller believes
    units: float
    newest: Any  # function: the row that is the newest of a ring, or None
    free: Any  # which part of it are coordinates, the newest row of a ring behind the others


def _row_behind(part: Any) -> int:
    """The row behind the newest of a ring."""
    return getattr(part.owner, part.ring) + 1


class Strides:
    """A walk on level ground at constant delay, and its map from one section to the next.

    A state's coordinates are taken relative to where the robot is: a translation along level ground
    is no coordinate. With odometry the controller never reads where it is, and what it believes is
    taken relative to itself.

    Args:
        robot: Robot, as the controller knows it.
        actuators: Springs and motors likewise.
        walking: The walk; its ground is taken as level, its number of steps is the longest way.
        network: Links of constant delay.
        clock: Periods.

    Attributes:
        length: Physics steps of a stride.
        size: Number of coordinates.
        neutral: How many translations are taken out.

    Raises:
        InputError: A step is no whole number of the controller's periods, or the robot cannot walk.
    """

    def __init__(
        self, robot: Robot, actuators: Actuators, walking: Walking, *, network: Network,
        clock: Clock,
    ) -> None:  # fmt: skip
        walking = replace(walking, ground=GroundProfile.flat())
        ticks = walking.gait.step_time / clock.central
        if abs(ticks - round(ticks)) > 1e-6:
            raise InputError(
                f"walking.gait.step_time of {walking.gait.step_time:g} s is no whole number of the "
                f"controller's periods of {clock.central:g} s: no stride is like the one before"
            )
        self.length = 2 * round(ticks) * clock.steps_of("central", clock.central)
        start = walking.begin(robot, actuators, period=clock.central)
        self._loop = Loop(
            robot, actuators, start.controller, network, clock, Scene.of_walk(walking), 0
        )
        self._loop.prepare(start.q, start.v, start.theta, start.theta_dot)
        most = (walking.steps // 2 + 1) * self.length
        self._loop.plan(most, most)
        self._controller = start.controller
        own = walking.options.odometry
        # Commands that a prediction may still count as in flight; older ones are history.
        late = 2.0 * network.central_up.delay.upper_bound + walking.options.embedded_delay
        self._awaited = math.ceil(late / clock.central) + 3
        self.neutral = 4 if own else 2
        self._entries = list(self._listed(own))
        self.size = len(self.coordinates())
        self._arrays = [*self._fixed(), *(entry.array for entry in self._entries)]

    def _fixed(self) -> list[Array]:
        """Arrays of the plant that are restored, and are no coordinates."""
        loop, plant = self._loop, self._loop.plant
        contacts, held, channels = plant.contacts, plant.held, loop.channels
        kept = {id(entry.array) for entry in self._entries}
        every = [
            *plant.now, contacts.closed, contacts.yielding, contacts.floor, contacts.C,
            held.later, held.change, held.look, channels.acting_tick,
        ]  # fmt: skip
        return [array for array in every if id(array) not in kept]

    def _listed(self, own: bool) -> Iterator[_Entry]:
        loop, plant = self._loop, self._loop.plant
        now, channels, robot = plant.now, loop.channels, loop.robot
        every, points = ..., len(plant.contacts.anchor)
        torque = float(plant.actuators.spring_stiffness.max())

        def ring(rows: Array, period: float) -> Any:
            """The row of a ring that belongs to now."""
            every = round(period / loop.clock.physics)
            return lambda: loop.cursor.step // every % len(rows)

        def plain(array: Array, units: float = 1.0, places: tuple[int, ...] = ()) -> _Entry:
            return _Entry(array, places, False, units, None, every)

        yield plain(now.q, places=(0,))
        yield from (plain(array) for array in (now.v, now.theta, now.theta_dot))
        yield plain(now.tau_motor, torque)
        yield plain(plant.contacts.anchor, places=tuple(3 * k for k in range(points)))
        yield from (plain(array, torque) for array in (plant.held.command, channels.sent))
        rows, width = channels.samples.shape
        seen = tuple(1 + width * k for k in range(rows))
        # Time and contact flags of a measurement are none; its torques follow from its angles.
        measured = (every, slice(1, 1 + robot.nq + robot.nv + 2 * robot.n))
        tick, look = loop.clock.central, loop.clock.embedded or loop.clock.physics
        at = ring(channels.samples, tick)
        yield _Entry(channels.samples, seen, False, 1.0, at, measured)
        at = ring(channels.commands, tick)
        yield _Entry(channels.commands, (), False, torque, at, every)
        if len(channels.torque_known):
            yield plain(plant.held.known_torque, torque)
            at = ring(channels.torque_history, look)
            yield _Entry(channels.torque_history, (), False, torque, at, every)
        for part in self._controller.memory():
            newest = None
            if part.ring:
                newest = partial(_row_behind, part)
            rows = slice(-self._awaited, None) if part.ring else every
            for array, places in part.arrays:
                yield _Entry(array, places, own, part.units, newest, rows)

    # State ---------------------------------------------------------------------------------------
    def run(self, strides: int) -> None:
        """Walk on.

        Args:
            strides: How many.

        Raises:
            Fallen: The robot fell, or the controller failed.
        """
        loop = self._loop
        with Interrupt() as interrupt:
            try:
                loop.go_on(loop.cursor.step + strides * self.length, interrupt)
            except (PlantStop, SealagError, ArithmeticError, np.linalg.LinAlgError) as stop:
                raise Fallen(str(stop)) from None
        loop.plant.events.clear()

    def save(self) -> State:
        """Return the walk's state now."""
        parts, time = self._controller.memory(), self._loop.plant.time
        return State(
            arrays=(*(array.copy() for array in self._arrays),),
            numbers=(
                time, self._loop.cursor,
                *(getattr(p.owner, name) for p in parts for name in p.numbers),
                *(getattr(p.owner, p.clock) for p in parts if p.clock),
            ),
            clock=np.array([time - getattr(p.owner, p.clock) for p in parts if p.clock]),
        )  # fmt: skip

    def load(self, state: State, change: Array | None = None) -> None:
        """Restore a state.

        Args:
            state: The state.
            change: (N,) added to its coordinates.
        """
        parts = self._controller.memory()
        for array, kept in zip(self._arrays, state.arrays):
            array[...] = kept
        self._loop.plant.time, self._loop.cursor, *rest = state.numbers
        values = iter(rest)
        for part in parts:
            for name in part.numbers:
                setattr(part.owner, name, next(values))
        for part in parts:
            if part.clock:
                setattr(part.owner, part.clock, next(values))
        if change is not None:
            self._move(change)

    def _move(self, change: Array) -> None:
        """Add to the coordinates."""
        done = 0
        for entry in self._entries:
            if not math.isfinite(entry.units):
                continue
            turned = self._turned(entry, entry.array)
            free = turned[entry.free]
            size = free.size
            free += entry.units * change[done : done + size].reshape(free.shape)
            entry.array[...] = turned if entry.newest is None else np.roll(
                turned, entry.newest(), axis=0
            )  # fmt: skip
            done += size
        plant = self._loop.plant
        plant.refresh()

    @staticmethod
    def _turned(entry: _Entry, array: Array) -> Array:
        """A copy whose first row is the newest, where it is a ring."""
        return array.copy() if entry.newest is None else np.roll(array, -entry.newest(), axis=0)

    def signature(self) -> tuple[Any, ...]:
        """Return what two neighbours have in common at a section: contacts, steps, clock."""
        loop, parts = self._loop, self._controller.memory()
        counted = [
            getattr(part.owner, name)
            for part in parts
            for name in part.numbers
            if name != part.ring and not isinstance(getattr(part.owner, name), float)
        ]
        closed = (*loop.plant.contacts.closed.tolist(),)
        clock = (*np.round(self.save().clock / SAME_CLOCK).astype(int).tolist(),)
        return closed, (*counted,), clock

    def plant_change(self, change: Array) -> float:
        """Return the largest entry of a change (N,) that is of links or motors.

        Args:
            change: of all coordinates.
        """
        now = self._loop.plant.now
        count = now.q.size + now.v.size + 2 * now.theta.size
        return float(np.abs(change[:count]).max())

    def push(self, rng: np.random.Generator) -> Array:
        """Return a random change (N,) of all velocities of links and joints, and of nothing else.

        Args:
            rng: Where it comes from.
        """
        velocity = self._loop.plant.now.v
        first, out = self._loop.plant.now.q.size, np.zeros(self.size)
        out[first : first + velocity.size] = rng.normal(size=velocity.size)
        return out

    def coordinates(self) -> Array:
        """Return the coordinates (N,) of the walk's state now, relative to where the robot is."""
        true = next(entry for entry in self._entries if entry.places)
        believed = next((e for e in self._entries if e.places and e.own), true)
        origin, out = [one.array.reshape(-1)[:2].copy() for one in (true, believed)], []
        for entry in self._entries:
            if not math.isfinite(entry.units):
                continue
            array = entry.array.copy()
            flat, place = array.reshape(-1), origin[1 if entry.own else 0]
            for x in entry.places:
                flat[x : x + 2] -= place
            turned = self._turned(entry, array)
            out.append(turned[entry.free].ravel() / entry.units)
        return np.concatenate(out)
