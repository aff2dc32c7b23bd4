"""The robot with springs on its ground, moved by one step of exactly known error.

Link side: classical fourth-order Runge-Kutta in exponential coordinates about the step's start.
Motor side: exact along the link's cubic motion. Touchdown and lift-off are located inside the step
and end it there, so that the order survives them. First order: sliding friction's direction (see
kernels.contact), torque and velocity limits and Coulomb stick, which act from a step's beginning.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError
from sealag.kernels import keep
from sealag.kernels.ledger import IMPACT
from sealag.robot import Robot
from sealag.simulation._contacts import Surroundings
from sealag.simulation._ground import Foot
from sealag.simulation._outcome import EventKind, Outcome, PlantStop
from sealag.typing import Array, IntArray
from sealag.walking import Ground, GroundProfile

if TYPE_CHECKING:
    from sealag.kernels.contact import Instant
    from sealag.kernels.run import Cursor

FASTEST = 1e4  # rad/s, m/s: beyond any physical range
_EVENTS_PER_STEP = 60
_FASTEST_MOTOR = 1e6
"""1/s: ten times more takes minutes for a second of a robot with 14 joints; motors of robots
follow at 1e3 1/s, their drives at 1e4 1/s."""
_STABLE = 2.0  # swing of a link on its spring in a step, rad; Runge-Kutta is stable to 2.8
_LOCATE = 40
_NOWHERE = (0.0, 0, 0, 0)  # a raw cursor of no run


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactEvent:
    """A change of contact, located inside a step.

    Attributes:
        time: When it happened, s.
        kind: What happened.
        foot: Frame of the foot.
        point: Number of the contact point.
        impulse: Contact impulse in the contact frame (3,), Ns; zero but at a touchdown.
    """

    time: float
    kind: EventKind
    foot: str
    point: int
    impulse: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Plant:
    """A robot with series elastic actuators on a ground; owns its state and moves it.

    Args:
        robot: The rigid bodies.
        actuators: Springs and motors, in the robot's joint order.
        step: Length of a step, s.
        feet: What may touch the ground.
        ground: Where the ground is.
        loaded_frames: Frames on which disturbing forces may act.
        delayed_torque_feedback: The embedded torque feedback uses a measurement that is held over
            the step (and late) instead of the present spring torque.
        stabilisation: Rate at which contacts return to where they closed, 1/s.

    Raises:
        InputError: The step is not a positive time, or the joints do not match.
    """

    def __init__(
        self,
        robot: Robot,
        actuators: Actuators,
        *,
        step: float,
        feet: Sequence[Foot] = (),
        ground: Ground | None = None,
        loaded_frames: Sequence[str] = (),
        delayed_torque_feedback: bool = False,
        stabilisation: float = 50.0,
    ) -> None:
        from sealag.kernels import contact, friction, plant, run

        if not (np.isfinite(step) and step > 0):
            raise InputError(f"the step must be a time > 0 s, got {step}")
        if tuple(actuators.joints) != tuple(robot.joints):
            raise InputError(
                f"actuators are for joints {list(actuators.joints)}, "
                f"the robot has {list(robot.joints)}"
            )
        self._kernel, self._friction, self._run = plant, friction, run
        self.robot, self.actuators, self.step_length = robot, actuators, step
        self.surroundings = Surroundings(
            robot, feet, ground or GroundProfile(), loaded_frames, stabilisation=stabilisation,
            stop_time=step,
        )  # fmt: skip
        self.contacts, mounts = self.surroundings.contacts, self.surroundings.mounts
        self.time = 0.0
        motors = actuators.motors(robot.damping)
        parts = contact.Plant(robot.tree, mounts, motors, self.contacts)
        physics = plant.allocate_physics(parts, instant=not delayed_torque_feedback)
        self.now, self._next, self.held = physics.now, physics.following, physics.held
        self.ledger, self._gained = physics.ledger, physics.memory.gained
        self._physics, self._idle = keep(physics), keep(run.idle(robot.n))
        self.impulse = np.zeros((self.surroundings.count, 3))
        self.events: list[ContactEvent] = []

    # State -------------------------------------------------------------------------------------
    def start(
        self, q: Array, v: Array, *, theta: Array | None = None, theta_dot: Array | None = None
    ) -> None:
        """Set the state at time 0 and close the contacts that touch.

        Args:
            q: Configuration (nq,).
            v: Velocity (nv,).
            theta: Motor angles (n,), rad; default the link angles (springs at rest).
            theta_dot: Motor speeds (n,), rad/s; default the joint rates.

        Raises:
            InputError: A foot begins inside the ground, no contact forces can hold the state, a
                motor is too fast, or the step is too long for a light link on a stiff spring.
        """
        now, n = self.now, self.robot.n
        now.q[:], now.v[:] = q, v
        now.theta[:] = now.q[-n:] if theta is None else theta
        now.theta_dot[:] = now.v[-n:] if theta_dot is None else theta_dot
        now.tau_motor[:], now.force[:] = 0.0, 0.0
        self.time = 0.0
        self.events.clear()
        self.surroundings.open_all()
        self._evaluate()
        self.refuse_fast_motors()
        self.refuse_long_step()
        self.surroundings.refuse_buried(now)
        self.surroundings.measure_gaps(now)
        try:
            self._touch(self.surroundings.touching(now, tolerance=1e-4))
        except PlantStop as stop:
            raise InputError(f"the run cannot begin: {stop.message}") from None
        for book in self.ledger:
            book[:] = 0.0
        self._update_stores()
        self.ledger.moved[0] = 0.0

    def refuse_fast_motors(self) -> None:
        """Refuse motors whose motion would take longer to compute than anybody waits.

        Raises:
            InputError: A motor's time constant is below a microsecond.
        """
        rates = np.zeros(self.robot.n)
        self._kernel.fastest_motors(self._physics, rates)
        j = int(rates.argmax())
        if not rates[j] <= _FASTEST_MOTOR:
            raise InputError(
                f"the motor of {self.robot.joints[j]} follows at {rates[j]:.2g} 1/s; at most "
                f"{_FASTEST_MOTOR:g} 1/s is simulated: its rotor_inertia times inertia_shaping is "
                "too small for motor_damping, spring_stiffness and spring_damping, or its "
                "torque_bandwidth too high"
            )

    def refuse_long_step(self) -> None:
        """Refuse a step that is too long for the springs and dampers where the robot is now.

        Raises:
            InputError: The fastest link on its spring moves too far in a step.
        """
        rate, joint = self.actuators.fastest_link(self.robot, self.now.q)
        if rate * self.step_length > _STABLE:
            raise InputError(
                f"the physics step of {self.step_length * 1e3:g} ms is too long: the link of "
                f"{joint} follows its spring and damper at {rate:.0f} 1/s; use at most "
                f"{0.5e3 * _STABLE / rate:.1g} ms (simulation.physics_step_ms), or are they too "
                "stiff for the link's inertia?"
            )

    def sense(self, t: float, out: Array) -> None:
        """Write what the sensors measure now.

        Args:
            t: The time that the measurement says, s.
            out: The row of a `Measurement` with one contact flag for each foot.
        """
        self._kernel.sense(self._physics, t, out)

    # Motion ------------------------------------------------------------------------------------
    def glide(self, course: Any, cursor: "Cursor", said: float) -> "tuple[int, float, Cursor]":
        """Go on with a run until something needs Python, see `kernels.run.move`.

        Args:
            course: The run, as kernels take it.
            cursor: Where it is.
            said: Instant at which the controller last stated its storage, s.
        """
        return self._run.drive(
            self._physics, course, self._kernel.GLIDE, 0.0, self.contacts.closed, self.impulse,
            tuple(cursor), said,
        )  # fmt: skip

    def push(self, load: Array) -> None:
        """Let other forces act on the loaded frames from now on.

        Args:
            load: Forces in the world frame (L, 3), N.
        """
        self.contacts.load[:] = load
        self._evaluate()

    def advance(self, instant: float, tau_osc: Array, tau_measured: Array | None = None) -> None:
        """Move to an instant, at most a step ahead, under a held command.

        Args:
            instant: Where to stop, s.
            tau_osc: Command as it reached the motors (n,), Nm.
            tau_measured: Spring torque as it reached the embedded controller (n,), Nm; used only
                with ``delayed_torque_feedback``.

        Raises:
            PlantStop: The step cannot be completed; the state is that of the last good instant.
        """
        self.held.command[:] = tau_osc
        self.held.known_torque[:] = self.now.tau_sea if tau_measured is None else tau_measured
        left = instant - self.time
        if abs(left - self.step_length) <= self._kernel.SAME * self.step_length:
            left = self.step_length
        for _ in range(_EVENTS_PER_STEP):
            sliding = self.contacts.yielding.copy()
            self._try(left)
            margin, point = self.surroundings.margin(self._next)
            if margin >= -self._kernel.MARGIN:
                self._take(left)
                break
            done, point = self._locate(left, margin, point, sliding=sliding)
            self._take(done)
            self._change(point)
            left -= done
            if left <= self._kernel.SAME * self.step_length:
                break
        else:
            raise PlantStop(
                Outcome.CHATTERED,
                f"contacts changed more than {_EVENTS_PER_STEP} times in one step at t = "
                f"{self.time:.4f} s",
            )
        self.time = instant

    def _try(self, step: float) -> None:
        """Fill the next instant with the state one step ahead in the present contact modes."""
        if self._act(self._kernel.STEP, step=step)[0]:
            raise self._unsolvable(self._next)
        if not math.isfinite(self._next.energy.sum()):
            raise PlantStop(
                Outcome.DIVERGED, f"velocities are not finite after t = {self.time:.4f} s"
            )
        self.surroundings.measure_gaps(self._next)

    def _take(self, step: float) -> None:
        """Take the next instant for the present one, and book the step."""
        for part, there in zip(self.now, self._next):
            part[:] = there
        self.ledger.joint[:] += self._gained.joint
        self.ledger.scalar[:] += self._gained.scalar
        self._update_stores()
        self.time += step

    def _update_stores(self) -> None:
        self._act(self._kernel.STORE)

    def _act(
        self, what: int, *, step: float = 0.0, touching: IntArray | None = None
    ) -> tuple[int, float]:
        """Do one thing, see `kernels.plant.act`."""
        mask = self.contacts.closed if touching is None else touching
        status, number, _ = self._run.drive(
            self._physics, self._idle, what, step, mask, self.impulse, _NOWHERE, math.inf
        )
        return status, number

    def _evaluate(self) -> None:
        """Evaluate dynamics and contact forces of the present instant at its q, v and motors."""
        if self._act(self._kernel.EVALUATE)[0]:
            raise self._unsolvable(self.now)

    def _unsolvable(self, tried: "Instant") -> PlantStop:
        tame = float(np.abs(tried.v).max()) < FASTEST
        return PlantStop(
            Outcome.CONTACT_UNSOLVABLE if tame else Outcome.DIVERGED,
            f"the equations of motion have no solution after t = {self.time:.4f} s",
        )

    # Contact changes ---------------------------------------------------------------------------
    def _locate(
        self, step: float, f_high: float, point: int, *, sliding: Array
    ) -> tuple[float, int]:
        """Shorten the step to where the first margin vanishes (Chandrupatla); return length, point.

        The margin is the smallest of several, so that its ends may belong to different points: a
        secant is trusted only where three values agree about it, else the bracket is halved.
        """
        tolerance, finest = self._kernel.MARGIN, 1e-9 * self.step_length
        a, f_a, b = step, f_high, 0.0  # the last length, and the other end of the bracket
        f_b = max(self.surroundings.margin(self.now)[0], tolerance)
        share = f_a / (f_a - f_b) if math.isfinite(f_b) else 0.5  # the gap widens there: halve
        for _ in range(_LOCATE):
            self.contacts.yielding[:] = sliding
            middle = a + share * (b - a)
            self._try(middle)
            value, at = self.surroundings.margin(self._next)
            point = at if value < tolerance else point
            if (value < 0) == (f_a < 0):
                c, f_c = a, f_a
            else:
                c, f_c, b, f_b = b, f_b, a, f_a
            a, f_a = middle, value
            if abs(value) <= tolerance or abs(b - a) <= finest:
                break
            share = _share(a, b, c, f_a=f_a, f_b=f_b, f_c=f_c)
            edge = 0.5 * finest / abs(b - a)
            share = min(max(share, edge), 1.0 - edge)
        return a, point

    def _change(self, point: int) -> None:
        """Let a contact point change at the present instant, where its margin has vanished."""
        now, around = self.now, self.surroundings
        before = self.contacts.closed.copy()
        if before[point]:
            self.contacts.closed[point] = 0
            self._resolve(np.maximum(around.touching(now), before))
            around.lower_floors(now, before)
            self._evaluate()
            around.measure_gaps(now)
        else:
            self._touch(around.touching(now))
        self._report(before)

    def _touch(self, mask: IntArray) -> None:
        """Close every masked point by a plastic impact, then find which contacts hold."""
        now, around = self.now, self.surroundings
        for point in np.flatnonzero(mask > self.contacts.closed):
            around.close(now, int(point))
        if mask.any():
            touched = self.contacts.closed.copy()
            lost = self._resolve(mask, impact=True)
            self._evaluate()
            self.ledger.scalar[IMPACT] += lost
            self._update_stores()
            self._resolve(around.touching(now))
            around.lower_floors(now, touched)
            self._evaluate()
        around.measure_gaps(now)

    def _resolve(self, mask: IntArray, *, impact: bool = False) -> float:
        """Find which touching points stay closed; return the energy that an impact takes, J.

        Points that rebound are open afterwards; impulses obey the friction cone.
        """
        what = self._kernel.STRIKE if impact else self._kernel.SETTLE
        status, lost = self._act(what, touching=mask)
        if status != self._friction.SETTLED:
            feet = [foot.contact.frame for foot in self.surroundings.feet]
            touching = sorted({feet[f] for f in self.surroundings.foot_of[mask.nonzero()[0]]})
            raise PlantStop(
                Outcome.CONTACT_UNSOLVABLE,
                f"no contact forces satisfy unilateral contact and friction at {touching}",
            )
        return lost

    def _report(self, before: IntArray) -> None:
        after = self.contacts.closed
        for point in np.flatnonzero(before != after):
            hit = bool(after[point])
            x, y, z = self.impulse[point].tolist() if hit else (0.0, 0.0, 0.0)
            self.events.append(
                ContactEvent(
                    time=self.time,
                    kind=EventKind.TOUCHDOWN if hit else EventKind.LIFT_OFF,
                    foot=self.surroundings.feet[self.surroundings.foot_of[point]].contact.frame,
                    point=int(point),
                    impulse=(x, y, z),
                )
            )


def _share(a: float, b: float, c: float, *, f_a: float, f_b: float, f_c: float) -> float:
    """Return how far from a towards b the root is, by the inverse parabola through three values;
    one half where they are not monotone enough for it."""
    if not (math.isfinite(f_a + f_b + f_c) and f_b != f_c):
        return 0.5
    place, height = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
    if not (height**2 < place and (1.0 - height) ** 2 < 1.0 - place):
        return 0.5
    near = f_a / (f_b - f_a) * f_c / (f_b - f_c)
    return near + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
