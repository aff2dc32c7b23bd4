"""The closed loop: plant, links and controller, each at its own rate."""

import math
from collections.abc import Callable

import numpy as np

from sealag.actuation import Actuators
from sealag.delay import DelayLine
from sealag.errors import InputError, SealagError
from sealag.robot import Robot
from sealag.simulation._audit import Stated, audit
from sealag.simulation._ledger import JOINT_FLOWS, ledger_sizes
from sealag.simulation._network import Clock, Network
from sealag.simulation._outcome import Outcome, PlantStop
from sealag.simulation._plant import FASTEST, Plant
from sealag.simulation._run import Log, Run
from sealag.simulation._scene import Scene
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


def closed_loop(
    robot: Robot,
    actuators: Actuators,
    controller: TickController,
    *,
    q: Array,
    duration: float,
    v: Array | None = None,
    theta: Array | None = None,
    theta_dot: Array | None = None,
    network: Network | None = None,
    clock: Clock | None = None,
    scene: Scene | None = None,
    seed: int = 0,
    log_period: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Simulate robot, springs, contacts, links and controller together.

    Args:
        robot: The robot.
        actuators: Its springs and motors.
        controller: Any TickController.
        q: Configuration at the start (nq,).
        duration: How long to simulate, s.
        v: Velocity at the start (nv,); default at rest.
        theta: Motor angles at the start (n,), rad; default such that the springs carry the
            controller's first command.
        theta_dot: Motor speeds at the start (n,), rad/s; default the joint rates.
        network: Delays, jitter and losses; default none.
        clock: Periods of physics and controllers.
        scene: Feet, ground, pushes and fall limits.
        seed: Seed of jitter and losses; the same seed gives the same run.
        log_period: Time between logged instants, s; default the central period.
        progress: Called with the simulated time every 0.1 s.

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
    loop.prepare(_state("q", q, robot.nq), _state("v", v, robot.nv), theta, theta_dot)
    period = loop.clock.central if log_period is None else log_period
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
        self._central_steps = clock.steps_of("central", clock.central)
        self._embedded_steps = clock.steps_of("embedded", clock.embedded)
        self._watch_steps = max(1, round(_WATCH / clock.physics))
        allocate = {"nq": robot.nq, "nv": robot.nv, "n": n, "contacts": feet}
        self.truth = Measurement.allocate(**allocate)
        self.received = Measurement.allocate(**allocate)
        self.command, self._passing, self.acting = (np.zeros(n + 1) for _ in range(3))
        self._torque_held = np.zeros(n)
        self._open_lines(network, n)
        self._storing = controller if isinstance(controller, StoringController) else None
        self._tank = controller if isinstance(controller, TankController) else None
        self._present = np.zeros(n)
        self._pushes = [(frames.index(push.frame), push) for push in scene.pushes]
        self._fall_height, self._upright = -np.inf, (0.0, 0.0, 1.0)

    def _open_lines(self, network: Network, n: int) -> None:
        clock = self.clock
        streams = [np.random.default_rng(s) for s in np.random.SeedSequence(self.seed).spawn(4)]

        def line(link, width, period, receive_period, rng):
            return DelayLine(
                link, width=width, period=period, receive_period=receive_period, rng=rng
            )

        central, embedded = clock.central, clock.embedded
        self._up = line(network.central_up, self.truth.data.size, embedded, central, streams[0])
        self._down = line(network.central_down, n + 1, central, embedded, streams[1])
        self._drive = line(network.embedded_down, n + 1, embedded, embedded, streams[2])
        self._torque = None
        if network.embedded_up is not None:
            self._torque = line(network.embedded_up, n, embedded, embedded, streams[3])

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
            self.controller.reset(0.0, truth)
            self.controller.tick(0.0, truth, first)
            return q[-n:] + first / stiffness

        if theta is None:
            guess = self._rest(answer, q[-n:].copy())
            self.plant.start(q, v, theta=guess, theta_dot=theta_dot)
        else:
            answer(np.asarray(theta, dtype=float))
        self.plant.sense(0.0, truth.data)
        self.controller.reset(0.0, truth)
        self._up.fill(truth.data)
        self.command[1:] = first
        self._down.fill(self.command)
        self._drive.fill(self.command)
        self._torque_held[:] = self.plant.tau_sea
        if self._torque is not None:
            self._torque.fill(self._torque_held)
        self._fall_reference()

    def _rest(self, answer: Callable[[Array], Array], guess: Array) -> Array:
        """Motor angles at which the springs carry the command that these angles call forth."""
        from scipy.optimize import root

        first = guess
        for _ in range(_ROUNDS):
            guess, last = answer(guess), guess
            if not np.isfinite(guess).all():
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
        outcome, message = Outcome.COMPLETED, ""
        shown = max(1, round(0.1 / self.clock.physics))
        try:
            for i in range(steps):
                self._control(i)
                if i % every == 0:
                    self._record(log)
                self._push(i)
                self.plant.step(self.acting[1:], self._torque_held)
                if progress is not None and i % shown == 0:
                    progress(self.plant.time)
            self.plant.sense(self.plant.time, self.truth.data)
            self._record(log)
        except PlantStop as stop:
            outcome, message = stop.outcome, stop.message
        except SealagError as error:
            outcome = Outcome.CONTROLLER_FAILED
            message = f"at t = {self.plant.time:.4f} s: {error}"
        except KeyboardInterrupt:
            outcome, message = Outcome.INTERRUPTED, f"stopped at t = {self.plant.time:.4f} s"
        if not log.filled:
            self._record(log)
        return self._result(log, outcome, message)

    def _control(self, i: int) -> None:
        """Exchange what is due at physics step i."""
        t = i * self.clock.physics
        if i % self._watch_steps == 0:
            self._watch()
        if i % self._embedded_steps == 0:
            self.plant.sense(t, self.truth.data)
            self._up.send(t, self.truth.data)
        if i % self._central_steps == 0:
            self._up.receive(t, self.received.data)
            self.controller.tick(t, self.received, self.command[1:])
            self.command[0] = t
            if not math.isfinite(sum(self.command.tolist())):
                raise PlantStop(
                    Outcome.CONTROLLER_FAILED, f"the command at t = {t:.4f} s is not finite"
                )
            self._down.send(t, self.command)
        if i % self._embedded_steps == 0:
            self._down.receive(t, self._passing)
            self._drive.send(t, self._passing)
            self._drive.receive(t, self.acting)
            if self._torque is not None:
                self._torque.send(t, self.plant.tau_sea)
                self._torque.receive(t, self._torque_held)

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

    def _push(self, i: int) -> None:
        if not self._pushes:
            return
        load = self.plant.load
        load[:] = 0.0
        step = self.clock.physics
        for frame, push in self._pushes:
            if round(push.start / step) <= i < round((push.start + push.duration) / step):
                load[frame] += push.force

    # Storage -----------------------------------------------------------------------------------
    def _allocate(self, rows: int) -> Log:
        n, plant = self.robot.n, self.plant
        widths = {"scalars": len(_SCALARS), "instant": plant.instant.row.size}
        widths |= {"tau_command": n, "tau_osc": n, "present": n}
        widths |= dict.fromkeys(("closed", "yielding"), plant.contacts.count)
        return Log(rows, widths | {"ledger": plant.ledger.data.size})

    def _record(self, log: Log) -> None:
        plant, t, storage = self.plant, self.plant.time, 0.0
        if self._storing is not None:
            self.plant.sense(t, self.truth.data)
            storage = self._storing.storage(t, self.truth, self._present)
        received, sent, acting = self.received.data[0], self.command[0], self.acting[0]
        tank = 0.0 if self._tank is None else self._tank.tank_energy
        log.row(
            (t, sent - received, t - acting, storage, tank), plant.instant.row, self.command[1:],
            self.acting[1:], self._present, *plant.contacts.state, plant.ledger.data,
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
            command=log.column("present", self.robot.n),
        )


def _vertical(q: Array) -> tuple[float, float, float]:
    """Return the base's z axis in the world."""
    x, y, z, w = q[3:7].tolist()
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
