"""Any controller, frozen: what ticks is differentiated about a state at rest."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError
from sealag.robot import Contact, Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._frozen import FrozenLoop
from sealag.whole_body._linear import LinearLaw
from sealag.whole_body._links import LinkPlant, null_space
from sealag.whole_body._protocol import Measurement, TickController
from sealag.whole_body._rest import Rest

_STEP = 1e-4
"""rad: half the base of central differences, extrapolated with those of half the base; rates are
moved by ten times as much, torques by K times. Ten times less leaves 1e-8 of the derivative to
rounding; ten times more the bend of the law."""

_SETTLED = 1e-11  # of the command: a smaller change from tick to tick is none
_TICKS = 2000  # to settle, at most
_ROUNDS = 200  # of motor angles that follow the command

_REMEMBERS = 3e-2
"""Share of the answer to one kind of measurement that may come after the first tick and count as
none. A base that follows the joints from tick to tick leaves 2e-2 of it; a filter leaves most."""

_FELT = 1e-3
"""Share of the largest command: kinds of measurement that move it less count as unused. A rate of
1e-3 rad/s is set against an angle of 1e-4 rad, so that it is K_d < 1e-4 s K_p."""

_UNEXPLAINED = 1e-3
"""Share of the answers from tick to tick that a linear memory may leave unexplained. Filters leave
1e-7; an answer that bends leaves more than that ten times larger."""

_BALANCED = 1e-6
"""Share of weight and torques that may be left over. A controller that drifts by more does not hold
the state, and its derivative there says nothing of where it will be."""

_LONGEST = 1e6  # rad: further away no spring rests


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenController:
    """A controller's loop about a state at rest, and how far it may be believed.

    Attributes:
        loop: ẋ = A_0 x + B C x(t − d) + A_e x(t − e); C is the derivative of what ticks.
        rest: the state.
        bend: share of C that differs at half the difference's base: 0 for a linear law.
        memory: share of the answer to a measurement that comes after the first tick, of the kind of
            which most comes late: angles or rates of links or motors, or spring torques.
        unexplained: share of the answers from tick to tick that the loop's memory leaves open; of a
            controller without memory the same as `memory`, of stated matrices 0.
    """

    loop: FrozenLoop
    rest: Rest
    bend: float
    memory: float
    unexplained: float


def freeze(
    controller: TickController,
    robot: Robot,
    actuators: Actuators,
    *,
    contacts: tuple[Contact, ...] = (),
    q: ArrayLike,
    theta: ArrayLike | None = None,
    period: float = 1e-3,
    embedded_delay: float | None = None,
) -> FrozenController:
    """Differentiate a controller that ticks, and close the loop about a state that it holds.

    The answer to a step of each measured quantity is a central difference of `tick`, after the
    controller has settled at rest. What comes at once is

        δτ_osc = C_q δq + C_v δv + C_θ δθ + C_θ̇ δθ̇ + C_τ δτ_sea ;

    what comes later, of filters and estimators, is realised by as many states as it needs (Ho and
    Kalman), which become states of the loop: their bilinear equivalent for this period, exact for
    `sampled_margin` with it. With δτ_sea = K (δθ − δq_j) + D_s (δθ̇ − δq̇_j) and the links, motors
    and drives of `FrozenLoop` that is a loop with one delay, for `margin` and `jitter_margin`. A
    controller that states its matrices, see `TickController`, is not differentiated.

    Args:
        controller: whatever has `reset` and `tick`. It is ticked some thousand times, and reset.
        robot: the robot.
        actuators: springs, motors and drives; damping in the drives is theirs, without delay.
        contacts: which frames are held.
        q: (nq,) configuration at rest.
        theta: (n,) motor angles at rest, rad; None for where springs carry the command.
        period: of the controller's clock, s.
        embedded_delay: how late torque feedback is in the drives, s; None for without delay.

    Returns:
        The loop.

    Raises:
        InputError: shapes do not fit, the controller does not hold the state, never settles, as one
            that integrates, or remembers what no linear memory explains.
    """
    posture = np.asarray(q, dtype=float)
    if posture.shape != (robot.nq,) or not np.isfinite(posture).all():
        raise InputError(f"q must be {robot.nq} finite numbers, got shape {posture.shape}.")
    stated: Any = getattr(controller, "state_space", None)
    if stated is not None and theta is None:
        theta = getattr(controller, "theta", None)
    ticked = _Ticked(controller, robot, actuators, contacts=len(contacts), period=period)
    rest = ticked.rest(posture, theta)
    _require_balance(robot, contacts, rest, ticked.command(rest))
    found = ticked.linear(rest) if stated is None else _stated(stated, robot)
    loop = FrozenLoop.with_derivative(
        robot,
        found.law.of_springs(actuators).derivative(),
        actuators,
        contacts=contacts,
        rest=rest,
        embedded_delay=embedded_delay,
    )
    return FrozenController(
        loop=replace(loop, bend=found.bend),
        rest=rest,
        bend=found.bend,
        memory=found.memory,
        unexplained=found.unexplained,
    )


class _Found(NamedTuple):
    """A law, and how far it may be believed."""

    law: LinearLaw
    bend: float
    memory: float
    unexplained: float


def _stated(own: Any, robot: Robot) -> _Found:
    """The matrices that a controller states, of all that can be measured."""
    n, nv, s = robot.n, robot.nv, len(own.A)
    for name, shape in {"A": (s, s), "B": (s, 2 * n), "C": (n, s), "D": (n, 2 * n)}.items():
        if np.shape(getattr(own, name)) != shape:
            raise InputError(
                f"The controller's {name} is {np.shape(getattr(own, name))}; {shape} is right."
            )
    at = slice(nv - n, nv) if own.of_links else slice(2 * nv, 2 * nv + n)
    gap = nv if own.of_links else n
    places = np.concatenate([np.arange(at.start, at.stop), np.arange(at.start, at.stop) + gap])
    spread = np.zeros((2 * n, 2 * nv + 3 * n))
    spread[np.arange(2 * n), places] = 1.0
    law = LinearLaw(A=own.A, B=own.B @ spread, C=own.C, D=own.D @ spread, period=own.period or 0.0)
    return _Found(law, 0.0, float(len(own.A) > 0), 0.0)


class _Answers(NamedTuple):
    """Commands (N, n, m) from the first tick after a unit step of each measured quantity until they
    stay, and the largest share that comes late."""

    steps: Array
    memory: float

    def extrapolated(self, wide: "_Answers") -> "_Answers":
        """Return the limit of these differences and those of twice their base."""
        mine, other = _as_long(self.steps, wide.steps)
        return _Answers((4.0 * mine - other) / 3.0, max(self.memory, wide.memory))

    def change(self, other: "_Answers") -> float:
        mine, theirs = _as_long(self.steps, other.steps)
        return float(np.linalg.norm(mine - theirs) / max(np.linalg.norm(mine), 1e-300))


def _as_long(*answers: Array) -> list[Array]:
    """Answers of one length; the settled command goes on."""
    most = max(len(one) for one in answers)
    return [np.concatenate([one, np.repeat(one[-1:], most - len(one), axis=0)]) for one in answers]


class _Ticked:
    """A controller between its clock and its measurements."""

    def __init__(
        self,
        controller: TickController,
        robot: Robot,
        actuators: Actuators,
        *,
        contacts: int,
        period: float,
    ) -> None:
        self._controller, self._robot, self._period = controller, robot, period
        self._K = actuators.spring_stiffness
        self._measured = Measurement.allocate(
            nq=robot.nq, nv=robot.nv, n=robot.n, contacts=contacts
        )
        self._measured.contact[:] = 1.0
        self._t = 0.0

    def _see(self, q: Array, theta: Array) -> None:
        """Measure a state at rest."""
        seen = self._measured
        seen.q[:], seen.theta[:] = q, theta
        seen.v[:], seen.theta_dot[:] = 0.0, 0.0
        seen.tau_sea[:] = self._K * (theta - self._robot.joint_positions(q))

    def _reset(self) -> None:
        self._t = 0.0
        self._measured.data[0] = 0.0
        self._controller.reset(0.0, self._measured)

    def _tick(self) -> Array:
        out = np.zeros(self._robot.n)
        self._measured.data[0] = self._t
        self._controller.tick(self._t, self._measured, out)
        self._t += self._period
        if not np.isfinite(out).all():
            raise InputError("The controller's command at rest is not finite.")
        return out

    def _settle(self) -> list[Array]:
        """Tick until the command stays, and return all of them."""
        commands = [self._tick()]
        for _ in range(_TICKS):
            commands.append(self._tick())
            last, command = commands[-2:]
            if np.abs(command - last).max() <= _SETTLED * (1.0 + np.abs(command).max()):
                return commands
        raise InputError(
            f"The controller's command does not settle within {_TICKS} ticks of one measurement: "
            "it moves by itself, or integrates."
        )

    def command(self, rest: Rest) -> Array:
        """Return the settled command (n,) at a state."""
        self._see(rest.q, rest.theta)
        self._reset()
        return self._settle()[-1]

    def rest(self, q: Array, theta: ArrayLike | None) -> Rest:
        """Return the state; motor angles follow the command if none are given."""
        joints = self._robot.joint_positions(q)
        found = joints.copy() if theta is None else np.asarray(theta, dtype=float)
        if found.shape != joints.shape or not np.isfinite(found).all():
            raise InputError(f"theta must be {len(joints)} finite numbers, got {found.shape}.")
        for _ in range(_ROUNDS if theta is None else 0):
            self._see(q, found)
            self._reset()
            found, last = joints + self._settle()[-1] / self._K, found
            if np.abs(found - last).max() <= 1e-14 or np.abs(found).max() > _LONGEST:
                break
        return Rest(
            q=q, theta=found, tau_sea=self._K * (found - joints), found=True, moved=0.0, reason=""
        )

    def linear(self, rest: Rest) -> _Found:
        """Differentiate by all that is measured, and realise what comes late."""
        wide, narrow = (self._answers(rest, step) for step in (_STEP, _STEP / 2.0))
        found, bend = narrow.extrapolated(wide), narrow.change(wide)
        if found.memory <= _REMEMBERS:
            return _Found(LinearLaw.static(found.steps[-1]), bend, found.memory, found.memory)
        law, left = LinearLaw.realised(found.steps, period=self._period)
        if left > _UNEXPLAINED:
            raise InputError(
                f"The controller remembers: {found.memory:.0%} of its answer to a measurement "
                f"comes after the first tick, and {left:.1%} of it is what no linear memory does. "
                "Freeze it without what switches or saturates there."
            )
        return _Found(law, bend, found.memory, left)

    def _answers(self, rest: Rest, step: float) -> _Answers:
        robot, seen = self._robot, self._measured
        answers: list[Array] = []
        late, size = [], []  # of each kind

        def add(place: Array, base: float, *, tangent: bool = False) -> None:
            """The answers to one part of the measurement."""
            late.append(0.0)
            size.append(0.0)
            for way in np.eye(robot.nv if tangent else place.size):
                both = []
                for sign in (base, -base):
                    before = self.command(rest)
                    place[:] = (
                        robot.integrate(rest.q, sign * way) if tangent else place + sign * way
                    )
                    both.append(np.array(self._settle()) - before)
                    late[-1] = max(late[-1], float(np.abs(both[-1] - both[-1][0]).max()))
                    size[-1] = max(size[-1], float(np.abs(both[-1]).max()))
                plus, minus = _as_long(*both)
                answers.append((plus - minus) / (2.0 * base))

        add(seen.q, step, tangent=True)
        add(seen.v, 10.0 * step)
        add(seen.theta, step)
        add(seen.theta_dot, 10.0 * step)
        add(seen.tau_sea, step * float(self._K.max()))
        steps = np.stack(_as_long(*answers), axis=-1)
        felt = [one > _FELT * max(size) for one in size]
        return _Answers(steps, max((a / b for a, b, f in zip(late, size, felt) if f), default=0.0))


def _require_balance(
    robot: Robot, contacts: tuple[Contact, ...], rest: Rest, command: Array
) -> None:
    """Refuse a state that the controller does not hold."""
    plant = LinkPlant(robot, contacts)
    force = robot.gravity(rest.q)
    scale = max(robot.weight, float(np.abs(force).max()), 1e-3)
    force[robot.nv_base :] -= rest.tau_sea
    left = null_space(plant.jacobian(rest.q), robot.nv).T @ force
    worst = int(np.abs(rest.tau_sea - command).argmax())
    motor = float(np.abs(rest.tau_sea - command)[worst])
    if motor > _BALANCED * scale:
        raise InputError(
            f"The controller does not hold the state: at joint {robot.joints[worst]} the spring "
            f"carries {rest.tau_sea[worst]:.4g} Nm and the command is {command[worst]:.4g} Nm. "
            "Let it command what holds gravity there, or give the q and theta at which it rests."
        )
    links = float(np.abs(left).max(initial=0.0))
    if links > _BALANCED * scale:
        raise InputError(
            f"The controller does not hold the state: {links:.4g} (N, Nm) of gravity is left that "
            "neither springs nor contacts carry. Let it command what holds gravity there, or give "
            "the q and theta at which it rests."
        )
