"""The robot with springs on its ground, moved by one step of exactly known error.

Link side: classical fourth-order Runge-Kutta in exponential coordinates about the step's start.
Motor side: exact along the link's cubic motion. Touchdown and lift-off are located inside the step
and end it there, so that the order survives them. First order: sliding friction's direction (see
kernels.contact), torque and velocity limits and Coulomb stick, which act from a step's beginning.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sealag.actuation import Actuators, motor_parameters
from sealag.errors import InputError
from sealag.robot import Robot
from sealag.simulation._contacts import MARGIN, Contacts
from sealag.simulation._ground import Foot
from sealag.simulation._instant import Instant
from sealag.simulation._ledger import Ledger
from sealag.simulation._outcome import EventKind, Outcome, PlantStop
from sealag.typing import Array, IntArray
from sealag.walking import Ground, GroundProfile

FASTEST = 1e4  # rad/s, m/s: beyond any physical range
_EVENTS_PER_STEP = 60
_STABLE = 2.0  # swing of a link on its spring in a step, rad; Runge-Kutta is stable to 2.8
_LOCATE = 40
_SAME = 1e-9  # of a step: lengths this close are one


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
        from sealag.kernels import contact, dynamics, motor, plant

        if not (np.isfinite(step) and step > 0):
            raise InputError(f"the step must be a time > 0 s, got {step}")
        if tuple(actuators.joints) != tuple(robot.joints):
            raise InputError(
                f"actuators are for joints {list(actuators.joints)}, "
                f"the robot has {list(robot.joints)}"
            )
        self._kernel, self._contact = plant, contact
        self.robot, self.actuators, self.step_length = robot, actuators, step
        self.contacts = Contacts(
            robot, feet, ground or GroundProfile(), loaded_frames, stabilisation=stabilisation,
            stop_time=step,
        )  # fmt: skip
        n, nv, self._sizes = robot.n, robot.nv, self.contacts.sizes
        self.time = 0.0
        self._terms = dynamics.allocate(robot.tree[0])
        self._parameters = motor_parameters(actuators, robot.damping)
        self._instant = 0.0 if delayed_torque_feedback else 1.0
        self._tables = (
            np.empty((n, 4, 9, 9)),
            np.empty((n, 4, 9, 9)),
            np.empty((n, 4, 5, 9, 9)),
        )
        motor.tables(self._parameters, self._instant, step, *self._tables)
        self._now, self._next, self._stage = (Instant(self._sizes) for _ in range(3))
        self._memory = np.zeros(plant.memory_size(nv, n))
        parts = plant.shared(self._memory, nv, n)
        self._powers, self._work = parts[2], parts[5]
        self.ledger = Ledger(self._parameters)
        self.impulse = np.zeros((self.contacts.count, 3))
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
            InputError: A foot begins inside the ground, no contact forces can hold the state, or
                the step is too long for a light link on a stiff spring.
        """
        now, n = self._now, self.robot.n
        now.q[:], now.v[:] = q, v
        now.z[:] = 0.0
        now.z[:, 0] = now.q[-n:] if theta is None else theta
        now.z[:, 1] = now.v[-n:] if theta_dot is None else theta_dot
        self.time = 0.0
        self.events.clear()
        self.contacts.open_all()
        self._evaluate(now)
        self.refuse_long_step()
        self.contacts.refuse_buried(now)
        self.contacts.measure_gaps(now)
        try:
            self._touch(now, self.contacts.touching(now, tolerance=1e-4))
        except PlantStop as stop:
            raise InputError(f"the run cannot begin: {stop.message}") from None
        self.ledger.begin(now)

    def refuse_long_step(self) -> None:
        """Refuse a step that is too long for the springs and dampers where the robot is now.

        Raises:
            InputError: The fastest link on its spring moves too far in a step.
        """
        rate, joint = fastest_link(self.robot, self.actuators, self.q)
        if rate * self.step_length > _STABLE:
            raise InputError(
                f"the physics step of {self.step_length * 1e3:g} ms is too long: the link of "
                f"{joint} follows its spring and damper at {rate:.0f} 1/s; use at most "
                f"{0.5e3 * _STABLE / rate:.1g} ms (simulation.physics_step_ms), or are they too "
                "stiff for the link's inertia?"
            )

    @property
    def q(self) -> Array:
        """Present configuration of the robot (nq,)."""
        return self._now.q

    @property
    def v(self) -> Array:
        """Present tangent velocity of the robot (nv,)."""
        return self._now.v

    @property
    def theta(self) -> Array:
        """Motor angles (n,), rad."""
        return self._now.z[:, 0]

    @property
    def theta_dot(self) -> Array:
        """Motor speeds (n,), rad/s."""
        return self._now.z[:, 1]

    @property
    def motor_torque(self) -> Array:
        """Torque of the motors (n,), Nm."""
        return self._now.z[:, 2]

    @property
    def tau_sea(self) -> Array:
        """Spring torques (n,), Nm."""
        return self._now.tau

    @property
    def force(self) -> Array:
        """Contact forces in their contact frames (P, 3), N."""
        return self._now.force

    @property
    def instant(self) -> Instant:
        """Everything known about the present instant."""
        return self._now

    def sense(self, t: float, out: Array) -> None:
        """Write what the sensors measure now.

        Args:
            t: The time that the measurement says, s.
            out: The row of a `Measurement` with one contact flag for each foot.
        """
        self._contact.sense(
            self._now.data, self._sizes, self.contacts.closed, self.contacts.foot_of, t, out
        )

    # Motion ------------------------------------------------------------------------------------
    def push(self, load: Array) -> None:
        """Let other forces act on the loaded frames from now on.

        Args:
            load: Forces in the world frame (L, 3), N.
        """
        self.contacts.load[:] = load
        self._evaluate(self._now)

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
        measured = self._now.tau if tau_measured is None else tau_measured
        left = instant - self.time
        regular = abs(left - self.step_length) <= _SAME * self.step_length
        if regular:
            left = self.step_length
        for _ in range(_EVENTS_PER_STEP):
            self.contacts.remember()
            self._try(left, regular, tau_osc, measured)
            margin, point = self.contacts.margin(self._next)
            if margin >= -MARGIN:
                self._accept(left, regular, tau_osc, measured)
                break
            done, point = self._locate(left, margin, point, tau_osc, measured)
            regular = False
            self._accept(done, regular, tau_osc, measured)
            self._change(point)
            left -= done
            if left <= _SAME * self.step_length:
                break
        else:
            raise PlantStop(
                Outcome.CHATTERED,
                f"contacts changed more than {_EVENTS_PER_STEP} times in one step at t = "
                f"{self.time:.4f} s",
            )
        self.time = instant

    def _try(self, step: float, regular: bool, tau_osc: Array, measured: Array) -> None:
        """Fill the next instant with the state one step ahead in the present contact modes."""
        following, contacts = self._next, self.contacts
        solved = self._kernel.advance(
            self.robot.tree, self._terms, contacts.around, contacts.state, contacts.rates,
            self._now.data, self._stage.data, following.data, self._sizes, self._memory,
            self._motors(tau_osc, measured), step, regular,
        )  # fmt: skip
        if not solved:
            raise self._unsolvable(self._stage, following)
        if not math.isfinite(following.energy[0]):
            raise PlantStop(
                Outcome.DIVERGED, f"velocities are not finite after t = {self.time:.4f} s"
            )
        contacts.measure_gaps(following)

    def _motors(self, tau_osc: Array, measured: Array) -> tuple[Any, ...]:
        half, whole, forms = self._tables
        return self._parameters, self._instant, tau_osc, measured, half, whole, forms

    def _evaluate(self, at: Instant) -> None:
        """Evaluate an instant's dynamics and contact forces at its q, v and z."""
        contacts = self.contacts
        solved = self._contact.evaluate(
            self.robot.tree, self._terms, contacts.around, contacts.state, contacts.rates,
            self._parameters, at.data, self._sizes,
        )  # fmt: skip
        if not solved:
            raise self._unsolvable(at)

    def _unsolvable(self, *tried: Instant) -> PlantStop:
        tame = all(float(np.abs(at.v).max()) < FASTEST for at in tried)
        return PlantStop(
            Outcome.CONTACT_UNSOLVABLE if tame else Outcome.DIVERGED,
            f"the equations of motion have no solution after t = {self.time:.4f} s",
        )

    def _accept(self, step: float, regular: bool, tau_osc: Array, measured: Array) -> None:
        """Take the next instant for the present one, and book the step."""
        if not regular:
            self._kernel.book_step(
                self._now.data, self._next.data, self._sizes, self._memory,
                self._motors(tau_osc, measured), step,
            )  # fmt: skip
        self._now, self._next = self._next, self._now
        self.ledger.add(self._work, self._powers, step, self._now)
        self.time += step

    # Contact changes ---------------------------------------------------------------------------
    def _locate(
        self, step: float, f_high: float, point: int, tau_osc: Array, measured: Array
    ) -> tuple[float, int]:
        """Shorten the step to where the first margin vanishes (Illinois); return length, point."""
        low, high, middle = 0.0, step, step
        f_low = max(self.contacts.margin(self._now)[0], MARGIN)
        side = 0
        for _ in range(_LOCATE):
            middle = 0.5 * (low + high)
            if math.isfinite(f_low):  # else the gap widens there: halve
                middle = (low * f_high - high * f_low) / (f_high - f_low)
            self.contacts.recall()
            self._try(middle, False, tau_osc, measured)
            value, at = self.contacts.margin(self._next)
            point = at if value < MARGIN else point
            if abs(value) <= MARGIN or high - low <= 1e-9 * self.step_length:
                break
            if value < 0:
                high, f_high = middle, value
                f_low = 0.5 * f_low if side == -1 else f_low
                side = -1
            else:
                low, f_low = middle, value
                f_high = 0.5 * f_high if side == 1 else f_high
                side = 1
        return middle, point

    def _change(self, point: int) -> None:
        """Let a contact point change at the present instant, where its margin has vanished."""
        now, contacts = self._now, self.contacts
        before = contacts.closed.copy()
        if before[point]:
            contacts.closed[point] = 0
            contacts.settle(now, np.maximum(contacts.touching(now), before))
            contacts.lower_floors(now, before)
            self._evaluate(now)
            contacts.measure_gaps(now)
        else:
            self._touch(now, contacts.touching(now))
        self._report(before)

    def _touch(self, now: Instant, mask: IntArray) -> None:
        """Close every masked point by a plastic impact, then find which contacts hold."""
        contacts = self.contacts
        for point in np.flatnonzero(mask > contacts.closed):
            contacts.close(now, int(point))
        if mask.any():
            touched = contacts.closed.copy()
            self._strike(now, mask)
            contacts.settle(now, contacts.touching(now))
            contacts.lower_floors(now, touched)
            self._evaluate(now)
        contacts.measure_gaps(now)

    def _strike(self, now: Instant, mask: IntArray) -> None:
        speed, impulse = self.contacts.strike(now, mask)
        mean = 0.5 * np.einsum("pab,b->pa", now.J[: self.contacts.count], now.v + speed)
        mean = np.einsum("pab,pb->pa", self.contacts.C, mean)
        now.v[:] = speed
        self.impulse[:] = impulse
        self._evaluate(now)
        self.ledger.strike(-float((mean * impulse).sum()), now)

    def _report(self, before: IntArray) -> None:
        after = self.contacts.closed
        for point in np.flatnonzero(before != after):
            hit = bool(after[point])
            x, y, z = self.impulse[point].tolist() if hit else (0.0, 0.0, 0.0)
            self.events.append(
                ContactEvent(
                    time=self.time,
                    kind=EventKind.TOUCHDOWN if hit else EventKind.LIFT_OFF,
                    foot=self.contacts.feet[self.contacts.foot_of[point]].contact.frame,
                    point=int(point),
                    impulse=(x, y, z),
                )
            )


def fastest_link(robot: Robot, actuators: Actuators, q: Array) -> tuple[float, str]:
    """Return how fast the fastest link follows its spring and dampers, and its joint.

    The largest |λ| of M v̇ = -K δ - (D_s + joint damping) v with locked motors and feet in the air,
    1/s: what decides how long a step may be.

    Args:
        robot: The robot.
        actuators: Its springs and motors.
        q: Configuration (nq,).
    """
    n = robot.n
    mobility = np.linalg.inv(robot.mass_matrix(q))[-n:, -n:]
    damping = actuators.spring_damping + robot.damping
    root = np.sqrt(actuators.spring_stiffness)
    O = np.zeros((n, n))
    # State (√K δ, v): without damping the matrix is as well scaled as its eigenvalues.
    A = np.block([[O, np.diag(root)], [-mobility * root, -mobility * damping]])
    values, modes = np.linalg.eig(A)
    fastest = int(np.abs(values).argmax())
    rate, mode = float(np.abs(values[fastest])), np.abs(modes[:, fastest]) ** 2
    taken = mode[:n] + damping * mode[n:] / rate  # energy that spring and dampers take
    return rate, robot.joints[int(taken.argmax())]
