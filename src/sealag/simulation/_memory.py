"""Memory of a run: what is on its way, and the log."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sealag.simulation._exchange import Exchanges
from sealag.simulation._plant import Plant
from sealag.simulation._scene import Push
from sealag.store import Store
from sealag.typing import Array

if TYPE_CHECKING:
    from sealag.kernels.run import Channels, Log


class Events(NamedTuple):
    """What happens between the steps."""

    due: Array  # (E,) instants, s, increasing
    kind: NDArray[np.int8]  # (E,) LOAD, SAMPLE, TICK or TAKE
    tick: NDArray[np.int32]  # (E,) whose sample, or whose command


def events_of(ways: Exchanges, pushes: Sequence[Push]) -> Events:
    """Return all that happens between the steps, in order.

    Args:
        ways: The packets' ways: samples, ticks and takings.
        pushes: Disturbing forces, which begin and end.
    """
    from sealag.kernels.run import LOAD, SAMPLE, TAKE, TICK

    edges = np.unique([t for p in pushes for t in (p.start, p.start + p.duration)])
    samples = np.argsort(ways.seen, kind="stable")
    parts = {
        LOAD: (edges, 0),
        SAMPLE: (ways.seen[samples], samples),
        TICK: (ways.tick, np.arange(len(ways.tick))),
        TAKE: (ways.taken, ways.command),
    }
    count = sum(len(instants) for instants, _ in parts.values())
    due, kind, tick = np.empty(count), np.empty(count, np.int8), np.empty(count, np.int32)
    for what, (instants, whose) in parts.items():
        place = np.arange(len(instants))
        for other, (others, _) in parts.items():
            if other != what:  # of what happens at one instant, the smaller kind comes first
                place += np.searchsorted(others, instants, "right" if other < what else "left")
        due[place], kind[place], tick[place] = instants, what, whose
    return Events(due=due, kind=kind, tick=tick)


def open_channels(
    ways: Exchanges,
    events: Events,
    torque_period: float,
    *,
    first: Array,
    torque: Array,
    row: int,
    work: Array,
) -> "Channels":
    """Allocate what is on its way, as much as there ever is at once.

    Args:
        ways: The packets' ways.
        events: All events, in order.
        torque_period: Time between two looks for the spring torque, s.
        first: First command (n,), Nm.
        torque: First spring torques (n,), Nm.
        row: Length of a measurement.
        work: Works of the undelayed command (n,), J; live.
    """
    from sealag.kernels.run import Channels

    # How many ticks a command may lie before the drives take it, and a sample before a tick.
    issued = np.searchsorted(ways.tick, ways.taken, "right")
    depth = int((issued - ways.command).max(initial=0)) + 1
    earliest = np.minimum.accumulate(ways.seen[::-1])[::-1]
    waiting = np.searchsorted(earliest, ways.tick, "right") - np.arange(len(ways.tick))
    known, late = np.zeros(0) if ways.torque is None else ways.torque, 0.0
    if len(known):
        late = float((torque_period * np.arange(len(known)) - known).max() / torque_period)
    return Channels(
        due=events.due,
        kind=events.kind,
        tick=events.tick,
        samples=np.zeros((int(waiting.max(initial=0)) + 1, row)),
        commands=np.zeros((depth, len(first))),
        sent=first.copy(),
        acting_tick=np.full(1, -1),
        torque_known=known,
        torque_history=np.tile(torque, (math.ceil(late) + 2, 1)),
        storage=np.zeros(1),
        tank=np.zeros(1),
        undelayed_work=work,
    )


def open_log(plant: Plant, rows: int) -> tuple["Log", Store]:
    """Allocate the log of a run; NaN is the time of a row that is not written yet.

    Args:
        plant: The plant.
        rows: How many instants there will be at most.

    Returns:
        The log, and where its arrays lie.

    Raises:
        InputError: It would not fit.
    """
    from sealag.kernels.run import allocate_log, log_shapes

    robot = plant.robot
    shapes = log_shapes(robot.nq, robot.nv, robot.n, points=plant.surroundings.count)
    store = Store.of(
        rows,
        sum(math.prod(shape) for shape in shapes.values()),
        what="The run's log",
        remedy="log less often (simulation.log_period_ms, --log-ms), simulate for a shorter time",
    )
    log = allocate_log(rows, shapes, store.zeros)
    log.time[:] = np.nan
    return log, store
