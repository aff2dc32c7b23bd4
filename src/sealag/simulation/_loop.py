"""The closed loop: plant, links and controller, each at its own rate."""

import math
from collections.abc import Callable
from typing import Any, Unpack

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError, SealagError, SolverError
from sealag.robot import Robot
from sealag.simulation._audit import Stated, UndelayedWork, audit
from sealag.simulation._exchange import SAME, Exchanges
from sealag.simulation._ledger import JOINT_FLOWS, ledger_sizes
from sealag.simulation._network import Clock, Network
from sealag.simulation._outcome import Outcome, PlantStop
from sealag.simulation._plant import FASTEST, Plant
from sealag.simulation._run import Log, Run
from sealag.simulation._scene import Scene
from sealag.simulation._start import Start
from sealag.typing import Array
from sealag.whole_body import (
    Measurement,
    StoringController,
    TankController,
    TickController,
)

_WATCH = 5e-3  # s between two looks for a fall
_AT_REST = 1e-12  # rad: how far the first motor angles may be from rest
_ROUNDS = 50
_SCALARS = ("time", "measurement_age", "command_age", "storage", "tank")
_LONGEST = 100.0  # rad: a spring deflection beyond any physical range
_BREAKDOWN = (np.linalg.LinAlgError, ArithmeticError)  # arithmetic that has no answer
_MAY_BE_NUMERICAL = (Outcome.DIVERGED, Outcome.CONTACT_UNSOLVABLE, Outcome.CHATTERED)


def closed_loop(
    robot: Robot,
    actuators: Actuators,
    controller: TickController,
    *,
    duration: float,
    network: Network | None = None,
    clock: Clock | None = None,
    scene: Scene | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
    **start: Unpack[Start],
) -> Run:
    """Simulate robot, springs, contacts, links and controller together.

    Args:
        robot: The robot.
        actuators: Its springs and motors.
        controller: Any TickController.
        duration: How long to simulate, s.
        network: Delays, jitter and losses; default none.
        clock: Periods of physics, controllers and log.
        scene: Feet, ground, pushes and fall limits.
        seed: Seed of jitter and losses; the same seed gives the same run.
        progress: Called with the simulated time every 0.1 s.
        start: The first state, as `Start` names it; q is needed.

    Returns:
        The run. A fall, divergence, failing controller or Ctrl-C ends it early with a named
        outcome; everything logged until then is in it.

    Raises:
        InputError: An input cannot be simulated: shapes, no duration, a foot inside the ground,
            no contact forces that can hold the first state.
    """
    loop = _Loop(
        robot, actuators, controller, network or Network.ideal(), clock or Clock(),
        scene or Scene(), seed,
    )  # fmt: skip
    loop.prepare(
        _state("q", start["q"], robot.nq),
        _state("v", start.get("v"), robot.nv),
        start.get("theta"),
        start.get("theta_dot"),
    )
    period = loop.clock.central if loop.clock.log is None else loop.clock.log
    return loop.run(duration, period, progress)


def _state(name: str, value: Array | None, size: int) -> Array:
    if value is None:
        return np.zeros(size)
    array = np.asarray(value, dtype=float)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{name} must be {size} finite numbers, got shape {array.shape}")
    return array


class _Loop:
    """One run's plant, links, controller and storage."""

    def __init__(
        self,
        robot: Robot,
        actuators: Actuators,
        controller: TickController,
        network: Network,
        clock: Clock,
        scene: Scene,
        seed: int,
    ) -> None:
        frames = list(dict.fromkeys(push.frame for push in scene.pushes))
        self.robot, self.controller, self.clock, self.scene = robot, controller, clock, scene
        self.seed, self._network = seed, network
        self.plant = Plant(
            robot,
            actuators,
            step=clock.physics,
            feet=scene.feet,
            ground=scene.ground,
            loaded_frames=frames,
            delayed_torque_feedback=network.embedded_up is not None,
            stabilisation=scene.stabilisation,
        )
        n, feet = robot.n, len(scene.feet)
        self._watch_steps = max(1, round(_WATCH / clock.physics))
        allocate = {"nq": robot.nq, "nv": robot.nv, "n": n, "contacts": feet}
        self.truth, self.received = (Measurement.allocate(**allocate) for _ in range(2))
        self._sampled: dict[int, Array] = {}
        self._commands: dict[int, Array] = {}
        self._known, self._sent, self._acting = 0.0, 0.0, 0.0
        self.acting, self._torque_held = np.zeros(n), np.zeros(n)
        self._storing = controller if isinstance(controller, StoringController) else None
        self._tank = controller if isinstance(controller, TankController) else None
        self._given, self._said = UndelayedWork(n), (-1.0, 0.0)
        self._frames = frames
        self._fall_height, self._upright = -np.inf, (0.0, 0.0, 1.0)

    # Start -------------------------------------------------------------------------------------
    def prepare(self, q: Array, v: Array, theta: Array | None, theta_dot: Array | None) -> None:
        """Put the plant in its first state and fill the links with the first command."""
        n, truth = self.robot.n, self.truth
        stiffness = self.plant.actuators.spring_stiffness
        for name, value in (("theta", theta), ("theta_dot", theta_dot)):
            if value is not None:
                _state(name, value, n)
        self.plant.start(q, v, theta=theta, theta_dot=theta_dot)
        first = np.zeros(n)

        def answer(angles: Array) -> Array:
            self.plant.sense(0.0, truth.data)
            truth.theta[:], truth.tau_sea[:] = angles, stiffness * (angles - q[-n:])
            self._ask(self.controller.reset, 0.0, truth)
            self._ask(self.controller.tick, 0.0, truth, first)
            return q[-n:] + first / stiffness

        if theta is None:
            guess = self._rest(answer, q[-n:].copy())
            self.plant.start(q, v, theta=guess, theta_dot=theta_dot)
        else:
            answer(np.asarray(theta, dtype=float))
        self.plant.sense(0.0, truth.data)
        self._ask(self.controller.reset, 0.0, truth)
        self.command = first
        self.acting[:] = first
        self._fall_reference()

    def _rest(self, answer: Callable[[Array], Array], guess: Array) -> Array:
        """Motor angles at which the springs carry the command that these angles call forth."""
        from scipy.optimize import root

        first = guess
        for _ in range(_ROUNDS):
            guess, last = answer(guess), guess
            if not np.abs(guess - first).max(initial=0.0) < _LONGEST:
                break
            if np.abs(guess - last).max(initial=0.0) < _AT_REST:
                return guess
        # A command that is stiffer than the springs: the iteration leads away from the rest.
        found = root(lambda angles: answer(angles) - angles, first, tol=_AT_REST)
        if not (np.isfinite(found.x).all() and np.abs(found.fun).max() < 1e3 * _AT_REST):
            raise InputError(
                "the springs have no rest under the controller's first command; give theta"
            )
        return answer(found.x)

    def _fall_reference(self) -> None:
        if self.robot.nv_base == 6 and self.scene.fall is not None:
            height = self._base_height()
            self._fall_height = self.scene.fall.height_fraction * height
            self._upright = _vertical(self.plant.q)

    def _base_height(self) -> float:
        x, y, z = self.plant.q[:3].tolist()
        return z - self.scene.ground.height(x, y)

    # Motion ------------------------------------------------------------------------------------
    def run(
        self, duration: float, log_period: float, progress: Callable[[float], None] | None
    ) -> Run:
        """Simulate and log until the end, whatever ends it; the first instant is always logged."""
        if not (math.isfinite(duration) and duration > 0):
            raise InputError(f"the duration must be a time > 0 s, got {duration}")
        steps = round(duration / self.clock.physics)
        if steps < 1:
            raise InputError(
                f"the duration {duration} s is shorter than a step of {self.clock.physics} s"
            )
        every = self.clock.steps_of("log", log_period)
        log = self._allocate(steps // every + 2)
        self._plan(steps * self.clock.physics)
        outcome, message = Outcome.COMPLETED, ""
        shown = max(1, round(0.1 / self.clock.physics))
        try:
            for i in range(steps):
                self._begin(i)
                if i % every == 0:
                    self._record(log)
                self._move(i)
                if progress is not None and i % shown == 0:
                    progress(self.plant.time)
            self._begin(steps)
            self._record(log)
        except PlantStop as stop:
            outcome, message = stop.outcome, stop.message
            if outcome in _MAY_BE_NUMERICAL:
                self.plant.refuse_long_step()
        except SealagError as error:
            outcome = Outcome.CONTROLLER_FAILED
            message = f"at t = {self.plant.time:.4f} s: {error}"
        except _BREAKDOWN as error:
            outcome = Outcome.DIVERGED
            message = f"the motion cannot be computed after t = {self.plant.time:.4f} s: {error}"
        except KeyboardInterrupt:
            outcome, message = Outcome.INTERRUPTED, f"stopped at t = {self.plant.time:.4f} s"
        if not log.filled:
            self._record(log)
        return self._result(log, outcome, message)

    def _plan(self, duration: float) -> None:
        """Lay out all that happens between the steps: loads, samples, ticks and takings."""
        ways = Exchanges.plan(self._network, self.clock, duration=duration, seed=self.seed)
        self.exchanges = ways
        edges = [t for push in self.scene.pushes for t in (push.start, push.start + push.duration)]
        times = (np.unique(edges), ways.seen, ways.tick, ways.taken)
        kinds = np.repeat(np.arange(4), [len(t) for t in times])
        time = np.concatenate(times)
        order = np.lexsort((kinds, time))
        number = np.concatenate([np.arange(len(t)) for t in times])
        self._due, self._kind, self._number = time[order], kinds[order], number[order]
        self._next = 0
        self._happen_by = (self._load, self._sample, self._tick, self._take)
        # How many ticks a command may lie before the drives take it.
        issued = np.searchsorted(ways.tick, ways.taken, "right")
        self._depth = int((issued - ways.command).max(initial=0)) + 1
        if ways.torque is not None:
            period = self.clock.embedded or self.clock.physics
            self._torque_steps = self.clock.steps_of("embedded", period)
            late = int(np.ceil((period * np.arange(len(ways.torque)) - ways.torque).max() / period))
            self._history = np.tile(self.plant.tau_sea, (late + 2, 1))

    def _begin(self, i: int) -> None:
        """Let happen what is due at the beginning of physics step i."""
        if i % self._watch_steps == 0:
            self._watch()
        self._happen(i * self.clock.physics)
        if self.exchanges.torque is not None and i % self._torque_steps == 0:
            self._feed_torque(i // self._torque_steps)

    def _move(self, i: int) -> None:
        """Move the plant over physics step i, stopping wherever something is due inside it."""
        end = (i + 1) * self.clock.physics
        last = end - SAME * self.clock.physics
        while self._next < len(self._due) and self._due[self._next] < last:
            instant = float(self._due[self._next])
            self.plant.advance(instant, self.acting, self._torque_held)
            self._happen(instant)
        self.plant.advance(end, self.acting, self._torque_held)

    def _happen(self, instant: float) -> None:
        last = instant + SAME * self.clock.physics
        while self._next < len(self._due) and self._due[self._next] <= last:
            kind, number = self._kind[self._next], int(self._number[self._next])
            self._next += 1
            self._happen_by[kind](number)

    @staticmethod
    def _ask(question: Callable[..., Any], *arguments: Any) -> Any:
        """Ask the controller; where its arithmetic breaks down, it has failed."""
        try:
            return question(*arguments)
        except SealagError:
            raise
        except _BREAKDOWN as error:
            raise SolverError(f"the controller cannot be evaluated: {error}") from error

    def _load(self, _: int) -> None:
        """Let the pushes act that act from now on."""
        now = self.plant.time + SAME * self.clock.physics
        load = np.zeros((len(self._frames), 3))
        for push in self.scene.pushes:
            if push.start <= now < push.start + push.duration:
                load[self._frames.index(push.frame)] += push.force
        self.plant.push(load)

    def _sample(self, tick: int) -> None:
        """Measure what the controller will know at a tick."""
        self.plant.sense(float(self.exchanges.seen[tick]), self.truth.data)
        self._sampled[tick] = self.truth.data.copy()

    def _tick(self, tick: int) -> None:
        t = float(self.exchanges.tick[tick])
        self.received.data[:] = self._sampled.pop(tick)
        self.command = np.zeros(self.robot.n)
        self._ask(self.controller.tick, t, self.received, self.command)
        if not np.isfinite(self.command).all():
            raise PlantStop(
                Outcome.CONTROLLER_FAILED, f"the command at t = {t:.4f} s is not finite"
            )
        self._known, self._sent = self.received.data[0], t
        self._commands[tick] = self.command
        self._commands.pop(tick - self._depth, None)
        self._state_work(self.plant.time)

    def _take(self, taking: int) -> None:
        """Let the drives obey another command."""
        tick = int(self.exchanges.command[taking])
        self.acting[:] = self._commands[tick]
        self._acting = float(self.exchanges.tick[tick])

    def _feed_torque(self, look: int) -> None:
        """Give the drives the spring torque that reaches their torque feedback now."""
        assert self.exchanges.torque is not None
        period, size = self.clock.embedded or self.clock.physics, len(self._history)
        self._history[look % size] = self.plant.tau_sea
        place = float(self.exchanges.torque[look]) / period
        before = int(place + 1e-9)
        part, after = max(0.0, place - before), min(before + 1, look)
        earlier, later = self._history[before % size], self._history[after % size]
        self._torque_held[:] = earlier + part * (later - earlier)

    def _state_work(self, t: float) -> float:
        """Let the controller state its undelayed command and its potential; return the latter."""
        if self._storing is None or t == self._said[0]:
            return self._said[1]
        self.plant.sense(t, self.truth.data)
        storage = self._ask(self._storing.storage, t, self.truth, self._given.command)
        self._given.move(self.plant.theta)
        self._said = t, storage
        return storage

    def _watch(self) -> None:
        """End the run when the robot has fallen or left any physical range."""
        plant = self.plant
        joints = plant.q[-self.robot.n :].tolist()
        tame = all(abs(a - b) < _LONGEST for a, b in zip(plant.theta.tolist(), joints))
        if not (tame and all(abs(speed) < FASTEST for speed in plant.v.tolist())):
            raise PlantStop(
                Outcome.DIVERGED,
                f"velocities or spring deflections left any physical range at t = "
                f"{plant.time:.4f} s",
            )
        if self._fall_height > -np.inf and self.scene.fall is not None:
            height = self._base_height()
            along = sum(a * b for a, b in zip(_vertical(plant.q), self._upright))
            tilt = math.acos(min(1.0, along))
            if height < self._fall_height or tilt > self.scene.fall.tilt:
                raise PlantStop(
                    Outcome.FELL,
                    f"the base is {height:.2f} m above the ground and tilted by {tilt:.2f} rad at "
                    f"t = {plant.time:.3f} s",
                )

    # Storage -----------------------------------------------------------------------------------
    def _allocate(self, rows: int) -> Log:
        n, plant = self.robot.n, self.plant
        widths = {"scalars": len(_SCALARS), "instant": plant.instant.row.size}
        widths |= {"tau_command": n, "tau_osc": n, "given": n}
        widths |= dict.fromkeys(("closed", "yielding"), plant.contacts.count)
        return Log(rows, widths | {"ledger": plant.ledger.data.size})

    def _record(self, log: Log) -> None:
        plant, t = self.plant, self.plant.time
        storage = self._state_work(t)
        tank = 0.0 if self._tank is None else self._tank.tank_energy
        log.row(
            (t, self._sent - self._known, t - self._acting, storage, tank),
            plant.instant.row, self.command, self.acting, self._given.work,
            *plant.contacts.state, plant.ledger.data,
        )  # fmt: skip

    def _result(self, log: Log, outcome: Outcome, message: str) -> Run:
        robot, contacts, actuators = self.robot, self.plant.contacts, self.plant.actuators
        n, joints, said = robot.n, tuple(robot.joints), log.column("scalars", len(_SCALARS))
        scalars: dict[str, Array] = dict(zip(_SCALARS, np.ascontiguousarray(said.T)))
        time = scalars["time"]
        state = self.plant.instant.split(log.column("instant", self.plant.instant.row.size))
        works, scalar, stores, moved = np.split(
            log.column("ledger", sum(ledger_sizes(n))), np.cumsum(ledger_sizes(n))[:-1], axis=1
        )
        closed = log.column("closed", contacts.count)
        sliding = log.column("yielding", contacts.count) > 0.0
        return Run(
            outcome=outcome,
            message=message,
            seed=self.seed,
            joints=joints,
            feet=tuple(contacts.feet[f].contact.frame for f in contacts.foot_of),
            time=time,
            **state,
            tau_command=log.column("tau_command", n),
            tau_osc=log.column("tau_osc", n),
            measurement_age=scalars["measurement_age"],
            command_age=scalars["command_age"],
            ages=self.exchanges.ages(self.plant.time),
            contact_mode=(closed * (1 + sliding)).astype(np.int64),
            events=tuple(self.plant.events),
            audit=audit(
                time=time,
                joints=joints,
                stores=stores,
                joint=works.reshape(-1, len(JOINT_FLOWS), n),
                scalar=scalar,
                throughput=moved[:, 0],
                theta_dot=state["theta_dot"],
                shaped_inertia=actuators.shaped_inertia,
                ratio=actuators.rotor_inertia / actuators.shaped_inertia,
                stated=self._stated(log, scalars),
            ),
        )

    def _stated(self, log: Log, scalars: dict[str, Array]) -> Stated | None:
        """What the controller said about itself, if it does."""
        if self._storing is None:
            return None
        tank = scalars["tank"]
        return Stated(
            storage=scalars["storage"],
            tank=tank if tank.any() else None,
            work=log.column("given", self.robot.n),
            rough=self._given.rough,
        )


def _vertical(q: Array) -> tuple[float, float, float]:
    """Return the base's z axis in the world."""
    x, y, z, w = q[3:7].tolist()
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
