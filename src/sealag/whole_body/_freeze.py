"""Any controller, frozen: what ticks is differentiated about a state at rest."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError
from sealag.robot import Contact, Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._frozen import FrozenLoop
from sealag.whole_body._links import LinkPlant, null_space
from sealag.whole_body._protocol import Measurement, TickController
from sealag.whole_body._rest import Rest
from sealag.whole_body._signal_states import LawDerivative

_STEP = 1e-4
"""rad: half the base of central differences, extrapolated with those of half the base; rates are
moved by ten times as much, torques by K times. Ten times less leaves 1e-8 of the derivative to
rounding; ten times more the bend of the law."""

_SETTLED = 1e-11  # of the command: a smaller change from tick to tick is none
_TICKS = 200  # to settle, at most
_REMEMBERS = 1e-2
"""Share of the answer to a measurement that may come after the first tick. One Newton step a tick
towards q̄(θ) leaves 1e-3 of it; a filter leaves most."""

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
        memory: share of the answer to a measurement that comes after the first tick.
    """

    loop: FrozenLoop
    rest: Rest
    bend: float
    memory: float


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

    δτ_osc = C_q δq + C_v δv + C_θ δθ + C_θ̇ δθ̇ + C_τ δτ_sea by central differences of `tick`, each
    after the controller has settled at rest. With δτ_sea = K (δθ − δq_j) + D_s (δθ̇ − δq̇_j) and the
    links, motors and drives of `FrozenLoop` that is a loop with one delay, for `margin` and
    `jitter_margin`. Any law that is a function of the newest measurement: joint PD, a policy,
    gravity compensation, a predictor that does not remember.

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
        InputError: shapes do not fit, the controller does not hold the state, never settles, or
            remembers: then its answer is no function of one measurement.
    """
    posture = np.asarray(q, dtype=float)
    if posture.shape != (robot.nq,) or not np.isfinite(posture).all():
        raise InputError(f"q must be {robot.nq} finite numbers, got shape {posture.shape}.")
    ticked = _Ticked(controller, robot, actuators, contacts=len(contacts), period=period)
    rest = ticked.rest(posture, theta)
    _require_balance(robot, contacts, rest, ticked.command(rest))
    wide, narrow = (ticked.slopes(rest, step) for step in (_STEP, _STEP / 2.0))
    slopes = narrow.extrapolated(wide)
    if slopes.memory > _REMEMBERS:
        raise InputError(
            f"The controller remembers: {slopes.memory:.0%} of its answer to a measurement comes "
            "after the first tick, so that no matrix of the newest measurement stands for it. "
            "Freeze it without its filters or estimators."
        )
    K, base = np.diag(actuators.spring_stiffness), robot.nv_base
    C_q, C_v = slopes.q.copy(), slopes.v.copy()
    C_q[:, base:] -= slopes.torque @ K
    C_v[:, base:] -= slopes.torque * actuators.spring_damping
    loop = FrozenLoop.with_derivative(
        robot,
        replace(
            LawDerivative.memoryless(C_q, slopes.theta + slopes.torque @ K),
            C_v=C_v,
            C_rate=slopes.theta_dot + slopes.torque * actuators.spring_damping,
        ),
        actuators,
        contacts=contacts,
        rest=rest,
        embedded_delay=embedded_delay,
    )
    return FrozenController(loop=loop, rest=rest, bend=narrow.change(wide), memory=slopes.memory)


class _Slopes(NamedTuple):
    """Derivatives of the command by what is measured, and the largest share that comes late."""

    q: Array  # (n, nv)
    v: Array  # (n, nv)
    theta: Array  # (n, n)
    theta_dot: Array  # (n, n)
    torque: Array  # (n, n)
    memory: float

    def extrapolated(self, wide: "_Slopes") -> "_Slopes":
        """Return the limit of these differences and those of twice their base."""
        parts = [(4.0 * mine - other) / 3.0 for mine, other in zip(self[:-1], wide[:-1])]
        return _Slopes(*parts, memory=max(self.memory, wide.memory))

    def change(self, other: "_Slopes") -> float:
        mine, theirs = np.hstack(self[:-1]), np.hstack(other[:-1])
        return float(np.linalg.norm(mine - theirs) / max(np.linalg.norm(mine), 1e-300))


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

    def _settle(self) -> Array:
        """Tick until the command stays."""
        last = self._tick()
        for _ in range(_TICKS):
            command = self._tick()
            if np.abs(command - last).max() <= _SETTLED * (1.0 + np.abs(command).max()):
                return command
            last = command
        raise InputError(
            f"The controller's command does not settle within {_TICKS} ticks of one measurement: "
            "it moves by itself, or integrates."
        )

    def command(self, rest: Rest) -> Array:
        """Return the settled command (n,) at a state."""
        self._see(rest.q, rest.theta)
        self._reset()
        return self._settle()

    def rest(self, q: Array, theta: ArrayLike | None) -> Rest:
        """Return the state; motor angles follow the command if none are given."""
        joints = self._robot.joint_positions(q)
        found = joints.copy() if theta is None else np.asarray(theta, dtype=float)
        if found.shape != joints.shape or not np.isfinite(found).all():
            raise InputError(f"theta must be {len(joints)} finite numbers, got {found.shape}.")
        for _ in range(_TICKS if theta is None else 0):
            self._see(q, found)
            self._reset()
            found, last = joints + self._settle() / self._K, found
            if np.abs(found - last).max() <= 1e-14 or np.abs(found).max() > _LONGEST:
                break
        return Rest(
            q=q, theta=found, tau_sea=self._K * (found - joints), found=True, moved=0.0, reason=""
        )

    def slopes(self, rest: Rest, step: float) -> _Slopes:
        """Differentiate by all that is measured."""
        robot, seen = self._robot, self._measured
        late, size = 0.0, 0.0

        def slope(place: Array, base: float, *, tangent: bool = False) -> Array:
            """The derivative by one part of the measurement, (n, its motions)."""
            nonlocal late, size
            columns = []
            for way in np.eye(robot.nv if tangent else place.size):
                settled = []
                for sign in (base, -base):
                    before = self.command(rest)
                    place[:] = (
                        robot.integrate(rest.q, sign * way) if tangent else place + sign * way
                    )
                    first = self._tick() - before
                    settled.append(self._settle() - before)
                    late = max(late, float(np.abs(settled[-1] - first).max()))
                    size = max(size, *(float(np.abs(one).max()) for one in (first, settled[-1])))
                columns.append((settled[0] - settled[1]) / (2.0 * base))
            return np.array(columns).T

        return _Slopes(
            q=slope(seen.q, step, tangent=True),
            v=slope(seen.v, 10.0 * step),
            theta=slope(seen.theta, step),
            theta_dot=slope(seen.theta_dot, 10.0 * step),
            torque=slope(seen.tau_sea, step * float(self._K.max())),
            memory=late / size if size else 0.0,
        )


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
            "Give the q and theta at which it rests."
        )
    links = float(np.abs(left).max(initial=0.0))
    if links > _BALANCED * scale:
        raise InputError(
            f"The controller does not hold the state: {links:.4g} (N, Nm) of gravity is left that "
            "neither springs nor contacts carry. Give the q and theta at which it rests."
        )
