"""The closed loop: plant, links and controller, each at its own rate."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError, SealagError, SolverError
from sealag.kernels import keep
from sealag.robot import Robot
from sealag.simulation._audit import Books, Stated, UndelayedWork, audit
from sealag.simulation._interrupt import Interrupt
from sealag.simulation._memory import events_of, open_channels, open_log
from sealag.simulation._network import Clock, Network
from sealag.simulation._outcome import Outcome, PlantStop
from sealag.simulation._plant import FASTEST, Plant
from sealag.simulation._run import Run
from sealag.simulation._scene import Scene
from sealag.simulation._start import Start
from sealag.store import release
from sealag.typing import Array
from sealag.whole_body import (
    Measurement,
    TickController,
)

if TYPE_CHECKING:
    from sealag.kernels.run import Limits, Periods

_WATCH = 5e-3  # s between two looks for a fall
_AT_REST = 1e-12  # rad: how far the first motor angles may be from rest
_ROUNDS = 50
_LOGGED = (
    "time", "q", "v", "theta", "theta_dot", "tau_sea", "tau_motor", "tau_command", "tau_osc",
    "contact_mode", "contact_force",
)  # fmt: skip
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
    loop = Loop(
        robot, actuators, controller, network or Network.ideal(), clock or Clock(),
        scene or Scene(), seed,
    )  # fmt: skip
    period = loop.clock.central if loop.clock.log is None else loop.clock.log
    with Interrupt() as interrupt:
        loop.prepare(
            _state("q", start["q"], robot.nq),
            _state("v", start.get("v"), robot.nv),
            start.get("theta"),
            start.get("theta_dot"),
        )
        outcome, message = loop.run(duration, period, progress, interrupt)
    return loop.result(outcome, message)


def _state(name: str, value: Array | None, size: int) -> Array:
    if value is None:
        return np.zeros(size)
    array = np.asarray(value, dtype=float)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{name} must be {size} finite numbers, got shape {array.shape}")
    return array


class Loop:
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
        from sealag.kernels import run

        frames = list(dict.fromkeys(push.frame for push in scene.pushes))
        self.robot, self.controller, self.clock, self.scene = robot, controller, clock, scene
        self.seed, self._network, self._kernel = seed, network, run
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
        allocate = {"nq": robot.nq, "nv": robot.nv, "n": n, "contacts": feet}
        self.truth, self.received = (Measurement.allocate(**allocate) for _ in range(2))
        self._storage = getattr(controller, "storage", None)
        self._tank: Any = controller if hasattr(controller, "tank_energy") else None
        self._given, self._said = UndelayedWork(n), math.inf if self._storage is None else -1.0
        self._frames = frames

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
        self.first, self._limits = first, self._fall_limits()

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
                "the springs have no rest under the controller's first command: stiffen them, or "
                "choose a posture with less load"
            )
        return answer(found.x)

    # Plan --------------------------------------------------------------------------------------
    def plan(self, steps: int, every: int) -> None:
        """Lay out all that happens: loads, samples, ticks and takings, and what is logged."""
        kernel, step = self._kernel, self.clock.physics
        self.plant.held.command[:], self.plant.held.known_torque[:] = self.first, 0.0
        self._log, self._store = open_log(self.plant, -(-steps // every) + 1)  # too long ends here
        ways = self._network.plan(self.clock, duration=steps * step, seed=self.seed)
        self.exchanges = ways
        self._periods = kernel.Periods(
            step=step,
            steps=steps,
            log=every,
            watch=max(1, round(_WATCH / step)),
            torque=self.clock.steps_of("embedded", self.clock.embedded or step),
            torque_period=self.clock.embedded or step,
        )
        self.channels = open_channels(
            ways, events_of(ways, self.scene.pushes), self._periods.torque_period,
            first=self.first, torque=self.plant.now.tau_sea, row=self.truth.data.size,
            work=self._given.work,
        )  # fmt: skip
        self._course = self._course_of(self._periods)
        self.cursor = kernel.Cursor(0.0, 0, 0, kernel.WATCH)

    def go_on(self, steps: int, interrupt: Interrupt) -> None:
        """Go on to the end of a physics step, of those that are planned.

        Raises:
            PlantStop: The robot fell or a step cannot be completed before.
            SealagError: The controller failed.
        """
        self._course = self._course_of(self._periods._replace(steps=steps))
        self._glide(None, interrupt)

    def _course_of(self, periods: "Periods") -> Any:
        """Return the run of some length, as kernels take it."""
        kernel = self._kernel
        return keep(kernel.Course(self.channels, periods, self._limits, self._log))

    def _fall_limits(self) -> "Limits":
        fall, height, tilt, up = self.scene.fall, -math.inf, -math.inf, np.zeros((1, 3))
        if self.robot.nv_base == 6 and fall is not None:
            height, tilt = fall.height_fraction * self._base_height(), math.cos(fall.tilt)
            up[0] = _vertical(self.plant.now.q)
        return self._kernel.Limits(_LONGEST, FASTEST, height, tilt, up)

    def _base_height(self) -> float:
        x, y, z = self.plant.now.q[:3].tolist()
        return z - self.scene.ground.height(x, y)

    # Motion ------------------------------------------------------------------------------------
    def run(
        self,
        duration: float,
        log_period: float,
        progress: Callable[[float], None] | None,
        interrupt: Interrupt,
    ) -> tuple[Outcome, str]:
        """Simulate and log until the end, whatever ends it; the first instant is always logged."""
        if not (math.isfinite(duration) and duration > 0):
            raise InputError(f"the duration must be a time > 0 s, got {duration}")
        steps = round(duration / self.clock.physics)
        if steps < 1:
            raise InputError(
                f"the duration {duration} s is shorter than a step of {self.clock.physics} s"
            )
        self.plan(steps, self.clock.steps_of("log", log_period))
        outcome, message = Outcome.COMPLETED, ""
        try:
            self._glide(progress, interrupt)
            interrupt.check()
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
        if not self._filled():
            still = self._course_of(self._periods._replace(steps=0))
            closing = self._kernel.Cursor(0.0, 0, len(self.channels.due), self._kernel.CLOSE)
            self.plant.glide(still, closing, math.inf)
        return outcome, message

    def _filled(self) -> int:
        """How many instants are logged."""
        return int(np.isfinite(self._log.time).sum())

    def _glide(self, progress: Callable[[float], None] | None, interrupt: Interrupt) -> None:
        """Go on from one thing that needs Python to the next, until the end."""
        kernel, plant, channels = self._kernel, self.plant, self.channels
        course = self._course
        shown, every = 0, max(1, round(0.1 / self.clock.physics))
        while True:
            interrupt.check()
            why, plant.time, self.cursor = plant.glide(course, self.cursor, self._said)
            time, step, event, part = self.cursor
            if step > shown:  # what was there then is logged
                release(*self._log)
                if progress is not None:
                    progress(plant.time)
                shown = step - step % every + every
            if why == kernel.END:
                return
            if why == kernel.FALLEN:
                self._watch()
            elif why == kernel.STATE:
                self._state()
            elif why == kernel.BLOCKED:
                plant.advance(time, plant.held.command, plant.held.known_torque)
            else:
                self.cursor = kernel.Cursor(time, step, event + 1, part)
                if channels.kind[event] == kernel.TICK:
                    self._tick(int(channels.tick[event]))
                else:
                    self._load()

    @staticmethod
    def _ask(question: Callable[..., Any], *arguments: Any) -> Any:
        """Ask the controller; where its arithmetic breaks down, it has failed."""
        try:
            return question(*arguments)
        except SealagError:
            raise
        except _BREAKDOWN as error:
            raise SolverError(f"the controller cannot be evaluated: {error}") from error

    def _load(self) -> None:
        """Let the pushes act that act from now on."""
        now = self.plant.time + self._kernel.SAME * self.clock.physics
        load = np.zeros((len(self._frames), 3))
        for push in self.scene.pushes:
            if push.start <= now < push.start + push.duration:
                load[self._frames.index(push.frame)] += push.force
        self.plant.push(load)

    def _tick(self, tick: int) -> None:
        channels, t = self.channels, float(self.exchanges.tick[tick])
        self.received.data[:] = channels.samples[tick % len(channels.samples)]
        command = channels.commands[tick % len(channels.commands)]
        command[:] = 0.0
        self._ask(self.controller.tick, t, self.received, command)
        if not math.isfinite(sum(command.tolist())):
            raise PlantStop(
                Outcome.CONTROLLER_FAILED, f"the command at t = {t:.4f} s is not finite"
            )
        channels.sent[:] = command
        self._state()

    def _state(self) -> None:
        """Let the controller state its undelayed command and its potential."""
        time, channels = self.plant.time, self.channels
        if self._storage is not None and time != self._said:
            self.plant.sense(time, self.truth.data)
            channels.storage[0] = self._ask(self._storage, time, self.truth, self._given.command)
            self._given.move(self.plant.now.theta)
            self._said = time
        if self._tank is not None:
            channels.tank[0] = self._tank.tank_energy

    def _watch(self) -> None:
        """End the run when the robot has fallen or left any physical range."""
        plant, now = self.plant, self.plant.now
        deflection = np.abs(now.theta - now.q[-self.robot.n :])
        if not ((deflection < _LONGEST).all() and (np.abs(now.v) < FASTEST).all()):
            raise PlantStop(
                Outcome.DIVERGED,
                f"velocities or spring deflections left any physical range at t = "
                f"{plant.time:.4f} s",
            )
        limits = self._limits
        if limits.height > -np.inf:
            height, along = self._base_height(), float(_vertical(now.q) @ limits.up[0])
            if height < limits.height or along < limits.tilt:
                tilt = math.acos(min(1.0, along))
                raise PlantStop(
                    Outcome.FELL,
                    f"the base is {height:.2f} m above the ground and tilted by {tilt:.2f} rad at "
                    f"t = {plant.time:.3f} s",
                )

    # Result ------------------------------------------------------------------------------------
    def result(self, outcome: Outcome, message: str) -> Run:
        """Return what was logged, audited."""
        robot, around, actuators = self.robot, self.plant.surroundings, self.plant.actuators
        log = self._kernel.Log(*(array[: self._filled()] for array in self._log))
        joints, ways = tuple(robot.joints), self.exchanges
        same = self._kernel.SAME * self.clock.physics
        heard = np.searchsorted(ways.tick, log.time + same, "right") - 1
        return Run(
            outcome=outcome,
            message=message,
            seed=self.seed,
            joints=joints,
            feet=tuple(around.feet[f].contact.frame for f in around.foot_of),
            **{name: getattr(log, name) for name in _LOGGED},
            measurement_age=np.where(heard < 0, 0.0, (ways.tick - ways.seen)[heard]),
            command_age=log.time - np.where(log.tick < 0, 0.0, ways.tick[log.tick]),
            ages=ways.ages(self.plant.time),
            events=tuple(self.plant.events),
            audit=audit(
                store=self._store,
                time=log.time,
                joints=joints,
                books=Books(log.stores, log.joint, log.scalar, log.moved),
                theta_dot=log.theta_dot,
                shaped_inertia=actuators.shaped_inertia,
                ratio=actuators.rotor_inertia / actuators.shaped_inertia,
                stated=None
                if self._storage is None
                else Stated(
                    storage=log.storage,
                    tank=log.tank if log.tank.any() else None,
                    work=log.undelayed_work,
                    rough=self._given.rough,
                ),
            ),
        )


def _vertical(q: Array) -> Array:
    """Return the base's z axis in the world."""
    x, y, z, w = q[3:7].tolist()
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
