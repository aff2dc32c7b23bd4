"""The centralised whole-body operational-space controller, Eqs. (10)-(17), one tick at a time."""

from collections.abc import Callable

import numpy as np

from sealag.actuation import Actuators
from sealag.robot import Contact, Robot
from sealag.typing import Array, ArrayLike
from sealag.whole_body._evaluation import LawEvaluation
from sealag.whole_body._held_model import HeldModel
from sealag.whole_body._law import Law
from sealag.whole_body._protocol import Measurement
from sealag.whole_body._tasks import GravityCompensation


class Controller:
    """τ_osc = Σ J*ᵀ S x̃ + ḡ + D_θ θ̇_d at the fed-back signal.

    The configuration that x and all matrices are taken at is moved from the measured one along
    the contact-consistent motions by the difference between the fed-back joint angles and the
    measured ones. `System.controller()` makes a design's. A robot's driver calls it exactly as the
    simulator does; after the first tick no memory is allocated that outlives a tick.
    """

    def __init__(
        self,
        robot: Robot,
        law: Law,
        actuators: Actuators,
        *,
        contacts: tuple[Contact, ...] = (),
        posture: ArrayLike,
        delay_bound: float = 0.0,
        reference: Callable[[float], tuple[Array, Array]] | None = None,
        model_period: float = 0.0,
    ) -> None:
        """Prepare a controller that holds a posture, or follows a reference about it.

        Args:
            robot: the robot.
            law: the law.
            actuators: its springs and damping.
            contacts: which frames are held.
            posture: (nq,) configuration whose task positions are the references, and where
                planned gravity compensation is evaluated.
            delay_bound: d̄ that an energy tank pays for, s.
            reference: returns offset (m,) of the references and its rate (m,) at a time, for all
                rows by priority; None holds still.
            model_period: s between two updates of J* and S, which are held in between; 0 updates
                them at each tick.

        Raises:
            InputError: the posture has another shape, or an energy tank is to hold its matrices.
            UnknownNameError: a frame or joint does not exist.
            RobotError: the mass matrix at the posture is not positive definite.
        """
        self._motor_damping, self._reference = actuators.motor_damping, reference
        self._stated, self._model = law, HeldModel(model_period, law.signal)
        self._law = LawEvaluation(
            robot, law, actuators.spring_stiffness, contacts=contacts, posture=posture
        )
        self._damped = law.damped  # asked of the tasks once, not at each tick
        self._signal = law.signal.start(self._law, delay_bound=delay_bound)

    @property
    def law(self) -> Law:
        """The law that runs."""
        return self._stated

    @property
    def tank_energy(self) -> float:
        """Energy left in the tank, J, never below 0; 0 if the law has none."""
        return self._signal.tank_energy

    def reset(self, t: float, measurement: Measurement) -> None:
        """Reset: fill the tank, take q̄(θ) and x̂ from the measurement.

        Args:
            t: first instant, s.
            measurement: the state then.
        """
        self._model.reset()
        self._signal.reset(t, measurement)

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Compute the command of Eqs. (11), (17).

        Args:
            t: the controller's clock, s.
            measurement: the newest measurement.
            out: (n,) command, Nm.

        Raises:
            RobotError: the mass matrix is not positive definite.
            ContractionError: q̄(θ) is fed back and does not exist, since the task is stiffer than
                the springs, or is not found, since the reference is out of reach.
        """
        rate = self._refer(t)
        self._signal.command(t, measurement, out)
        self._law.keep_following()
        self._model.update(t, self._law.space)
        self._model.replace(self._law.space, self._law.error, out)
        if rate is not None:
            rate = np.array(rate, dtype=float)
            self._law.leave_to_higher(rate)
        if self._damped:
            links = self.law.signal.of_links
            out += self._law.drag(measurement.v_joint if links else measurement.theta_dot, rate)
        if rate is not None and self.law.velocity_feedforward:
            theta_dot = np.linalg.lstsq(self._law.space.J_star, rate, rcond=1e-6)[0]
            out += self._motor_damping * theta_dot

    def storage(self, t: float, measurement: Measurement, command: Array) -> float:
        """Return V_3, the potential of the undelayed command, and the tank's energy, J.

        Its gradient in θ is minus the command, with J* and S frozen where they are:
        V_3 = ½ x̃ᵀ S x̃ − ∫ ḡᵀ dθ; for q̄(θ) that at q̄, less ½ lᵀ K⁻¹ l; through the tank with
        x̃̂ = x_d − x̂, x̂ carried on by J* from the last measured θ to the true one. Compensation
        that is fed back has a potential up to its asymmetry. `tank_energy` is the tank's part
        alone. The next tick is what it would have been without this call.

        Args:
            t: instant at which the references are taken, s.
            measurement: the true state then.
            command: where the undelayed command (n,) is written, without feedforward of θ̇_d, Nm.
        """
        self._refer(t)
        energy, joints = self._signal.present(measurement, command)
        fresh = command / self._law.spring_stiffness * command
        energy += self._model.replace(self._law.space, self._law.error, command)
        if self.law.signal.rests_at_posture:  # V_3 of q̄(θ) holds −½ lᵀ K⁻¹ l
            energy += 0.5 * float((fresh - command / self._law.spring_stiffness * command).sum())
        match self.law.gravity:
            case GravityCompensation.PLANNED:
                energy -= float(self._law.planned_gravity.dot(joints))
            case GravityCompensation.FEEDBACK:
                energy -= self._law.work_of_gravity(measurement.q, joints)
        return energy

    def _refer(self, t: float) -> Array | None:
        """Take the references of an instant; their rate, if there are any."""
        if self._reference is None:
            return None
        offset, rate = self._reference(t)
        self._law.offset[:] = offset
        return rate
