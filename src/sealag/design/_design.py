"""A design and what follows from it: robot, actuators, law, contacts, posture and delays."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from sealag.actuation import Actuators
from sealag.delay import Delays
from sealag.design._matrices import Matrices
from sealag.design._schema import Project, SimulationSection
from sealag.errors import InputError
from sealag.passivity import Criterion
from sealag.robot import Contact, Motion, Robot
from sealag.typing import Array, ArrayLike
from sealag.walking import Walking
from sealag.whole_body import (
    Controller,
    FrozenLoop,
    Law,
    Rest,
    Spaces,
    TickController,
    freeze,
)

_PARTS = {"robot": Robot, "actuators": Actuators, "law": Law, "delays": Delays}


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The project file that a system was read from.

    Attributes:
        text: the file's own text, which recordings carry along.
        project: its keys, checked, with the defaults of those that it leaves out.
        files: everything that was read: project, URDF, motion, delay samples.
        motion_file: the project's own motion, if it names one.
    """

    text: str
    project: Project
    files: tuple[Path, ...]
    motion_file: Path | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A robot with its actuators, law and delays, in SI units. `System`, which answers questions of
    it, says what its fields are."""

    robot: Robot
    actuators: Actuators
    law: Law
    posture: Array
    delays: Delays
    contacts: tuple[Contact, ...] = ()
    name: str = "system"
    criterion: Criterion = Criterion.CERTIFIED
    program: Callable[["Design"], TickController] | None = None
    simulation: SimulationSection = field(default_factory=SimulationSection)
    walking: Walking | None = None
    source: Source | None = None

    def __post_init__(self) -> None:
        """Refuse parts that do not fit each other.

        Raises:
            InputError: a part is of another kind, actuators are of other joints, the posture has
                another shape, is not finite or lies outside the joints' limits, or a robot on a
                fixed base has contacts.
            UnknownNameError: a frame or joint of a task or contact does not exist.
        """
        for name, kind in _PARTS.items():
            given = getattr(self, name)
            if not isinstance(given, kind):
                raise InputError(f"{name} is {str(given)[:100]}; a {kind.__name__} is needed.")
        object.__setattr__(self, "posture", np.asarray(self.posture, dtype=float))
        object.__setattr__(self, "contacts", tuple(self.contacts))
        object.__setattr__(self, "delays", self.delays.sampled())
        if self.actuators.joints != self.robot.joints:
            raise InputError(
                f"The actuators are of {', '.join(self.actuators.joints)}, the robot's joints are "
                f"{', '.join(self.robot.joints)}; both must be the same, in this order."
            )
        if self.posture.shape != (self.robot.nq,):
            raise InputError(
                f"The posture has shape {self.posture.shape}; ({self.robot.nq},) is right, as "
                "`Robot.configuration` makes it."
            )
        if not np.isfinite(self.posture).all():
            raise InputError("The posture is not finite; each of its entries must be a number.")
        self.robot.require_within_limits(self.posture)
        if self.contacts and not self.robot.floating_base:
            raise InputError(
                "The robot's base is fixed, but contacts hold frames to the ground as well; leave "
                "them out, or load the robot with a floating base."
            )
        for contact in self.contacts:
            if not isinstance(contact, Contact):
                raise InputError(f"contacts has {str(contact)[:100]}; Contact(frame=…) is needed.")
            self.robot.check_frame(contact.frame)
        self.law.gain(self.robot)
        self.law.drag(self.robot)

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that it was read from; none of these may be overwritten."""
        if self.source is None:
            urdf = self.robot.urdf_path
            return () if urdf is None else (urdf,)
        return self.source.files

    @property
    def text(self) -> str:
        """The project file's text; empty if it was built in Python."""
        return "" if self.source is None else self.source.text

    @property
    def sha256(self) -> str:
        """SHA-256 of the project file's text; of the empty text if it was built in Python."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def motion_file(self) -> Path | None:
        """The project's own motion, if it names one."""
        return None if self.source is None else self.source.motion_file

    def still(self) -> Motion:
        """Return the posture as a motion of one instant."""
        return Motion(
            time=np.zeros(1),
            q=self.posture[None],
            v=np.zeros((1, self.robot.nv)),
            contact_sets=(self.contacts,),
            contact_index=np.zeros(1, dtype=np.int64),
        )

    def duration(self, scenario: str | None = None) -> float:
        """Return how long a scenario runs unless told otherwise, s.

        Args:
            scenario: its name; the project's if None.

        Raises:
            InputError: it is a walk and the project describes none.
        """
        kind = self.simulation.scenario if scenario is None else scenario
        return self.required_walking().duration if kind == "walk" else self.simulation.duration_s

    def required_walking(self) -> Walking:
        """Return the walk that the project describes.

        Raises:
            InputError: it describes none.
        """
        if self.walking is None:
            raise InputError(
                f"The project {self.name} has no [walking] section; give its feet = [left, right]."
            )
        return self.walking

    def spaces(self, motion: Motion | None = None) -> Spaces:
        """Return the law's matrices along a motion; at the posture if None.

        Args:
            motion: its instants.

        Raises:
            RobotError: a mass matrix is not positive definite.
        """
        self.require_law("The law's matrices are")
        return Spaces.along(self.robot, self.law, self.actuators, motion or self.still())

    def rest(self, motion: Motion | None = None, instant: int = 0) -> Rest:
        """Return where the loop rests while it holds an instant of a motion, or the posture.

        Args:
            motion: its instants; the posture if None.
            instant: which one.
        """
        if self.program is not None:
            return self._frozen_program().rest
        q, contacts = self._held(motion, instant)
        law = self._law_at(motion, instant)
        return Rest.of(self.robot, law, self.actuators, q, contacts=contacts)

    def in_posture(self, motion: Motion | None = None, instant: int = 0) -> Rest:
        """Return the loop's state in an instant's configuration: tasks without error, springs
        that carry gravity.

        Args:
            motion: its instants; the posture if None.
            instant: which one.
        """
        q, contacts = self._held(motion, instant)
        law = self._law_at(motion, instant)
        return Rest.in_posture(self.robot, law, self.actuators, q, contacts=contacts)

    def frozen(
        self,
        motion: Motion | None = None,
        instant: int = 0,
        *,
        rest: Rest | None = None,
        beside: float | None = None,
        period: float | None = None,
    ) -> FrozenLoop:
        """Return the closed loop of the law that runs, where it rests.

        Args:
            motion: its instants; the posture if None.
            instant: which one.
            rest: where the loop rests, if that is known already.
            beside: see `FrozenLoop.of`.
            period: of the clock that a program with memory ticks at, s; the design's if None.

        Raises:
            ContractionError: q̄(θ) is fed back and does not exist.
            InputError: a program's controller cannot be frozen.
        """
        if self.program is not None:
            return self._frozen_program(period).loop
        q, contacts = self._held(motion, instant)
        return FrozenLoop.of(
            self.robot,
            self._law_at(motion, instant),
            self.actuators,
            q,
            contacts=contacts,
            rest=self.rest(motion, instant) if rest is None else rest,
            embedded_delay=self.delays.torque_feedback_delay,
            beside=beside,
        )

    def require_law(self, what: str) -> None:
        """Refuse a question that a controller's program has no answer to.

        Args:
            what: what was asked for, the subject of the sentence.

        Raises:
            InputError: the controller is a program.
        """
        if self.program is not None:
            raise InputError(
                f"{what} those of a law, and the controller of {self.name} is {self.no_law}; "
                "`sealag margin` freezes it."
            )

    @property
    def no_law(self) -> str:
        """What the controller is instead of a law whose potential is known; empty for a law."""
        if isinstance(self.program, Matrices):
            return "given as matrices, which state no potential"
        return "a program, of which only its ticks are known" if self.program else ""

    @property
    def ideal_drives(self) -> bool:
        """Whether every drive gives at once the torque that it is asked for, and no torque feedback
        comes late."""
        return not (np.isfinite(self.actuators.torque_bandwidth).any() or self.late_joints)

    @property
    def late_joints(self) -> tuple[str, ...]:
        """Joints whose drives feed back a late torque; with B_s = B there is no feedback."""
        if not self.delays.torque_feedback_delay:
            return ()
        fed_back = self.actuators.inertia_shaping != 1.0
        return tuple(np.array(self.robot.joints)[fed_back].tolist())

    def controller(
        self,
        posture: ArrayLike | None = None,
        *,
        reference: Callable[[float], tuple[Array, Array]] | None = None,
        model_period: float = 0.0,
    ) -> TickController:
        """Return the controller that runs: the law's `Controller`, or what the program makes.

        Args:
            posture: (nq,) configuration that it holds; the system's if None.
            reference: offset (m,) of the references and its rate (m,) at a time.
            model_period: s between two updates of J* and S; 0 updates them at each tick.

        Raises:
            InputError: a program is asked for another posture, for a moving reference or for a
                slow model.
        """
        if self.program is not None:
            if reference is not None or posture is not None:
                self.require_law("A posture of its own and a moving reference are")
            if model_period > 0.0:
                self.require_law("A model with a rate of its own (simulation.model_period_ms) is")
            return self.program(self)
        return Controller(
            self.robot,
            self.law,
            self.actuators,
            contacts=self.contacts,
            posture=self.posture if posture is None else posture,
            delay_bound=self.delays.d_1,
            reference=reference,
            model_period=model_period,
        )

    def _held(self, motion: Motion | None, instant: int) -> tuple[Array, tuple[Contact, ...]]:
        if motion is None:
            return self.posture, self.contacts
        return motion.q[instant], motion.contact_sets[motion.contact_index[instant]]

    def _law_at(self, motion: Motion | None, instant: int) -> Law:
        """The law with the gains of an instant."""
        if motion is None or motion.stiffness is None:
            return self.law
        factor = float(motion.stiffness[instant])
        tasks = (
            replace(one, stiffness=factor * np.asarray(one.stiffness)) for one in self.law.tasks
        )
        return replace(self.law, tasks=tuple(tasks))

    def _frozen_program(self, period: float | None = None):
        """The program's controller about the posture, frozen as it ticks, at another period (s) if
        one is given."""
        assert self.program is not None
        return freeze(
            self.program(self),
            self.robot,
            self.actuators,
            contacts=self.contacts,
            q=self.posture,
            period=period or self.delays.sample_time,
            embedded_delay=self.delays.torque_feedback_delay,
        )
