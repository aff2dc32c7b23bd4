"""Memory of a run: what is on its way, and the log."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sealag.simulation._exchange import Exchanges
from sealag.simulation._plant import Plant
from sealag.simulation._run import refuse_large
from sealag.simulation._scene import Push
from sealag.typing import Array, IntArray

if TYPE_CHECKING:
    from sealag.kernels.run import Channels, Log


def events_of(ways: Exchanges, pushes: Sequence[Push]) -> tuple[Array, IntArray, IntArray]:
    """Return instants (E,), kinds and ticks of all that happens between the steps, in order.

    Args:
        ways: The packets' ways: samples, ticks and takings.
        pushes: Disturbing forces, which begin and end.
    """
    from sealag.kernels.run import LOAD, SAMPLE, TAKE, TICK

    edges = np.unique([t for p in pushes for t in (p.start, p.start + p.duration)])
    numbers = np.arange(len(ways.tick))
    parts = (
        (edges, LOAD, np.zeros(len(edges))), (ways.seen, SAMPLE, numbers),
        (ways.tick, TICK, numbers), (ways.taken, TAKE, ways.command),
    )  # fmt: skip
    time = np.concatenate([at for at, _, _ in parts])
    kind = np.concatenate([np.full(len(at), kind) for at, kind, _ in parts]).astype(np.int64)
    tick = np.concatenate([number for _, _, number in parts]).astype(np.int64)
    order = np.lexsort((kind, time))
    return time[order], kind[order], tick[order]


def open_channels(
    ways: Exchanges,
    events: tuple[Array, IntArray, IntArray],
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
        events: Instants (E,), kinds and ticks of all events, in order.
        torque_period: Time between two looks for the spring torque, s.
        first: First command (n,), Nm.
        torque: First spring torques (n,), Nm.
        row: Length of a measurement.
        work: Works of the undelayed command (n,), J; live.
    """
    from sealag.kernels.run import Channels

    due, kind, tick = events
    # How many ticks a command may lie before the drives take it, and a sample before a tick.
    issued = np.searchsorted(ways.tick, ways.taken, "right")
    depth = int((issued - ways.command).max(initial=0)) + 1
    earliest = np.minimum.accumulate(ways.seen[::-1])[::-1]
    waiting = np.searchsorted(earliest, ways.tick, "right") - np.arange(len(ways.tick))
    known, late = np.zeros(0) if ways.torque is None else ways.torque, 0.0
    if len(known):
        late = float((torque_period * np.arange(len(known)) - known).max() / torque_period)
    return Channels(
        due=due,
        kind=kind,
        tick=tick,
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


def empty_log(plant: Plant, rows: int) -> "Log":
    """Allocate the log of a run; NaN is the time of a row that is not written yet.

    Args:
        plant: The plant.
        rows: How many instants there will be at most.

    Raises:
        InputError: It would not fit into memory.
    """
    from sealag.kernels.run import allocate_log, log_shapes

    robot = plant.robot
    shapes = log_shapes(robot.nq, robot.nv, robot.n, points=plant.surroundings.count)
    refuse_large(rows, sum(math.prod(shape) for shape in shapes.values()))
    log = allocate_log(rows, shapes)
    log.time[:] = np.nan
    return log
